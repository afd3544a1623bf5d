"""Check planes over walls that cut corners off.

Bays with slanted sides and eight-sided towers have such planes, unless the roof continues over such
a wall.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from shapely import affinity

import hiproof
from hiproof.compose import check_solid
from hiproof.fit.roof import fit_building
from hiproof.parametric.arrange import merge_parts, split_part
from hiproof.primitives.catalogue import CATALOGUE, CURVED
from points_of_roofs import sample_heights

EAVE = 3.0
OCTAGON = shapely.Polygon(
    [(5 * math.cos(a), 5 * math.sin(a)) for a in np.arange(8) * math.pi / 4 + math.pi / 8]
)
CANTED_END = shapely.Polygon([(0, 0), (12, 0), (14.5, 2.5), (14.5, 5.5), (12, 8), (0, 8)])

WITHOUT_SPIRES = hiproof.Settings.from_dict(
    {"fit": {"types": [name for name in CATALOGUE if name not in CURVED]}}
)


def make_height(outline, slope, gable=()):
    """Return the height of a roof that rises from the walls of a convex outline.

    Those with numbers in `gable` are left out.
    """
    ring = shapely.get_coordinates(shapely.orient_polygons(outline))
    walls = [(a, b - a) for k, (a, b) in enumerate(pairwise(ring)) if k not in gable]

    def height(x, y):
        offsets = [
            (way[0] * (y - positions[1]) - way[1] * (x - positions[0])) / np.hypot(*way)
            for positions, way in walls
        ]
        return EAVE + slope * np.min(offsets, axis=0)

    return height


def make_house(name):
    """Return the outline and height of one of the houses."""
    if name == "tower":
        return OCTAGON, make_height(OCTAGON, 1.0)
    return CANTED_END, make_height(CANTED_END, 0.7, gable=[5])


def list_cants(part):
    return sorted(
        value for name, value in part.parameters.items() if name.startswith("facing_cant")
    )


def compute_misfit(parts, outline, height):
    xy = np.random.default_rng(7).uniform(outline.bounds[:2], outline.bounds[2:], (4000, 2))
    xy = xy[shapely.contains_xy(outline, xy[:, 0], xy[:, 1])]
    roof = np.max([part.height_at(xy) for part in parts], axis=0)
    return float(np.sqrt(np.mean((roof - height(*xy.T)) ** 2)))


@pytest.mark.parametrize(
    ("name", "kind", "count"), [("tower", "pyramid", 4), ("bay", "side_hip", 2)]
)
def test_a_roof_that_rises_from_every_wall_is_one_part(name, kind, count):
    outline, height = make_house(name)
    found = 0
    for seed in range(12):
        points = sample_heights(height, outline, 8.0, 0.02, seed)
        parts = fit_building(points, outline, WITHOUT_SPIRES).roof_parts
        found += [(part.type, len(list_cants(part))) for part in parts] == [(kind, count)]
        if len(parts) == 1:
            assert compute_misfit(parts, outline, height) < 0.03
            assert all(
                0.0 < parts[0].sigma[f"pitch_cant{k + 1}"] < 3.0
                for k in range(len(list_cants(parts[0])))
            )
    assert found >= 9


def test_a_regular_tower_has_a_spire():
    height = make_height(OCTAGON, 1.0)
    (part,) = fit_building(sample_heights(height, OCTAGON, 8.0, 0.02), OCTAGON).roof_parts
    assert part.type == "broach"
    assert part.parameters["height"] == pytest.approx(5.0 * math.cos(math.pi / 8), abs=0.05)
    assert compute_misfit([part], OCTAGON, height) < 0.03


@pytest.mark.parametrize("degrees", [33.0, 117.0, 250.0])
def test_cants_turn_with_the_points(degrees):
    outline, height = make_house("bay")
    points = sample_heights(height, outline, 8.0, 0.02, 1)
    turned = affinity.rotate(outline, degrees, (0, 0))
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    moved = np.column_stack([points[:, :2] @ np.array([[c, s], [-s, c]]), points[:, 2]])
    (first,), (other,) = (
        fit_building(points, outline).roof_parts,
        fit_building(moved, turned).roof_parts,
    )
    xy = points[:, :2] @ np.array([[c, s], [-s, c]])
    assert other.pieces[0].height_at(xy) == pytest.approx(
        first.pieces[0].height_at(points[:, :2]), abs=0.02
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_bay_runs_into_the_roof_behind_it(seed):
    """A hipped bay with slanted sides on a gabled house makes two parts.

    The bay's planes lie over three of its walls and a part of the house.
    """
    bay = shapely.Polygon([(4.5, 3), (9.5, 3), (9.5, 10), (8.5, 11.5), (5.5, 11.5), (4.5, 10)])
    outline, over_bay = shapely.union(shapely.box(0, 0, 14, 9), bay), make_height(bay, 0.8)

    def height(x, y):
        main = np.where(y <= 9, EAVE + 0.8 * np.minimum(y, 9 - y), -np.inf)
        return np.where(shapely.intersects_xy(bay, x, y), np.maximum(main, over_bay(x, y)), main)

    parts = fit_building(sample_heights(height, outline, 10.0, 0.02, seed), outline).roof_parts
    assert sorted(len(list_cants(part)) for part in parts) == [0, 2]
    assert compute_misfit(parts, outline, height) < 0.03


def test_a_gable_over_a_cut_corner_has_no_cant():
    outline = shapely.Polygon([(0, 0), (10, 0), (12, 2), (12, 8), (0, 8)])
    points = sample_heights(lambda x, y: 8.0 - 0.8 * np.abs(y - 4.0), outline, 8.0, 0.02)
    (part,) = fit_building(points, outline).roof_parts
    assert part.type == "gable" and not list_cants(part)


def test_a_canted_roof_is_built_again_of_its_parameters():
    outline, height = make_house("bay")
    building = hiproof.reconstruct(sample_heights(height, outline, 8.0, 0.02), outline)
    record = hiproof.write.parameters.building_record(building)
    second = hiproof.build(record)
    assert list_cants(building.parts[0]) and not check_solid(building.solid)
    assert np.array_equal(second.solid.vertices, building.solid.vertices)
    higher = building.with_part(0, ridge_height=float(building.solid.vertices[:, 2].max()) + 1.0)
    assert list_cants(higher.parts[0]) == list_cants(building.parts[0]) and not check_solid(
        higher.solid
    )
    refitted = higher.refit(sample_heights(height, outline, 8.0, 0.02, 3))
    assert (
        compute_misfit(
            refitted.roof.parts,
            shapely.transform(outline, refitted.roof.frame.to_local),
            lambda x, y: compute_local_height(refitted, height, x, y),
        )
        < 0.04
    )


@pytest.mark.parametrize("side", ["length", "width"])
def test_a_part_cut_in_two_and_merged_again_has_its_cants_over_the_same_walls(side):
    outline, height = make_house("bay")
    building = hiproof.reconstruct(sample_heights(height, outline, 8.0, 0.02), outline)
    record = hiproof.write.parameters.building_record(building)
    halves = split_part(record["parts"][0], side, 0.6)
    merged = hiproof.build({**record, "parts": [merge_parts(*halves)]})
    xy = shapely.get_coordinates(building.roof.outline.buffer(-0.5))
    assert len(list_cants(merged.parts[0])) == 2
    assert merged.roof.height_at(xy) == pytest.approx(building.roof.height_at(xy), abs=1e-6)


def compute_local_height(building, height, x, y):
    """`height` seen from the frame of a building's roof."""
    origin = building.roof.frame.origin
    return height(x + origin[0], y + origin[1]) - origin[2]
