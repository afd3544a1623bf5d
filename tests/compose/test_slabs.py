"""Roofs that reach beyond their walls: valid solids of slabs, whatever the roof."""

import numpy as np
import pytest
import shapely

import hiproof
from hiproof.compose import check_solid, compose
from hiproof.compose.eaves import add_eaves, add_valid_eaves, measure_left_out
from hiproof.compose.settle import settled_roof
from hiproof.errors import CompositionError
from hiproof.geometry.outline_edges import list_outline_edges
from hiproof.model import CEILING, GROUND, Eaves, Model, Overhang
from hiproof.simulate.compounds import COMPOUND_KINDS, random_compound

THICKNESS_M = 0.2


def make_part(kind, box, z, **size):
    """The record of a part over a box (x0, y0, x1, y1)."""
    x0, y0, x1, y1 = box
    ring = shapely.get_coordinates(shapely.box(*box))[:-1].tolist()
    size = {"width": y1 - y0, "length": x1 - x0, **size}
    place = [(x0 + x1) / 2, (y0 + y1) / 2, z]
    return {"type": kind, "parameters": size, "position": place, "outlines": [[ring]]}


def build_model(ring, parts):
    record = {"id": "a", "origin": [0, 0, 0], "outline": [ring], "z_ground": 0}
    return hiproof.build(record | {"parts": parts}).model


def make_eaves(lengths, thickness=THICKNESS_M, kind="walls"):
    overhangs = tuple(Overhang(k, float(length)) for k, length in enumerate(lengths) if length)
    return Eaves(overhangs, thickness, kind)


def build_pair(rise, z=5.0, step=0.0):
    """Two gables side by side, the right one by `step` higher and of another rise."""
    left = make_part("gable", (-6, -4, 0, 4), z, height=3)
    right = make_part("gable", (0, -4, 6, 4), z + step, height=rise)
    return build_model([[-6, -4], [6, -4], [6, 4], [-6, 4]], [left, right])


@pytest.mark.parametrize(("rise", "step"), [(3.0, 0.1), (3.0, 0.2), (3.0, 2.0), (2.2, 0.3)])
def test_slabs_at_a_step_keep_their_thickness(rise, step):
    model = build_pair(rise, step=step)
    solid = add_eaves(model, make_eaves([0.5, 0.3, 0.5, 0.3])).eaves.solid
    assert check_solid(solid) == ()
    beyond = 12.6 * 9.0 - 12 * 8
    # steps as high as a slab is thick make it a little thinner: it would touch along a line
    assert solid.volume - model.solid.volume == pytest.approx(THICKNESS_M * beyond, rel=0.051)
    assert sum(solid.project_face(f).area for f in solid.select_faces(CEILING)) == pytest.approx(
        beyond, abs=0.01
    )


@pytest.mark.parametrize("kind", ["walls", "roof"])
def test_corners_stand_only_where_three_faces_meet(kind):
    eaves = make_eaves([0.5, 0.3, 0.5, 0.3], kind=kind)
    solid = add_eaves(build_pair(2.2, step=0.3), eaves).eaves.solid
    faces_of = [
        vertex for face in solid.faces for vertex in {v for ring in face.rings for v in ring}
    ]
    assert np.bincount(faces_of).min() >= 3


def test_ceilings_are_parallel_to_the_roof_above():
    model = build_pair(3.0)  # one plane a side, over both parts
    solid = add_eaves(model, make_eaves([0.5, 0.3, 0.5, 0.3])).eaves.solid
    corners = {vertex for face in solid.select_faces(CEILING) for vertex in face.rings[0]}
    xyz = solid.vertices[list(corners)]
    roof = 8.0 - 0.75 * np.abs(xyz[:, 1])
    assert xyz[:, 2] == pytest.approx(roof - THICKNESS_M, abs=2e-4)
    assert xyz[:, 2].min() == pytest.approx(5.0 - 0.5 * 0.75 - THICKNESS_M, abs=2e-4)


def test_edges_without_overhang_keep_their_wall():
    model = build_pair(3.0, step=1.0)
    solid = add_eaves(model, make_eaves([0.5, 0, 0, 0])).eaves.solid
    assert check_solid(solid) == ()
    x, y, _ = solid.vertices.T
    assert (x.min(), x.max(), y.min(), y.max()) == (-6, 6, -4.5, 4)


def test_roofs_near_the_ground_have_none():
    with pytest.raises(CompositionError, match="leave them out"):
        add_eaves(build_pair(3.0, z=0.3), make_eaves([0.5] * 4))


def test_only_the_eaves_that_hang_too_low_lose_their_overhang():
    model = build_pair(3.0, z=0.5)
    wanted = make_eaves([0.5] * 4)
    valid, reason = add_valid_eaves(model, wanted)
    assert [overhang.edge for overhang in valid.eaves.overhangs] == [1, 3]
    assert check_solid(valid.eaves.solid) == () and "over the ground" in reason
    assert measure_left_out(valid, wanted).tolist() == [12.0, 0.0, 12.0, 0.0]


def build_blocks(*blocks):
    """Level roofs over boxes (x0, y0, x1, y1) at heights z, under one outline."""
    outline = shapely.orient_polygons(shapely.union_all([shapely.box(*box) for box, _ in blocks]))
    ring = shapely.get_coordinates(outline.normalize())[:-1].tolist()
    return build_model(ring, [make_part("flat", box, z) for box, z in blocks])


def test_a_low_roof_too_narrow_for_walls_inside_keeps_its_own():
    model = build_blocks(((0, 0, 10, 8), 6.0), ((3, 8, 7, 8.4), 3.0))
    edges = list_outline_edges(model.roof.outline)
    wanted = make_eaves([0.6] * len(edges.starts), kind="roof")
    valid, _ = add_valid_eaves(model, wanted)
    assert check_solid(valid.eaves.solid) == ()
    assert len(valid.eaves.overhangs) == len(edges.starts)
    left_out = measure_left_out(valid, wanted)
    is_outer = (edges.normals[:, 1] > 0.9) & (edges.lengths < 5.0) & (edges.starts[:, 1] > 8.2)
    assert left_out[is_outer] == pytest.approx([4.0])
    assert left_out[edges.lengths > 5.0].tolist() == [0.0, 0.0, 0.0]


def test_walls_stand_under_each_of_two_blocks_that_meet_in_a_narrow_neck():
    model = build_blocks(((0, 0, 8, 8), 5.0), ((8, 3, 10, 4), 5.0), ((10, 0, 18, 8), 5.0))
    count = len(list_outline_edges(model.roof.outline).starts)
    solid = add_eaves(model, make_eaves([0.6] * count, kind="roof")).eaves.solid
    assert check_solid(solid) == ()
    grounds = [solid.project_face(face).area for face in solid.select_faces(GROUND)]
    assert sorted(grounds) == pytest.approx([6.8**2, 6.8**2], abs=0.01)


@pytest.mark.parametrize("kind", COMPOUND_KINDS)
def test_compounds_have_valid_overhangs(kind):
    rng = np.random.default_rng(7)
    roof = settled_roof(random_compound(rng, kind).roof)
    model = Model(roof, compose(roof, 0.0))
    count = len(list_outline_edges(roof.outline).starts)
    for footprint_kind in ("walls", "roof"):
        lengths = rng.choice([0.0, 0.3, 0.8], count)
        solid = add_eaves(model, make_eaves(lengths, kind=footprint_kind)).finest_solid
        assert check_solid(solid) == ()
        ground = shapely.union_all([solid.project_face(f) for f in solid.select_faces(GROUND)])
        if footprint_kind == "walls":
            assert shapely.area(shapely.symmetric_difference(ground, roof.outline)) < 0.02
