"""Laws of winged buildings: crossing gables stay two gables, whichever way they lie, and only where the points say so."""

import numpy as np
import pytest
import shapely
import shapely.affinity

from hiproof.fit.compound import fit_building
from hiproof.fit.compound.plan import lay_out_plan
from hiproof.fit.compound.wings import wing_boxes
from hiproof.model import Roof
from hiproof.simulate import ScanSettings, random_compound, scan
from hiproof.simulate.scene import Defects


def scanned(kind, seed, density=6.0):
    rng = np.random.default_rng([seed, len(kind)])
    building = random_compound(rng, kind)
    cloud = scan(building, rng, ScanSettings(density=density, defects=Defects.none()))
    return building, building.roof.frame.to_local(cloud.points[cloud.source != 2])


@pytest.mark.parametrize("kind", ["L", "T", "cross"])
def test_most_winged_buildings_are_told_as_the_two_primitives_they_are(kind):
    right = near = 0
    for seed in range(6):
        building, points = scanned(kind, seed)
        fit = fit_building(points, building.outline)
        right += len(fit.roof_parts) == len(building.roof.parts)
        inside = shapely.contains_xy(building.outline.buffer(-0.3), *points[:, :2].T)
        gap = Roof(fit.roof_parts, fit.outline, building.roof.frame).height_at(points[inside, :2])
        gap -= building.roof.height_at(points[inside, :2])
        near += np.nanmean(np.abs(gap) < 0.1) > 0.95
    assert right >= 4
    assert near >= 5


def test_three_hips_around_a_court_are_three_hips():
    """The middle wing's own points show a gable: its hipped ends lie under the other wings."""
    boxes = [(-12.0, -8.0, -5.0, 6.0), (-12.0, -3.5, 12.0, 6.0), (5.0, -8.0, 12.0, 6.0)]

    def hip(box, x, y):
        inside = [x - box[0], box[2] - x, y - box[1], box[3] - y]
        return np.where(np.min(inside, axis=0) >= 0.0, 5.0 + 0.5 * np.min(inside, axis=0), -np.inf)

    outline = shapely.union_all([shapely.box(*box) for box in boxes])
    rng = np.random.default_rng(0)
    xy = rng.uniform((-12.0, -8.0), (12.0, 6.0), (2400, 2))
    xy = xy[shapely.contains_xy(outline, *xy.T)]
    z = np.max([hip(box, *xy.T) for box in boxes], axis=0) + rng.normal(0.0, 0.03, len(xy))
    fit = fit_building(np.column_stack([xy, z]), outline)
    assert [part.type for part in fit.roof_parts] == ["hip", "hip", "hip"]
    assert fit.unexplained == 0.0


def test_the_answer_turns_with_the_building():
    building, points = scanned("cross", 1)
    c, s = np.cos(0.7), np.sin(0.7)
    turned = np.column_stack([points[:, :2] @ np.array([[c, s], [-s, c]]), points[:, 2]])
    here = fit_building(points, building.outline)
    there = fit_building(turned, shapely.affinity.rotate(building.outline, 0.7, origin=(0, 0), use_radians=True))
    assert sorted(p.type for p in here.roof_parts) == sorted(p.type for p in there.roof_parts)
    assert here.objective == pytest.approx(there.objective, rel=0.2)


@pytest.mark.parametrize(
    ("outline", "count"),
    [
        (shapely.box(0, 0, 10, 6), 0),
        (shapely.box(0, 0, 20, 6) | shapely.box(0, 0, 6, 15), 2),
        (shapely.box(0, 5, 20, 11) | shapely.box(7, 0, 13, 20), 2),
        (shapely.box(0, 0, 20, 6) | shapely.box(0, 0, 6, 15) | shapely.box(14, 0, 20, 15), 3),
        (shapely.Polygon([(0, 0), (10, 0), (14, 6), (9, 9), (5, 12), (0, 8)]), 0),
        (shapely.box(0, 0, 20, 20) - shapely.box(5, 5, 15, 15), 0),
    ],
    ids=["box", "L", "cross", "U", "oblique", "courtyard"],
)
def test_the_largest_boxes_of_a_plan(outline, count):
    rng = np.random.default_rng(0)
    xy = rng.uniform(*np.array(outline.bounds).reshape(2, 2), (400, 2))
    xy = xy[shapely.contains_xy(outline, *xy.T)]
    plan = lay_out_plan(np.column_stack([xy, np.zeros(len(xy))]), outline)
    assert len(wing_boxes(outline, plan)) == count
