"""Laws of solids that do not stand on one level: walls down to the terrain, passages below."""

import numpy as np
import pytest
import shapely

from hiproof.compose import check_solid, compose, terrain_intersection
from hiproof.compose.underside import FOOT_TOLERANCE_M, make_underside
from hiproof.errors import CompositionError
from hiproof.frames import LocalFrame
from hiproof.model import CEILING, GROUND, ROOF, WALL, Part, Passage, Piece, Roof, Solid, Underside
from hiproof.settings import ComposeSettings, Settings
from roof_zoo import KINDS, generate_roof

Z_GROUND = -6.0
EXACT = Settings.from_dict({"compose": {"min_face_width_m": 0.01}})
OPTIONS = ComposeSettings()
SEEDS = range(4)
WORLD = np.array([85012.345, 446078.912, 3.217])


@pytest.fixture(scope="module")
def solids():
    roofs = {(kind, seed): generate_roof(kind, seed) for kind in KINDS for seed in SEEDS}
    return {key: (roof, compose(roof, Z_GROUND, EXACT)) for key, roof in roofs.items()}


def find_lowest_roof(solid):
    return min(
        solid.vertices[list(ring), 2].min()
        for face in solid.select_faces(ROOF)
        for ring in face.rings
    )


def list_roofs(solid):
    return sorted(
        (face.part, sorted(map(tuple, solid.vertices[list(face.rings[0])].tolist())))
        for face in solid.select_faces(ROOF)
    )


def box_house(width=10.0, depth=8.0, height=6.0):
    outline = shapely.box(0, 0, width, depth)
    level = Piece(outline, np.array([[0.0, 0.0, height]]))
    roof = Roof((Part("flat", (level,)),), outline, LocalFrame(np.zeros(3)))
    return roof, compose(roof, 0.0)


@pytest.mark.parametrize("kind", KINDS)
def test_walls_reach_down_to_sloping_terrain_and_the_roof_stays(solids, kind):
    for seed in SEEDS:
        roof, solid = solids[kind, seed]
        slope = np.random.default_rng(seed).normal(0, 0.05, 2)
        rise = find_lowest_roof(solid) - 0.5 - (shapely.get_coordinates(roof.outline) @ slope).max()
        flat = terrain_intersection(roof.outline, lambda xy: np.zeros(len(xy)))
        lines = tuple(line + np.outer(line[:, :2] @ slope + rise, [0, 0, 1]) for line in flat)
        result = make_underside(solid, Underside(lines), OPTIONS)
        assert check_solid(result.move(WORLD)) == ()
        assert list_roofs(result) == list_roofs(solid)
        area = shapely.union_all([solid.project_face(f) for f in solid.select_faces(GROUND)])
        middle = shapely.get_coordinates(shapely.centroid(area))[0] @ slope + rise
        base = solid.vertices[:, 2].min()
        expected = solid.volume - area.area * (middle - base)
        assert result.volume == pytest.approx(expected, abs=1e-3 * area.area)


@pytest.mark.parametrize("kind", KINDS)
def test_passages_take_their_room_from_the_solid(solids, kind):
    for seed in SEEDS:
        roof, solid = solids[kind, seed]
        x0, y0, x1, y1 = roof.outline.bounds
        ceiling = round(find_lowest_roof(solid) - 0.6, 2)
        base = solid.vertices[:, 2].min()
        if ceiling < base + 0.5:
            continue
        across = Passage(shapely.box((x0 + x1) / 2 - 1, y0 - 1, (x0 + x1) / 2 + 1, y1 + 1), ceiling)
        niche = Passage(shapely.box(x0 - 1, y0 - 1, x0 + 1.5, (y0 + y1) / 2), ceiling - 0.05)
        result = make_underside(solid, Underside(passages=(across, niche)), OPTIONS)
        assert check_solid(result.move(WORLD)) == ()
        assert list_roofs(result) == list_roofs(solid)
        area = shapely.union_all([solid.project_face(f) for f in solid.select_faces(GROUND)])
        first = shapely.intersection(area, across.outline)
        second = shapely.intersection(area.difference(first), niche.outline)
        room = first.area * (ceiling - base) + second.area * (ceiling - 0.05 - base)
        # a sliver beside a passage belongs to it
        assert result.volume == pytest.approx(solid.volume - room, rel=0.005)


def test_a_passage_through_a_box_has_the_faces_that_a_person_would_draw():
    _, solid = box_house()
    passage = Passage(shapely.box(4, -1, 6, 9), 3.0)
    result = make_underside(solid, Underside(passages=(passage,)), OPTIONS)
    count = {kind: len(result.select_faces(kind)) for kind in (ROOF, WALL, GROUND, CEILING)}
    assert count == {ROOF: 1, WALL: 6, GROUND: 2, CEILING: 1}
    (ceiling,) = result.select_faces(CEILING)
    assert result.project_face(ceiling).equals(shapely.box(4, 0, 6, 8))
    assert result.vertices[list(ceiling.rings[0]), 2].tolist() == [3.0] * 4
    assert result.volume == pytest.approx(10 * 8 * 6 - 2 * 8 * 3)


def test_a_passage_drawn_nearly_along_a_wall_ends_at_it():
    _, solid = box_house()
    passage = Passage(shapely.box(0.04, 0.03, 3, 8.02), 3.0)
    result = make_underside(solid, Underside(passages=(passage,)), OPTIONS)
    assert result.volume == pytest.approx(10 * 8 * 6 - 3 * 8 * 3)


def test_a_pillar_stands_in_an_open_ground_floor():
    _, solid = box_house()
    open_floor = shapely.box(-1, -1, 11, 9).difference(shapely.box(4, 3, 6, 5))
    result = make_underside(solid, Underside(passages=(Passage(open_floor, 3.0),)), OPTIONS)
    assert check_solid(result) == ()
    assert result.volume == pytest.approx(10 * 8 * 3 + 2 * 2 * 3)


@pytest.mark.parametrize(
    ("ceiling", "reason"),
    [(0.3, "at least 0.5 m high, got one of 0.30 m"), (5.8, "below the roof, got one 0.20 m")],
)
def test_a_passage_that_is_none_is_refused(ceiling, reason):
    _, solid = box_house()
    with pytest.raises(CompositionError, match=reason):
        passage = Passage(shapely.box(4, -1, 6, 9), ceiling)
        make_underside(solid, Underside(passages=(passage,)), OPTIONS)


def test_the_foot_of_walls_follows_terrain_that_bends():
    roof, solid = box_house()

    def height_at(xy):
        return 0.8 * np.sin(xy[:, 0]) + 0.3 * xy[:, 1]

    lines = terrain_intersection(roof.outline, height_at, spacing_m=0.25)
    result = make_underside(solid, Underside(lines), OPTIONS)
    assert check_solid(result) == ()
    foot = shapely.union_all(
        [
            shapely.Polygon(result.vertices[list(face.rings[0])][:, [0, 2]])
            for face in result.select_faces(WALL)
            if (result.vertices[list(face.rings[0]), 1] == 0).all()
        ]
    )
    for x in np.linspace(0.05, 9.95, 67):
        wall = foot.intersection(shapely.LineString([(x, -9), (x, 9)]))
        assert wall.bounds[1] == pytest.approx(0.8 * np.sin(x), abs=FOOT_TOLERANCE_M + 0.1)
    assert len(result.select_faces(GROUND)) > 10


def test_the_ground_gives_way_where_terrain_rises_above_a_roof():
    roof, solid = box_house(height=3.0)
    lines = terrain_intersection(roof.outline, lambda xy: 0.5 * xy[:, 0])
    result = make_underside(solid, Underside(lines), OPTIONS)
    assert isinstance(result, Solid) and check_solid(result) == ()
    assert list_roofs(result) == list_roofs(solid)
