"""Check that curved roofs become cones, spires, domes and barrels, and that others do not."""

import numpy as np
import pytest
import shapely
from benchmarks.curved import draw_scene, judge_scene

from hiproof.compose import check_solid, compose
from hiproof.fit.union import fit_building
from hiproof.frames import LocalFrame
from hiproof.model import Roof
from hiproof.primitives import CATALOGUE
from hiproof.primitives.catalogue import CURVED
from hiproof.settings import Settings
from points_of_roofs import sample_roof, typical_theta

PLANAR = [name for name in CATALOGUE if name not in CURVED]


@pytest.mark.parametrize(
    ("kind", "setting"),
    [
        *((kind, "alone") for kind in CURVED),
        ("cone", "tower"),
        ("broach", "tower"),
        ("dome", "tower"),
        ("cone", "turret"),
    ],
)
def test_a_curved_roof_is_found(kind, setting):
    outcome = judge_scene(draw_scene(kind, setting, 20, 8.0))
    assert outcome.is_right
    assert outcome.height_error_m == pytest.approx(0.0, abs=0.2)
    assert outcome.volume_error == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("kind", PLANAR)
def test_planes_stay_planes(kind):
    theta = typical_theta(kind, height=3.0, teeth=3 if kind == "shed" else None)
    points = sample_roof(kind, theta, density=6.0, teeth=3)
    shape = CATALOGUE[kind].variant({"teeth": 3}) if kind == "shed" else CATALOGUE[kind]
    outline = shapely.union_all([piece.outline for piece in shape.part(theta).pieces])
    parts = fit_building(points, shapely.convex_hull(outline)).roof_parts
    assert not {part.type for part in parts} & set(CURVED)


def test_a_type_that_is_not_allowed_is_not_found():
    scene = draw_scene("dome", "alone", 20, 8.0)
    settings = Settings.from_dict({"fit": {"types": ["flat", "pyramid", "mansard"]}})
    parts = fit_building(scene.points, scene.outline, settings).roof_parts
    assert {part.type for part in parts} <= {"flat", "pyramid", "mansard"}


@pytest.mark.parametrize("kind", CURVED)
@pytest.mark.parametrize("width", [1.6, 7.0, 30.0])
def test_curved_shapes_of_every_size_are_valid_solids(kind, width):
    theta_p = CATALOGUE[kind].typical(width, 1.2 * width, 0.4 * width)
    shape = CATALOGUE[kind].variant(theta_p)
    part = shape.part(shape.to_theta(theta_p, 0.3, (1.0, 2.0, 6.0)))
    roof = Roof((part,), part.pieces[0].outline, LocalFrame(np.zeros(3)))
    solid = compose(roof, 0.0)
    assert not check_solid(solid)
    plan_area = part.pieces[0].outline.area
    assert solid.volume > 6.0 * plan_area
    # The smallest facets of a small dome are one face.
    assert solid.vertices[:, 2].max() == pytest.approx(6.0 + theta_p["height"], abs=0.05)
