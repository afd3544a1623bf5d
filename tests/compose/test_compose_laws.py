"""Laws every composed solid keeps, over generated roofs that hold everything that makes composing
hard, over planes and outlines, and over roofs that once did not become a solid (tests/regressions).
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import roof_zoo
from hiproof.compose import check_solid, compose, terrain_intersection
from hiproof.compose.arrangement import node
from hiproof.compose.settle import settle_outlines
from hiproof.errors import CompositionError
from hiproof.frames import LocalFrame
from hiproof.model import Part, Piece, Roof, Solid
from hiproof.settings import Settings
from roof_zoo import FRAME, KINDS, generate_roof, move_roof

Z_GROUND = -2.0
# random roofs are full of faces thinner than a person draws, which by default join a neighbour:
# which one may hang on a rounding
EXACT = Settings.from_dict({"compose": {"min_face_width_m": 0.01}})
SEEDS = range(12)
WORLD = np.array([85012.345, 446078.912, 3.217])


def plan_polygon(solid, face):
    rings = [solid.vertices[list(ring), :2] for ring in face.rings]
    return shapely.Polygon(rings[0], rings[1:])


def fit_plane(solid, face):
    """The face's plane (a, b, c) by least squares."""
    points = solid.vertices[[v for ring in face.rings for v in ring]]
    design = np.column_stack((points[:, :2], np.ones(len(points))))
    return np.linalg.lstsq(design, points[:, 2], rcond=None)[0]


def measure_roof_height(solid, xy):
    """Height (n,) of the solid's roof faces at `xy`, and how many of them cover each point."""
    z, covering = np.full(len(xy), np.nan), np.zeros(len(xy), int)
    for face in solid.select_faces("RoofSurface"):
        inside = shapely.contains_xy(plan_polygon(solid, face), xy[:, 0], xy[:, 1])
        z[inside] = np.column_stack((xy, np.ones(len(xy))))[inside] @ fit_plane(solid, face)
        covering += inside
    return z, covering


def sample(roof, count, seed):
    """Points inside the outline, two centimetres off its border."""
    x0, y0, x1, y1 = roof.outline.bounds
    xy = np.random.default_rng(seed).uniform((x0, y0), (x1, y1), (count, 2))
    return xy[shapely.contains_xy(roof.outline.buffer(-0.02), xy[:, 0], xy[:, 1])]


@pytest.fixture(scope="module")
def solids():
    """Every (kind, seed) of the zoo with its roof and solid."""
    roofs = {(kind, seed): generate_roof(kind, seed) for kind in KINDS for seed in SEEDS}
    return {key: (roof, compose(roof, Z_GROUND, EXACT)) for key, roof in roofs.items()}


@pytest.mark.parametrize("kind", KINDS)
def test_solid_is_valid_also_in_the_world_and_rounded_as_written(solids, kind):
    for seed in SEEDS:
        _, solid = solids[kind, seed]
        assert check_solid(solid) == ()
        assert check_solid(Solid(np.round(solid.vertices + WORLD, 4), solid.faces)) == ()


def measure_roof_heights(solid):
    """Lowest and highest height of a solid's roof faces."""
    rings = [ring for face in solid.select_faces("RoofSurface") for ring in face.rings]
    z = solid.vertices[np.concatenate(rings), 2]
    return z.min(), z.max()


def count_thin_faces(solid):
    """How many roof faces are thinner than nobody draws."""
    faces = [plan_polygon(solid, face) for face in solid.select_faces("RoofSurface")]
    return sum(2 * face.area / face.length < Settings().compose.min_face_width_m for face in faces)


@pytest.mark.parametrize("kind", KINDS)
def test_thin_faces_join_neighbours_that_carry_their_planes_no_further_than_what_is_around(
    solids, kind
):
    old = new = 0
    for seed in SEEDS:
        roof, exact = solids[kind, seed]
        solid = compose(roof, Z_GROUND)
        assert check_solid(solid) == ()
        (lower, upper), (lowest, highest) = measure_roof_heights(solid), measure_roof_heights(exact)
        # a decimetre; two where slivers lie side by side
        assert lowest - 0.2 < lower and upper < highest + 0.2
        result, covering = measure_roof_height(solid, xy := sample(roof, 1500, seed))
        assert (covering == 1).all()
        expected = roof.height_at(xy)
        assert (np.abs(result - expected) > 2e-3)[np.isfinite(expected)].mean() < 0.1
        old, new = old + count_thin_faces(exact), new + count_thin_faces(solid)
    assert new <= 0.4 * old


@pytest.mark.parametrize("kind", KINDS)
def test_roof_of_the_solid_is_the_height_function(solids, kind):
    for seed in SEEDS:
        roof, solid = solids[kind, seed]
        xy = sample(roof, 1500, seed)
        expected = roof.height_at(xy)
        result, covering = measure_roof_height(solid, xy)
        assert (covering == 1).all()
        is_wrong = np.abs(result - expected)[np.isfinite(expected)] > 2e-3
        assert is_wrong.mean() < 2e-3, f"{kind} {seed}"


@pytest.mark.parametrize("kind", KINDS)
def test_roof_faces_tile_the_outline(solids, kind):
    for seed in SEEDS:
        roof, solid = solids[kind, seed]
        area = sum(plan_polygon(solid, face).area for face in solid.select_faces("RoofSurface"))
        assert area == pytest.approx(roof.outline.area, abs=2e-3 * roof.outline.length)


@pytest.mark.parametrize("kind", KINDS)
def test_answer_moves_with_the_roof(solids, kind):
    for seed in SEEDS:
        roof, solid = solids[kind, seed]
        other = compose(move_roof(roof, 33.3, np.array([12.3456, -7.8912])), Z_GROUND, EXACT)
        extent = solid.vertices[:, 2].max() - solid.vertices[:, 2].min()
        assert other.volume == pytest.approx(solid.volume, abs=2e-3 * roof.outline.length * extent)


def test_a_part_under_the_others_changes_nothing(solids):
    for kind in ("partition", "saw_tooth", "towers"):
        roof, solid = solids[kind, 1]
        hidden_part = Part(
            "flat", (Piece(shapely.box(-9, -9, 9, 9), np.array([[0.0, 0.0, -50.0]])),)
        )
        other = compose(Roof((*roof.parts, hidden_part), roof.outline, roof.frame), Z_GROUND, EXACT)
        assert other.volume == pytest.approx(solid.volume, rel=1e-4)
        assert len(other.select_faces("RoofSurface")) == len(solid.select_faces("RoofSurface"))


def test_order_of_the_parts_does_not_matter(solids):
    for kind in ("partition", "cross_gables", "towers"):
        roof, solid = solids[kind, 2]
        other = compose(Roof(roof.parts[::-1], roof.outline, roof.frame), Z_GROUND, EXACT)
        assert other.volume == pytest.approx(solid.volume, rel=1e-4)


def test_same_roof_same_bytes():
    first, second = (compose(generate_roof("towers", 3), Z_GROUND) for _ in range(2))
    assert first.faces == second.faces and first.vertices.tobytes() == second.vertices.tobytes()


HOUSE = shapely.box(0, 0, 10, 8)
GABLE = np.array([[0.0, 0.5, 5.0], [0.0, -0.5, 9.0]])
HIP = np.vstack((GABLE, [[0.5, 0.0, 5.0], [-0.5, 0.0, 10.0]]))


PYRAMID = HIP - [[0, 0, 0], [0, 0, 1], [0, 0, 0], [0, 0, 1]]


def level(z, box=HOUSE):
    return Piece(box, np.array([[0.0, 0, z]]))


# pieces, outline, and how many faces of roof, walls and ground
COUNTS = {
    "flat": ([level(5)], HOUSE, (1, 4, 1)),
    "gable": ([Piece(HOUSE, GABLE)], HOUSE, (2, 4, 1)),
    "hip": ([Piece(HOUSE, HIP)], HOUSE, (4, 4, 1)),
    "pyramid": ([Piece(shapely.box(0, 0, 8, 8), PYRAMID)], shapely.box(0, 0, 8, 8), (4, 4, 1)),
    "gable clipped to an L": ([Piece(HOUSE, GABLE)], HOUSE - shapely.box(6, 4.5, 10, 8), (2, 6, 1)),
    "gable around a courtyard": ([Piece(HOUSE, GABLE)], HOUSE - shapely.box(3, 3, 5, 5), (2, 8, 1)),
    "two levels": (
        [level(5), level(3, shapely.box(10, 0, 14, 8))],
        shapely.box(0, 0, 14, 8),
        (2, 5, 1),
    ),
    "tower in the middle": ([level(5), level(9, shapely.box(4, 3, 6, 5))], HOUSE, (2, 8, 1)),
}


@pytest.mark.parametrize("name", COUNTS)
def test_faces_of_small_cases(name):
    pieces, outline, counts = COUNTS[name]
    solid, kinds = compose(roof_zoo.roof(pieces, outline), 0.0), ("Roof", "Wall", "Ground")
    assert tuple(len(solid.select_faces(f"{kind}Surface")) for kind in kinds) == counts
    assert len(solid.select_faces("GroundSurface")[0].rings) == 1 + len(outline.interiors)


def test_roof_faces_name_their_part():
    pieces, outline, _ = COUNTS["two levels"]
    solid = compose(roof_zoo.roof(pieces, outline), 0.0)
    roofs = solid.select_faces("RoofSurface")
    heights = {face.part: solid.vertices[face.rings[0][0], 2] for face in roofs}
    assert heights == {0: 5.0, 1: 3.0}
    assert {face.part for face in solid.faces if face.kind != "RoofSurface"} == {-1}


def test_gap_takes_the_roof_of_the_piece_beside_it():
    outline = shapely.box(-1, -1, 11, 8)
    solid = compose(roof_zoo.roof([Piece(HOUSE, GABLE)], outline), 0.0)
    inside = np.array([[-0.5, 2.0], [10.5, 6.0], [5.0, -0.5]])
    assert measure_roof_height(solid, inside)[0] == pytest.approx(
        Piece(HOUSE, GABLE).height_at(inside), abs=1e-3
    )


def test_levels_meeting_crosswise_are_set_back():
    boxes = [shapely.box(x, y, x + 4, y + 4) for x in (0, 4) for y in (0, 4)]
    pieces = [level(z, box) for box, z in zip(boxes, (9, 5, 5, 8), strict=True)]
    solid = compose(roof_zoo.roof(pieces, shapely.box(0, 0, 8, 8)), 0.0)
    assert check_solid(solid) == ()
    assert solid.volume == pytest.approx(16 * (9 + 5 + 5 + 8), abs=0.01)


def test_hole_that_touches_the_outer_ring_is_cut_loose():
    outline = shapely.Polygon([(0, 0), (10, 0), (10, 10), (0, 10)], [[(0, 5), (3, 3), (3, 7)]])
    assert outline.is_valid
    _, solid = roof_zoo.flat_block(outline, 4.0, 0.0)
    assert check_solid(solid) == ()
    assert solid.volume == pytest.approx(4 * outline.area, abs=0.01)


def test_ground_gives_way_to_a_roof_below_it():
    roof, solid = roof_zoo.flat_block(HOUSE, 3.0, 5.0)
    assert check_solid(solid) == ()
    assert solid.vertices[:, 2].max() == 3.0 and solid.vertices[:, 2].min() == pytest.approx(2.9)
    assert [part.type for part in roof.parts] == ["flat"]


def test_terrain_intersection_follows_the_terrain_around_every_ring():
    outline = HOUSE.difference(shapely.box(3, 3, 5, 5))
    lines = terrain_intersection(outline, lambda xy: 0.1 * xy[:, 0])
    assert len(lines) == 2
    for line in lines:
        assert (line[0] == line[-1]).all()
        assert np.hypot(*np.diff(line[:, :2], axis=0).T).max() <= 1.0 + 1e-9
        assert line[:, 2] == pytest.approx(0.1 * line[:, 0])


def test_terrain_that_knows_nothing_leaves_the_floor():
    (line,) = terrain_intersection(HOUSE, lambda xy: np.full(len(xy), np.nan), -1.5)
    assert (line[:, 2] == -1.5).all()


GRID_M = 1e-4


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_outlines_that_cross_themselves_become_valid_ones_of_the_same_area(seed):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 9))
    ring = rng.uniform(2, 6, 9)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    # a spike out and back that is narrower than the grid
    spike = 0.5 * (ring[0] + ring[1]) + rng.normal(0, 2.0, 2)
    ring = np.insert(ring, 1, [ring[0], spike, ring[0] + rng.normal(0, 0.4 * GRID_M, 2)], axis=0)
    outline = shapely.Polygon(ring)
    polygons = settle_outlines([outline])
    assert all(polygon.is_valid and polygon.geom_type == "Polygon" for polygon in polygons)
    area = shapely.make_valid(outline, method="structure", keep_collapsed=False).area
    assert abs(sum(polygon.area for polygon in polygons) - area) < 40 * GRID_M
    assert [p.wkb for p in settle_outlines(polygons)] == [p.wkb for p in polygons]


def test_an_outline_without_an_area_goes_where_another_stays():
    line = shapely.Polygon([(0, 0), (1, 0), (1, 1e-9)])
    assert settle_outlines([line, shapely.box(0, 0, 1, 1)]) == [shapely.box(0, 0, 1, 1)]
    assert len(settle_outlines([line])) == 1


ROOFS = sorted((Path(__file__).parents[1] / "regressions").glob("*/roof.json"))


def read_roof(path):
    def read_piece(piece):
        return Piece(shapely.from_wkt(piece["outline"]), np.array(piece["planes"]))

    stored = json.loads(path.read_text())
    parts = tuple(Part("free", tuple(map(read_piece, pieces))) for pieces in stored["parts"])
    return Roof(parts, shapely.from_wkt(stored["outline"]), FRAME)


@pytest.mark.parametrize("path", ROOFS, ids=lambda path: path.parent.name)
def test_roof_becomes_a_valid_solid(path):
    assert check_solid(compose(read_roof(path), -2.0)) == ()


FLAT = np.array([[0.0, 0.0, 5.0]])


@pytest.mark.parametrize(
    ("roof", "sentence"),
    [
        (Roof((), HOUSE, FRAME), "at least one piece"),
        (
            Roof((Part("flat", (Piece(HOUSE, np.zeros((0, 3))),)),), HOUSE, FRAME),
            "at least one piece",
        ),
        (Roof((Part("flat", (Piece(HOUSE, FLAT),)),), shapely.Polygon(), FRAME), "outline"),
        (Roof((Part("flat", (Piece(HOUSE, FLAT * np.nan),)),), HOUSE, FRAME), "finite roof planes"),
        (
            Roof((Part("flat", (Piece(HOUSE, FLAT),)),), shapely.box(1e6, 0, 1e6 + 9, 9), FRAME),
            "local frame",
        ),
        (Roof((Part("flat", (Piece(HOUSE, FLAT),)),), shapely.box(0, 0, 10, 1e-5), FRAME), "area"),
    ],
)
def test_unusable_roof_raises_a_sentence(roof, sentence):
    with pytest.raises(CompositionError, match=sentence):
        compose(roof, 0.0)


@pytest.mark.parametrize("z_ground", [np.nan, np.inf, -np.inf])
def test_ground_must_be_finite(z_ground):
    with pytest.raises(CompositionError, match="finite ground height"):
        roof_zoo.flat_block(HOUSE, 5.0, z_ground)


def test_piece_far_from_the_outline_still_roofs_it():
    roof = roof_zoo.roof([Piece(shapely.box(50, 50, 60, 60), FLAT)], HOUSE)
    assert compose(roof, 0.0).volume == pytest.approx(400.0)


OUTLINES = {
    "the larger half of a bow tie": ([(0, 0), (10, 4), (10, 0), (0, 6)], 90.0, 5),
    "the larger side of a neck thinner than a millimetre": (
        [(0, 0), (5, 0), (5, 2), (8, 2), (8, 0), (10, 0), (10, 5), (8, 5), (8, 2.0005), (5, 2.0005)]
        + [(5, 5), (0, 5)],
        125.0,
        6,
    ),
    "a box of repeated and collinear vertices": (
        [(0, 0), (0, 0), (5, 0), (5.0002, 0), (10, 0), (10, 8), (10, 8.0004), (0, 8)],
        400.0,
        6,
    ),
    "a box without its spike": (
        [(0, 0), (10, 0), (10, 4), (15, 4.0003), (10, 4.0006), (10, 8), (0, 8)],
        400.0,
        6,
    ),
}


@pytest.mark.parametrize("name", OUTLINES)
def test_of_an_odd_outline_a_block_is_left(name):
    ring, volume, faces = OUTLINES[name]
    _, solid = roof_zoo.flat_block(shapely.Polygon(ring), 5.0, 0.0)
    assert check_solid(solid) == () and len(solid.faces) == faces
    assert solid.volume == pytest.approx(volume, abs=0.02)


def test_slivers_join_a_neighbour_by_the_settings():
    pieces = [
        Piece(shapely.box(0, 0, 5, 8), FLAT),
        Piece(shapely.box(5, 0, 5.05, 8), FLAT + [[0, 0, 1]]),
    ]
    pieces.append(Piece(shapely.box(5.05, 0, 10, 8), FLAT + [[0, 0, 2]]))
    roof = roof_zoo.roof(pieces, HOUSE)
    narrow, wide = (
        Settings.from_dict({"compose": {"min_face_width_m": width}}) for width in (0.01, 0.1)
    )
    assert len(compose(roof, 0.0, narrow).select_faces("RoofSurface")) == 3
    assert len(compose(roof, 0.0, wide).select_faces("RoofSurface")) == 2
    assert len(compose(roof, 0.0).select_faces("RoofSurface")) == 2


def test_coordinates_are_multiples_of_a_tenth_of_a_millimetre():
    solid = compose(roof_zoo.generate_roof("cross_gables", 1), -1.23456789)
    assert np.abs(solid.vertices * 1e4 - np.rint(solid.vertices * 1e4)).max() < 1e-6


REACH = 12.0


def test_two_vertices_as_far_apart_as_the_reach_come_to_rest():
    """Each lay beside the edge from the other to a third one, and was put into it in turn."""
    segments = [
        [299967, 700000, 299967, 700051],
        [408500, 799900, 299966, 799900],
        [299978, 799900, 299978, 700051],
    ]
    xy, edges = node(np.array(segments), REACH)
    pairs = {frozenset(map(tuple, xy[edge].tolist())) for edge in edges}
    assert frozenset([(299978, 799900), (299967, 700051)]) in pairs
    assert len(edges) == 4


def make_checkerboard(squares):
    """A roof of squares of 2 m, low and high in turn."""
    parts = []
    for i in range(squares):
        for j in range(squares):
            box = shapely.box(2.0 * i, 2.0 * j, 2.0 * i + 2.0, 2.0 * j + 2.0)
            plane = np.array([[0.0, 0.0, 4.0 + 3.0 * ((i + j) % 2)]])
            parts.append(Part("flat", (Piece(box, plane),)))
    outline = shapely.box(0.0, 0.0, 2.0 * squares, 2.0 * squares)
    return Roof(tuple(parts), outline, LocalFrame(np.zeros(3)))


def test_any_number_of_crosswise_corners_is_mended():
    solid = compose(make_checkerboard(9), 0.0)
    assert not check_solid(solid)
    assert math.isclose(solid.volume, 4.0 * (41 * 4.0 + 40 * 7.0), rel_tol=1e-3)
