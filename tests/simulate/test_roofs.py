"""Generated roofs have the plan and heights of their type, compounds the parts they claim."""

import json
import math

import numpy as np
import pytest
import shapely

from hiproof.errors import InputError
from hiproof.primitives import CATALOGUE
from hiproof.simulate import COMPOUND_KINDS, ROOF_TYPES, random_building, random_compound
from hiproof.simulate.roofs import assemble, make_part

SEEDS = range(12)
PARTS = {
    "L": {2},
    "T": {2},
    "U": {3},
    "cross": {2},
    "extension": {2},
    "two_level": {2},
    "saw_tooth_hall": {2},
}
PARTS |= {"dormered": {2, 3, 4, 5}, "winged_hip": {3}, "L_of_hips": {2}, "row": {3, 4, 5, 6}}


def profile(building, u, v):
    """Roof heights over its eave at (u, v), fractions -1..1 of the half length and half width."""
    part = building.roof.parts[0]
    p, kappa = part.parameters, part.kappa
    uv = np.array([u * p["length"] / 2, v * p["width"] / 2])
    c, s = math.cos(kappa), math.sin(kappa)
    xy = np.array([[c * uv[0] - s * uv[1], s * uv[0] + c * uv[1]]]) + part.translation[:2]
    return building.roof.height_at(xy)[0] - part.translation[2]


@pytest.mark.parametrize("seed", SEEDS)
def test_each_type_has_its_heights(seed):
    rng = np.random.default_rng(seed)
    almost_one = 1 - 1e-9
    for type in ROOF_TYPES:
        building = random_building(rng, type)
        p = building.parameters
        corners = [
            profile(building, u, v)
            for u in (-almost_one, almost_one)
            for v in (-almost_one, almost_one)
        ]
        middle, end = profile(building, 0.0, 1e-9), profile(building, almost_one, 1e-9)
        h = p.get("height", 0.0)
        assert building.type == type and min(corners) == pytest.approx(0.0, abs=1e-6)
        if type == "flat":
            assert max(corners) == pytest.approx(0.0, abs=1e-6)
        elif type in ("monopitch", "shed"):
            assert max(corners) == pytest.approx(h, abs=1e-6)
        elif type == "asymmetric_gable":
            assert profile(
                building, almost_one, p["ridge_offset"] * 2 / p["width"]
            ) == pytest.approx(h, abs=1e-6)
            assert max(corners) == pytest.approx(p["eave_step"], abs=1e-6)
        else:
            low_end = {"gable": h, "gambrel": h, "half_hip": h - p.get("hip_height", 0.0)}.get(
                type, 0.0
            )
            assert middle == pytest.approx(h, abs=1e-6) and end == pytest.approx(low_end, abs=1e-6)
            assert max(corners) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_plan_and_slopes_are_those_of_houses(seed):
    rng = np.random.default_rng(seed)
    for type in ROOF_TYPES:
        building = random_building(rng, type, origin=(10.0, 20.0, 3.0))
        p = building.parameters
        slopes = np.concatenate(
            [np.hypot(*piece.planes[:, :2].T) for piece in building.roof.pieces]
        )
        assert slopes.max() < math.tan(math.radians(70.0))
        assert 20 < building.outline.area < 3000
        assert building.outline.area == pytest.approx(p["length"] * p["width"])
        assert building.z_ground == 3.0
        assert building.footprint.centroid.distance(shapely.Point(10, 20)) < 1e-6
        assert CATALOGUE[type].variant(p).vertices(p)[:, 2].min() == pytest.approx(0.0)


@pytest.mark.parametrize("kind", COMPOUND_KINDS)
def test_compounds_have_their_parts_in_one_outline(kind):
    for seed in SEEDS:
        building = random_compound(np.random.default_rng(seed), kind)
        assert len(building.roof.parts) in PARTS[kind]
        assert building.kind == kind
        assert building.outline.geom_type == "Polygon"
        assert building.outline.is_valid
        covered = shapely.union_all([piece.outline for piece in building.roof.pieces])
        assert covered.symmetric_difference(building.outline).area < 1e-3
        assert len(building.truth()["parts"]) == len(building.roof.parts)


@pytest.mark.parametrize("kind", ["L", "T", "U", "cross"])
def test_wings_change_the_outline_and_show_above_it(kind):
    for seed in SEEDS:
        building = random_compound(np.random.default_rng(seed), kind)
        box_around = building.outline.minimum_rotated_rectangle
        assert building.outline.area < 0.95 * box_around.area
        for part in building.roof.parts:
            inside = shapely.get_coordinates(part.pieces[0].outline)[:-1].mean(axis=0)
            assert np.isfinite(building.roof.height_at(inside[None])).all()


def test_dormers_come_out_of_one_slope_and_end_under_it():
    for seed in SEEDS:
        building = random_compound(np.random.default_rng(seed), "dormered", kappa=0.0)
        house, *dormers = building.roof.parts
        for dormer in dormers:
            (x_low, y_low, x_high, y_high) = dormer.pieces[0].outline.bounds
            side = np.sign(y_low + y_high)
            front, back = sorted((y_low, y_high), key=lambda y: -side * y)
            x = np.linspace(x_low, x_high, 7)
            front_heights = dormer.pieces[0].height_at(np.column_stack([x, np.full(7, front)]))
            front_heights -= house.pieces[0].height_at(np.column_stack([x, np.full(7, front)]))
            back_heights = dormer.pieces[0].height_at(np.column_stack([x, np.full(7, back)]))
            back_heights -= house.pieces[0].height_at(np.column_stack([x, np.full(7, back)]))
            assert front_heights.min() > 0.6 and back_heights.max() < -0.05 and back * side > 0
        outlines = [dormer.pieces[0].outline for dormer in dormers]
        assert shapely.union_all(outlines).area == pytest.approx(
            sum(outline.area for outline in outlines)
        )


def test_two_hips_of_an_l_have_one_ridge_height():
    for seed in SEEDS:
        first, second = random_compound(np.random.default_rng(seed), "L_of_hips").roof.parts
        ridge = [part.translation[2] + part.parameters["height"] for part in (first, second)]
        assert ridge[0] == pytest.approx(ridge[1])
        assert first.translation[2] == pytest.approx(second.translation[2])


def test_the_inner_ends_of_a_hips_wings_are_hidden():
    for seed in SEEDS:
        building = random_compound(np.random.default_rng(seed), "winged_hip", kappa=0.0)
        hip, *wings = building.roof.parts
        for wing in wings:
            x_low, y_low, x_high, y_high = wing.pieces[0].outline.bounds
            y = y_low if wing.translation[1] > 0 else y_high
            end = np.column_stack([np.linspace(x_low, x_high, 9), np.full(9, y)])
            assert (wing.pieces[0].height_at(end) <= hip.pieces[0].height_at(end) + 1e-9).all()


def test_kappa_turns_the_building_and_nothing_else():
    first = random_building(np.random.default_rng(4), "hip", kappa=0.2)
    turned = random_building(np.random.default_rng(4), "hip", kappa=1.2)
    assert turned.parameters == pytest.approx(first.parameters)
    assert math.remainder(turned.kappa - first.kappa - 1.0, math.pi) == pytest.approx(
        0.0, abs=1e-12
    )


@pytest.mark.parametrize("kind", COMPOUND_KINDS)
def test_truth_rebuilds_the_building(kind):
    building = random_compound(np.random.default_rng(8), kind, origin=(5.0, 6.0, 7.0))
    truth = json.loads(json.dumps(building.truth()))
    parts = tuple(
        make_part(*(part[name] for name in ("type", "parameters", "kappa", "translation")))
        for part in truth["parts"]
    )
    rebuilt = assemble(parts, truth["kind"], truth["origin"])
    assert rebuilt.footprint.symmetric_difference(building.footprint).area < 1e-6
    xy = np.random.default_rng(0).uniform(-8, 8, (500, 2))
    xy = xy[shapely.contains_xy(building.outline.buffer(-0.01), xy[:, 0], xy[:, 1])]
    assert np.allclose(rebuilt.roof.height_at(xy), building.roof.height_at(xy), equal_nan=True)
    assert rebuilt.kind == kind and rebuilt.z_ground == 7.0


def test_unknown_types_and_kinds_are_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="expected a roof type"):
        random_building(rng, "thatched")
    with pytest.raises(InputError, match="kind of compound"):
        random_compound(rng, "Z")
