"""Check that faces of a drawn roof go to the volumes beside them where that is cheaper."""

import numpy as np
import pytest
import shapely

from hiproof.fit import union
from hiproof.fit.union import fit_building
from hiproof.fit.union.allowed import list_allowed_shapes
from hiproof.fit.union.drawn_plan import DrawnPlan
from hiproof.fit.union.faces import assign_face, draw_out_sides, list_faces
from hiproof.fit.union.plan import lay_out_plan
from hiproof.fit.union.regions import PlanSite, transform_places
from hiproof.fit.union.scene import make_scene
from hiproof.fit.union.sides import Side
from hiproof.fit.union.volumes import LEVEL, N_PLANES, N_SIDES, OFFSET0, SLOPE0, U0, V0, make_base
from points_of_roofs import sample_heights

OUTLINE = shapely.box(0, 0, 20, 10)


def draw_two_levels(step):
    """Return a plan of OUTLINE, its right half higher by `step`, and a site."""
    points = sample_heights(lambda x, y: np.full(np.shape(x), 5.0), OUTLINE, 4.0, 0.02)
    plan = lay_out_plan(points, OUTLINE)
    scene = make_scene(plan, OUTLINE, [0.0], 3.0, 0.2, list_allowed_shapes(()))
    places = np.array([[0, 0], [12, 0], [20, 0], [20, 10], [12, 10], [0, 10]], float)
    edges = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [5, 0], [1, 4]])
    beside = np.array([[0, -1], [1, -1], [1, -1], [1, -1], [0, -1], [0, -1], [0, 1]])
    levels = np.array([[0.0, 0.0, 5.0], [0.0, 0.0, 5.0 + step]])
    owner = np.array([[1, LEVEL], [2, LEVEL]])
    drawn = DrawnPlan(places, edges, beside, levels, owner, corners=8)
    return drawn, PlanSite(OUTLINE, plan, scene, {})


def test_a_face_may_go_across_a_low_step_but_not_across_a_wall():
    faces = list(list_faces(draw_two_levels(0.1)[0]))
    assert [(face.owner, face.takers, face.polygon.area) for face in faces] == [
        (2, {1}, 80.0),
        (1, {2}, 120.0),
    ]
    assert not list(list_faces(draw_two_levels(1.0)[0]))


@pytest.mark.parametrize("number", [0, 1])
def test_who_takes_a_face_covers_it_and_who_had_it_does_not(number):
    drawn, site = draw_two_levels(0.1)
    face = list(list_faces(drawn))[number]
    regions = [[], [shapely.box(0, 0, 12, 10)], [shapely.box(12, 0, 20, 10)]]
    assigned = assign_face(face, face.takers, regions, site)
    (taker,) = face.takers
    assert assigned[face.owner] == []
    assert assigned[taker][0].area == pytest.approx(OUTLINE.area, abs=1e-6)
    assert not assign_face(face, [0], regions, site)


def test_sides_are_drawn_out_to_what_the_volume_covers():
    _, site = draw_two_levels(0.1)
    volume, box = make_base(5.0)[0], shapely.box(3, 2, 9, 8)
    x, y = transform_places(shapely.get_coordinates(box), volume, site).T
    true_offsets = [x.min(), x.max(), y.min(), y.max()]
    inwards = np.array([1.0, -1.0, 1.0, -1.0])
    short = [Side(true_offsets[k] + 0.8 * inwards[k]) for k in range(N_SIDES)]
    wide = [Side(true_offsets[k] - 0.8 * inwards[k]) for k in range(N_SIDES)]
    drawn_out = draw_out_sides(volume, short, [box], site)
    assert [side.offset for side in drawn_out] == pytest.approx(true_offsets)
    assert draw_out_sides(volume, wide, [box], site) == wide


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_level_strips_along_the_eaves_of_a_gable_go(monkeypatch, seed):
    """One level volume under a gable that ends 1.4 m before both eaves leaves no strip."""
    rng = np.random.default_rng(seed)
    x, y = rng.random((2, 5 * 14 * 11)) * [[14.0], [11.0]]
    z = 5.0 - 0.2 * np.abs(y - 5.5) + rng.normal(0.0, 0.02, len(x))
    points, outline = np.column_stack([x, y, z]), shapely.box(0, 0, 14, 11)
    widths = []

    def cut_gable_short(volumes, *_):
        (gable,) = volumes[1:]
        level = gable.copy()
        across = V0 if gable[OFFSET0 + 2] < np.inf else U0
        gable[[across, across + 1]] += [1.4, -1.4]
        widths.append(gable[across + 1] - gable[across])
        level[OFFSET0 : OFFSET0 + N_PLANES], level[SLOPE0 : SLOPE0 + N_SIDES] = np.inf, 0.0
        plane = across - U0
        level[OFFSET0 + LEVEL] = gable[OFFSET0 + plane] + gable[SLOPE0 + plane] * gable[across]
        return np.array([volumes[0], level, gable])

    monkeypatch.setattr(union, "add_bays", cut_gable_short)
    (part,) = fit_building(points, outline).roof_parts
    assert widths == pytest.approx([8.2], abs=0.3)
    assert part.type == "gable"
    assert part.parameters["width"] == pytest.approx(11.0, abs=0.05)
    assert part.area == pytest.approx(outline.area, abs=0.01)
