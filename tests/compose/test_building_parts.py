"""Building parts: cut along walls alone, valid each by itself, side by side without overlap,
together the whole.
"""

from itertools import combinations

import numpy as np
import pytest
import shapely

from hiproof.compose import check_solid, compose
from hiproof.compose.blocks import block, blocks
from hiproof.compose.building_parts import LEAST_PART_M2, building_parts, join_parts
from hiproof.model import GROUND, ROOF, Face, Part, Piece, Roof, Solid
from hiproof.simulate import COMPOUND_KINDS, random_compound
from roof_zoo import FRAME, rectangle

KINDS = [(kind, seed) for kind in COMPOUND_KINDS for seed in (1, 2)]


def level(x0, y0, x1, y1, z):
    return Part("flat", (Piece(shapely.box(x0, y0, x1, y1), np.array([[0.0, 0.0, z]])),))


def gable(x0, y0, x1, y1, eave, slope=0.8):
    """A ridge along x, in the middle."""
    middle = 0.5 * (y0 + y1)
    ridge = eave + slope * (middle - y0)
    planes = np.array([[0.0, s * slope, ridge - s * slope * middle] for s in (1.0, -1.0)])
    return Part("gable", (Piece(shapely.box(x0, y0, x1, y1), planes),))


def roof(*parts):
    outlines = [piece.outline for part in parts for piece in part.pieces]
    return Roof(parts, shapely.union_all(outlines), FRAME)


def list_parts(*parts):
    return building_parts(compose(roof(*parts), 0.0))


def join_shells(solids):
    """Solids as the shells of one, over common vertices, as a file holds them."""
    numbers, faces = {}, []
    for solid in solids:
        places = map(tuple, np.round(solid.vertices, 4).tolist())
        number = [numbers.setdefault(xyz, len(numbers)) for xyz in places]
        for face in solid.faces:
            rings = tuple(tuple(number[v] for v in ring) for ring in face.rings)
            faces.append(Face(rings, face.kind, face.part))
    return Solid(np.array(list(numbers)), tuple(faces))


@pytest.mark.parametrize(("kind", "seed"), KINDS)
def test_parts_are_valid_do_not_overlap_and_make_up_the_whole(kind, seed):
    solid = compose(random_compound(np.random.default_rng(seed), kind).roof, 0.0)
    parts = building_parts(solid)
    for part in parts:
        assert check_solid(part.solid) == ()
        assert part.outline.is_valid and part.outline.area >= LEAST_PART_M2
    for first, other in combinations(parts, 2):
        # walls are upright: no overlap in plan, none in space (601)
        assert first.outline.intersection(other.outline).area < 1e-6
    if parts:
        # walls of the whole run straight past corners within half a millimetre of their line
        assert sum(part.solid.volume for part in parts) == pytest.approx(solid.volume, rel=1e-4)
        faces = [face for part in parts for face in part.solid.select_faces(ROOF)]
        assert len(faces) == len(solid.select_faces(ROOF))
        whole = join_parts(join_shells([part.solid for part in parts]))
        assert check_solid(whole) == () and whole.volume == pytest.approx(solid.volume, rel=1e-4)


def test_roofs_that_meet_at_a_wall_are_parts_and_those_that_share_an_edge_are_one():
    terrace = list_parts(gable(0, 0, 6, 8, 6.0), gable(6, 0, 12, 8, 4.0))
    assert [part.members for part in terrace] == [(0,), (1,)]
    planes = np.array([[0.8, 0.0, 3.2], [-0.8, 0.0, 12.8]])
    crossing = Part("gable", (Piece(rectangle(6, 4, 5, 14), planes),))
    assert list_parts(gable(0, 0, 12, 8, 6.0), crossing) == ()


def test_a_tower_out_of_a_roof_is_a_part_and_the_rest_goes_around_it():
    surrounding_part, tower = list_parts(level(0, 0, 12, 10, 5.0), level(4, 3, 8, 7, 9.0))
    assert len(surrounding_part.outline.interiors) == 1
    assert len(surrounding_part.solid.select_faces(GROUND)[0].rings) == 2
    assert tower.outline.equals(shapely.box(4, 3, 8, 7))
    assert tower.solid.volume == pytest.approx(16 * 9.0)


def test_what_is_smaller_than_a_part_stays_with_its_neighbour():
    sides = level(0, 0, 12, 10, 5.0), level(20, 0, 26, 6, 4.0)
    assert list_parts(*sides, level(4, 3, 5, 4, 7.0)) == ()
    sides = level(0, 0, 8, 10, 5.0), level(8, 0, 14, 10, 3.0)
    box_on_one = list_parts(*sides, level(2, 3, 3, 4, 7.0))
    assert [sorted(part.members) for part in box_on_one] == [[0, 2], [1]]
    assert all(check_solid(part.solid) == () for part in box_on_one)


def test_parts_move_with_the_building():
    solid = compose(roof(gable(0, 0, 6, 8, 6.0), level(6, 0, 10, 8, 3.0)), 0.0)
    shift = np.array([85000.0, 446000.0, 2.0])
    moved = building_parts(solid.move(shift))
    for part, moved_part in zip(building_parts(solid), moved, strict=True):
        assert np.allclose(part.solid.vertices + shift, moved_part.solid.vertices)
        assert part.solid.faces == moved_part.solid.faces


@pytest.mark.parametrize(("kind", "seed"), KINDS[::2])
def test_blocks_are_valid_and_as_large_as_their_outlines_and_heights(kind, seed):
    solid = compose(random_compound(np.random.default_rng(seed), kind).roof, 0.0)
    outlines = [part.outline for part in building_parts(solid)]
    heights, expected = [4.0 + 0.5 * k for k in range(len(outlines))], 0.0
    for outline, height in zip(outlines, heights, strict=True):
        single = block(outline, 0.0, height)
        assert check_solid(single) == ()
        assert single.volume == pytest.approx(outline.area * height)
        expected += outline.area * height
    if len(outlines) > 1:
        stepped = blocks(outlines, heights, 0.0)
        assert check_solid(stepped) == () and stepped.volume == pytest.approx(expected, rel=1e-3)


def test_blocks_that_do_not_touch_are_no_solid():
    assert blocks([shapely.box(0, 0, 1, 1), shapely.box(3, 0, 4, 1)], [2.0, 3.0], 0.0) is None
