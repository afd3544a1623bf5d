"""Laws of one building's road from points to solid: it moves with the points, and bad points get a
status, not a crash.
"""

import numpy as np
import pytest
import shapely
import shapely.affinity

import hiproof
from hiproof import Grade, NoModelError, Status
from hiproof.compose import check_solid
from hiproof.settings import Settings
from hiproof.stages.fit import candidates
from tiny_town import gable

PLAIN = Settings.from_dict({"segment": {"network": "never"}})
FOOTPRINT = shapely.box(0, 0, 12, 8)


def gable_points(n=700, seed=0, noise=0.03):
    rng = np.random.default_rng(seed)
    xy = rng.uniform((0, 0), (12, 8), (n, 2))
    z = gable(xy[:, 0], xy[:, 1], 8.0, 12.0, 5.0, 3.0)
    return np.column_stack([xy, z + rng.normal(0, noise, n)])


class Slope:
    """Terrain that rises to the east and ends at x = 30."""

    source = "a slope"

    def height_at(self, xy):
        return np.where(xy[:, 0] < 30, 0.1 * xy[:, 0] - 1.0, np.nan)


def list_heights(building):
    return np.sort(building.solid.vertices[:, 2])


def test_a_gable_becomes_a_valid_gable():
    building = hiproof.reconstruct(gable_points(), FOOTPRINT, Slope(), PLAIN)
    assert building.status is Status.MODELLED
    assert building.type == "gable"
    assert check_solid(building.solid) == ()
    assert building.solid.volume == pytest.approx(12 * 8 * (5 + 1.5 + 1.0), rel=0.01)
    assert building.z_ground == pytest.approx(-1.0)
    assert building.ground_source == "a slope"
    (line,) = building.terrain_intersection
    assert np.ptp(line[:, 2]) == pytest.approx(1.2)
    assert building.quality.share_within_20cm > 0.99
    assert building.parts[0].parameters["width"] == pytest.approx(8.0, abs=0.05)


@pytest.mark.parametrize("footprint", [FOOTPRINT, None])
def test_the_answer_does_not_depend_on_the_order_or_repetition_of_points(footprint):
    points = gable_points()
    shuffled = np.random.default_rng(1).permutation(np.concatenate([points, points[:50]]))
    first, other = (hiproof.reconstruct(p, footprint, settings=PLAIN) for p in (points, shuffled))
    assert np.array_equal(first.solid.vertices, other.solid.vertices)


def test_the_answer_moves_with_the_points():
    shift = np.array([251_000.0, 6_700_000.0, -250.0])
    building = hiproof.reconstruct(gable_points(), FOOTPRINT, settings=PLAIN)
    moved = hiproof.reconstruct(
        gable_points() + shift,
        shapely.transform(FOOTPRINT, lambda xy: xy + shift[:2]),
        settings=PLAIN,
    )
    assert moved.type == building.type
    assert moved.solid.vertices - shift == pytest.approx(building.solid.vertices, abs=2e-3)


def test_a_turned_building_is_the_same_building():
    turn = shapely.affinity.rotate
    angle = 33.0
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    points = gable_points()
    turned = np.column_stack([points[:, :2] @ np.array([[c, s], [-s, c]]), points[:, 2]])
    building = hiproof.reconstruct(points, FOOTPRINT, settings=PLAIN)
    turned_building = hiproof.reconstruct(
        turned, turn(FOOTPRINT, angle, origin=(0, 0)), settings=PLAIN
    )
    assert turned_building.type == building.type
    assert list_heights(turned_building) == pytest.approx(list_heights(building), abs=0.05)


def test_without_terrain_the_assumption_is_named():
    assert "assumed" in hiproof.reconstruct(gable_points(), FOOTPRINT, settings=PLAIN).ground_source


@pytest.mark.parametrize(("seen_m", "expected"), [(4.0, 4.0), (2.0, 3.0), (0.0, 3.0)])
def test_without_terrain_the_ground_is_at_the_foot_of_walls_that_are_seen(seen_m, expected):
    roof = gable_points()
    eave = roof[:, 2].min()
    depths = np.linspace(0.0, seen_m, 30)
    x = np.full(30, roof[:, 0].min())
    wall = np.column_stack([x, np.linspace(roof[:, 1].min(), roof[:, 1].max(), 30), eave - depths])
    noise = [[roof[:, 0].mean(), roof[:, 1].mean(), eave - 30.0]]
    for points in (np.concatenate([roof, wall]), np.concatenate([roof, wall, noise])):
        building = hiproof.reconstruct(points, FOOTPRINT, settings=PLAIN)
        assert building.ground_source.startswith("assumed")
        assert building.solid.vertices[:, 2].min() == pytest.approx(eave - expected, abs=0.3)


def test_terrain_that_does_not_cover_the_building_is_an_assumption_too():
    distant = shapely.affinity.translate(FOOTPRINT, 100, 0)
    building = hiproof.reconstruct(gable_points() + (100, 0, 0), distant, Slope(), PLAIN)
    assert building.status is Status.MODELLED
    assert "assumed" in building.ground_source


def test_terrain_above_the_eaves_still_gives_a_valid_solid():
    class HighTerrain:
        source = "a wrong terrain model"

        def height_at(self, xy):
            return np.full(len(xy), 50.0)

    building = hiproof.reconstruct(gable_points(), FOOTPRINT, HighTerrain(), PLAIN)
    assert building.built is not None
    assert check_solid(building.solid) == ()
    assert "the ground (a wrong terrain model) lies 45.0 m above its eaves" in building.detail


@pytest.mark.parametrize(
    ("points", "footprint", "status"),
    [
        (np.zeros((0, 3)), FOOTPRINT, Status.NO_POINTS),
        (np.zeros((0, 3)), None, Status.NO_POINTS),
        (gable_points() + (500, 0, 0), FOOTPRINT, Status.NO_POINTS),
        (np.full((50, 3), np.nan), FOOTPRINT, Status.NO_POINTS),
        (gable_points(), shapely.Polygon(), Status.BAD_FOOTPRINT),
        (gable_points(), shapely.Polygon([(0, 0), (5, 0), (10, 0)]), Status.BAD_FOOTPRINT),
        (np.tile([[3.0, 3.0, 5.0]], (40, 1)), None, Status.NO_ROOF),
        (np.linspace((0, 0, 5), (9, 9, 5), 40), None, Status.NO_ROOF),
        (gable_points(3), None, Status.NO_ROOF),
    ],
)
def test_points_that_are_no_roof_get_a_status(points, footprint, status):
    building = hiproof.reconstruct(points, footprint, settings=PLAIN)
    assert building.status is status
    assert building.built is None
    with pytest.raises(NoModelError, match="without one"):
        _ = building.solid
    assert building.detail


@pytest.mark.parametrize(
    "points",
    [
        *(gable_points(n) for n in (1, 2, 3, 4, 5)),
        np.tile([[3.0, 3.0, 5.0]], (40, 1)),
        np.linspace((1, 1, 5), (7, 7, 5), 40),
        np.column_stack([np.full(30, 4.0), np.full(30, 4.0), np.linspace(0, 9, 30)]),
    ],
    ids=["1", "2", "3", "4", "5", "coincident", "collinear", "a pole"],
)
def test_few_or_degenerate_points_in_a_footprint_become_a_simple_valid_model(points):
    building = hiproof.reconstruct(points, FOOTPRINT, settings=PLAIN)
    assert building.status.is_model
    assert check_solid(building.solid) == ()
    roof = building.solid.vertices[:, 2].max()
    assert points[:, 2].min() - 0.5 <= roof <= points[:, 2].max() + 0.5


@pytest.mark.parametrize(
    "nowhere",
    [(6.0, 4.0, -3.4e38), (1e300, 4.0, 5.0), (1.7e308, 1.7e308, 5.0)]
    + [(np.nan, 1.0, 1.0), (1.0, np.inf, 1.0), (1.0, 1.0, -np.inf)],
)
@pytest.mark.parametrize("footprint", [FOOTPRINT, None])
def test_points_that_are_nowhere_on_earth_are_left_out(nowhere, footprint):
    points = gable_points()
    first, other = (
        hiproof.reconstruct(p, footprint, settings=PLAIN)
        for p in (points, np.vstack([points, nowhere]))
    )
    assert np.array_equal(first.solid.vertices, other.solid.vertices)


def test_a_stray_point_far_away_makes_no_cells_up_to_it():
    points = np.vstack([gable_points(), [(-1e6, -1e6, 5.0)]])  # a hundred thousand million cells
    assert hiproof.reconstruct(points, settings=PLAIN).type == "gable"


def test_a_roof_that_cannot_be_composed_falls_back_to_a_flat_block_and_says_so(monkeypatch):
    from hiproof.compose import compose
    from hiproof.errors import CompositionError

    def refuses_slopes(roof, z_ground, settings):
        if any(piece.planes[:, :2].any() for piece in roof.pieces):
            raise CompositionError("planted")
        return compose(roof, z_ground, settings)

    monkeypatch.setattr("hiproof.compose.readable.compose", refuses_slopes)
    building = hiproof.reconstruct(gable_points(), FOOTPRINT, settings=PLAIN)
    assert building.status is Status.SIMPLIFIED
    assert "planted" in building.detail
    assert check_solid(building.solid) == ()
    assert building.type == "flat"


def two_level_points():
    """A gable of 8 m by 8 m beside a flat annex of 4 m, both 3 m and more above the ground."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.2, 12, 0.4), np.arange(0.2, 8, 0.4)))
    return np.column_stack([x, y, np.where(x < 8, 9 - 0.6 * abs(y - 4), 4.0)])


def refuse_roofs(refuses):
    """`compose` that refuses roofs of which `refuses` is true, as if its part 1 could not become
    valid.
    """
    from hiproof.compose import solid
    from hiproof.errors import CompositionError

    real = solid.compose

    def compose(roof, z_ground, settings=None):
        if refuses(roof):
            error = CompositionError("planted")
            error.parts = tuple(k for k, part in enumerate(roof.parts) if part.type == "gable")
            raise error
        return real(roof, z_ground, settings)

    return compose


def test_a_part_that_cannot_be_composed_is_given_up_and_not_the_roof(monkeypatch):
    def has_gable(roof):
        return any(part.type == "gable" for part in roof.parts)

    points = two_level_points()
    monkeypatch.setattr("hiproof.compose.readable.compose", refuse_roofs(has_gable))
    building = hiproof.reconstruct(points, shapely.box(0, 0, 12, 8), settings=PLAIN)
    assert building.status is Status.SIMPLIFIED
    assert "(gable) was made level" in building.detail and "planted" in building.detail
    assert check_solid(building.solid) == ()
    heights = building.roof.height_at(
        np.array([[2.0, 4.0], [10.0, 4.0]]) - building.roof.frame.origin[:2]
    )
    gable, annex = heights + building.roof.frame.origin[2]
    assert annex == pytest.approx(4.0, abs=0.02) and 6.6 < gable < 9.0


def test_a_cloud_that_is_no_roof_is_called_poor():
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform((0, 0), (12, 8), (300, 2)), rng.uniform(0, 15, 300)])
    building = hiproof.reconstruct(points, FOOTPRINT, settings=PLAIN)
    assert building.grade is Grade.POOR and building.status is Status.MODELLED
    assert "of its points lie within 0.2 m" in building.detail


@pytest.mark.parametrize("objective", ["likelihood", "paper"])
def test_one_primitive_by_either_objective(objective):
    settings = PLAIN.replace(
        {"fit": {"parts": "one", "objective": objective, "types": ["gable", "flat"]}}
    )
    building = hiproof.reconstruct(gable_points(), FOOTPRINT, settings=settings)
    assert building.type == "gable"
    assert check_solid(building.solid) == ()


def test_the_network_adds_its_opinion_where_it_is_heeded_or_asked():
    building = hiproof.reconstruct(
        gable_points(), FOOTPRINT, settings=Settings.from_dict({"segment": {"network": "always"}})
    )
    assert building.type == "gable"
    assert sum(building.recognised.values()) == pytest.approx(1.0)
    unasked = hiproof.reconstruct(gable_points(), FOOTPRINT)
    assert unasked.recognised == {}
    assert unasked.parts[0].parameters == building.parts[0].parameters
    without_network = hiproof.reconstruct(
        gable_points(), FOOTPRINT, settings=Settings.from_dict({"fit": {"parts": "one"}})
    )
    assert sum(without_network.types.values()) == pytest.approx(1.0)


def test_parts_that_became_flat_although_not_asked_for_are_told():
    settings = Settings.from_dict({"segment": {"network": "never"}, "fit": {"types": ["hip"]}})
    points = np.column_stack([gable_points()[:, :2], np.full(len(gable_points()), 6.0)])
    building = hiproof.reconstruct(points, FOOTPRINT, settings=settings)
    assert {part.type for part in building.parts} <= {"flat", "hip"}
    assert (
        building.detail
        == "1 of 1 part made flat: none of the types asked for (hip) explains the points there"
    )
    poor = hiproof.reconstruct(gable_points(), FOOTPRINT, settings=settings)
    assert poor.grade is Grade.POOR
    assert "(hip) explains the points there; only " in poor.detail
    good = hiproof.reconstruct(gable_points(), FOOTPRINT, settings=PLAIN)
    assert (good.detail, good.grade) == ("", Grade.GOOD)


def test_a_footprint_with_attributes_keeps_them():
    footprint = hiproof.Footprint("house", FOOTPRINT, {"street": "Main"})
    building = hiproof.reconstruct(gable_points(), footprint, settings=PLAIN)
    assert (building.id, building.attributes) == ("house", {"street": "Main"})


def test_the_papers_objective_fits_only_what_is_asked_for_or_seen():
    paper = Settings.from_dict({"fit": {"objective": "paper"}})
    probabilities = {"gable": 0.6, "hip": 0.3, "mansard": 0.09, "shed": 0.01}
    assert candidates(probabilities, paper) == ("gable", "hip", "mansard")
    assert candidates(probabilities, paper.replace({"fit": {"types": ["hip", "flat"]}})) == ("hip",)
    assert candidates(probabilities, paper.replace({"fit": {"types": ["flat"]}})) == ("flat",)
    assert candidates({}, paper) == candidates(probabilities, Settings()) == ()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"points": gable_points().T}, r"shape \(n, 3\), got \(3, 700\)"),
        ({"points": gable_points()[:, [0, 1, 2, 2]]}, r"shape \(n, 3\), got \(700, 4\)"),
        ({"points": gable_points()[:, :2]}, r"shape \(n, 3\), got \(700, 2\)"),
        ({"points": None}, "got "),
        ({"points": hiproof.PointCloud(gable_points())}, "got PointCloud"),
        ({"footprint": [(0, 0), (12, 0), (12, 8)]}, "polygon of shapely as footprint, got list"),
        (
            {"terrain": "dtm.tif"},
            r"answers height_at, got str; read a raster by hiproof\.read_terrain",
        ),
        ({"settings": {"fit": {}}}, r"got dict; make them by Settings\.from_dict"),
    ],
)
def test_arguments_of_another_shape_or_kind_are_refused(arguments, words):
    with pytest.raises(hiproof.InputError, match=words):
        hiproof.reconstruct(**{"points": gable_points(), "footprint": FOOTPRINT, **arguments})
