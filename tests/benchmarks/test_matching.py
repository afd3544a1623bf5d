"""Laws of comparing fitted parts with true ones: the truth is right in any order, what is hidden
decides nothing.
"""

import dataclasses

import numpy as np
import pytest
from benchmarks.compounds import compare_parts, report_sigmas
from benchmarks.judging import (
    make_raster,
    measure_named_share,
    measure_visible_areas,
    sum_area_by_type,
)
from benchmarks.matching import (
    compute_sigma_errors,
    has_hidden_end,
    list_right_types,
    match_parts,
    merge_alike,
)

from hiproof.compose import compose
from hiproof.model import Building, Model
from hiproof.simulate import COMPOUND_KINDS, random_building, random_compound
from hiproof.simulate.roofs import make_part
from hiproof.status import Status


def part(type="gable", x=0.0, y=0.0, z=3.0, kappa=0.0, **parameters):
    parameters = parameters or {"length": 6.0, "width": 8.0, "height": 3.0}
    return make_part(type, parameters, kappa, np.array([x, y, z]))


@pytest.mark.parametrize("kind", COMPOUND_KINDS)
def test_the_truth_is_right_in_any_order(kind):
    for seed in range(4):
        roof = random_compound(np.random.default_rng(seed), kind).roof
        parts = merge_alike(roof.parts)
        order = np.random.default_rng(seed).permutation(len(parts))
        shuffled = [parts[k] for k in order]
        n_expected, right, _ = compare_parts(roof, tuple(shuffled))
        assert n_expected == len(parts) and right
        assert [order[j] for j in match_parts(parts, shuffled, make_raster(roof.outline))] == list(
            range(len(parts))
        )


def test_a_missing_a_needless_and_a_wrongly_named_part_are_wrong():
    roof = random_compound(np.random.default_rng(3), "extension").roof
    house, annex = roof.parts
    hidden = part("flat", *annex.translation[:2], 0.5, annex.kappa, length=2.0, width=2.0)
    misnamed = dataclasses.replace(annex, type="pyramid")
    for parts in ((house,), (house, annex, hidden), (house, misnamed)):
        assert not compare_parts(roof, parts)[1]


def test_a_hidden_volume_does_not_change_what_stands_for_what():
    roof = random_compound(np.random.default_rng(5), "T").roof
    hidden = part("flat", *(roof.parts[0].translation - (0.0, 0.0, 0.5)), length=2.0, width=2.0)
    xy = make_raster(roof.outline)
    assert match_parts(roof.parts, (hidden, *roof.parts), xy) == [1, 2]
    assert measure_visible_areas(dataclasses.replace(roof, parts=(hidden, *roof.parts)))[0] == 0.0


def test_equal_neighbours_are_one_and_a_step_of_a_decimetre_keeps_them_apart():
    alike = [part(x=6.0 * k) for k in range(4)]
    merged = merge_alike(alike)
    assert len(merged) == 1 and merged[0].area == pytest.approx(4 * 48.0)
    assert merged[0].parameters == pytest.approx({"width": 8.0, "height": 3.0})
    assert len(merge_alike([*alike[:2], part(x=12.0, z=3.1), part(x=18.0, z=3.1)])) == 2
    assert len(merge_alike([alike[0], part(x=6.5)])) == 2  # half a metre of nothing between them
    assert len(merge_alike([alike[0], part("flat", x=6.0, length=6.0, width=8.0)])) == 2


def test_only_ends_under_another_part_are_hidden():
    house = part(length=12.0, width=8.0, height=4.0)
    wing = part(y=4.0, kappa=np.pi / 2, length=8.0, width=5.0, height=2.5)
    assert (
        has_hidden_end(wing, [house])
        and not has_hidden_end(house, [wing])
        and not has_hidden_end(house, [])
    )
    assert list_right_types(
        part("hip", length=9.0, width=6.0, height=3.0, ridge_length=3.0), True
    ) == {"hip", "side_hip"}
    assert list_right_types(wing, True) == {"gable"}


def test_an_asymmetric_gable_of_equal_slopes_may_be_called_a_gable():
    size = {"length": 9.0, "width": 8.0, "height": 3.0, "ridge_offset": 1.0}
    even = part("asymmetric_gable", **size, eave_step=3.0 * (1 - 3.0 / 5.0))
    assert list_right_types(even, False) == {"asymmetric_gable", "gable"}
    assert list_right_types(part("asymmetric_gable", **size, eave_step=0.0), False) == {
        "asymmetric_gable"
    }


def test_errors_are_counted_in_sigmas_and_not_along_what_is_hidden():
    truth = part()
    sigma = {"width": 0.1, "length": 0.2, "height": 0.05, "t_x": 0.1, "t_z": 0.02, "kappa": 0.01}
    fit = part(x=0.3, z=3.04, kappa=np.pi + 0.02, length=6.2, width=8.1, height=2.9)
    fit = dataclasses.replace(fit, sigma=sigma)
    expected = {"width": 1.0, "length": 1.0, "height": -2.0, "t_x": 3.0, "t_z": 2.0, "kappa": 2.0}
    assert compute_sigma_errors(truth, fit, hidden=False) == pytest.approx(expected)
    assert set(compute_sigma_errors(truth, fit, hidden=True)) == {"width", "height", "t_z", "kappa"}
    assert compute_sigma_errors(dataclasses.replace(truth, type="hip"), fit, hidden=False) == {}
    assert compute_sigma_errors(part(kappa=np.pi / 2), fit, hidden=False) == {}


def test_normal_errors_of_their_sigma_have_a_root_mean_square_of_one():
    rng, truth = np.random.default_rng(0), part()
    heights = [
        part(length=6.0, width=8.0, height=3.0 + 0.05 * error)
        for error in rng.standard_normal(2000)
    ]
    ratios = [
        compute_sigma_errors(truth, dataclasses.replace(p, sigma={"height": 0.05}), False)
        for p in heights
    ]
    rms = np.sqrt(np.mean([ratio["height"] ** 2 for ratio in ratios]))
    assert rms == pytest.approx(1.0, abs=0.05)


def test_no_standard_deviations_are_said_so():
    assert "no part has standard deviations" in report_sigmas([])


def standing(roof, id="house"):
    return Building(
        id, Status.MODELLED, built=Model(roof, compose(roof, 0.0).move(roof.frame.origin))
    )


def test_areas_that_show_make_up_the_outline():
    for kind in COMPOUND_KINDS:
        roof = random_compound(np.random.default_rng(1), kind).roof
        assert measure_visible_areas(roof).sum() == pytest.approx(roof.outline.area)
    roof = random_building(np.random.default_rng(0), "hip").roof
    model = standing(roof)
    assert measure_named_share([model]) == 1.0 and sum_area_by_type([model])[
        "hip"
    ] == pytest.approx(roof.outline.area)
    free = standing(
        dataclasses.replace(roof, parts=(dataclasses.replace(roof.parts[0], type="free"),))
    )
    assert measure_named_share([free]) == 0.0 and measure_named_share(
        [model, free]
    ) == pytest.approx(0.5)
