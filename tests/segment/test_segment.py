"""The shipped network: what it must recognise, what it may not depend on, and what it refuses."""

import csv
import tracemalloc
from functools import partial
from pathlib import Path

import laspy
import numpy as np
import pytest
from benchmarks.samples import draw_sample
from click.testing import CliRunner

from hiproof.cli.app import import_command
from hiproof.errors import FitError, InputError, OutputError, SettingsError
from hiproof.fit import fit_roof
from hiproof.segment import (
    NOT_ROOF,
    Segmentation,
    choose_most_probable,
    combine,
    inference,
    segment,
)
from hiproof.segment.files import segment_files
from hiproof.segment.inference import SHIPPED_WEIGHTS, carried_back, load
from hiproof.segment.posterior import (
    EVIDENCE_EXPONENT,
    OUTLIER_DISTANCE_M,
    SMALLEST_PRIOR,
    expected_distance,
)
from hiproof.settings import Settings
from hiproof.simulate import ROOF_TYPES

REAL_ROOFS = Path(__file__).parents[2] / ".." / "shared" / "data" / "roofn3d" / "labelled"
AS_GABLE = {"asymmetric_gable": "gable"}


def turn(xyz, angle):
    c, s = np.cos(angle), np.sin(angle)
    return xyz @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def cloud(seed, types=ROOF_TYPES):
    """Points (n, 3), labels (n,) with -1 for not-roof, and the type's name."""
    rng = np.random.default_rng([77, seed])
    sample = draw_sample(rng, density=(4.0, 8.0), types=types)
    return sample.xyz, sample.labels, types[sample.type]


def test_types_are_those_of_whole_roofs_in_the_catalogues_order():
    assert load(str(SHIPPED_WEIGHTS)).types == ROOF_TYPES


def test_probabilities_are_distributions():
    points, _, _ = cloud(0)
    result = segment(points)
    assert sum(result.types.values()) == pytest.approx(1.0)
    assert result.labels.shape == result.not_roof.shape == (len(points),)
    assert ((result.not_roof >= 0) & (result.not_roof <= 1)).all()
    assert set(np.unique(result.labels)) <= {NOT_ROOF, *range(len(ROOF_TYPES))}


def test_simulated_roofs_are_recognised_and_freed_of_what_is_no_roof():
    right, intersection, union = 0, 0, 0
    for seed in range(60):
        points, labels, type = cloud(seed)
        result = segment(points)
        right += result.type == type
        is_rejected, true = ~result.is_roof, labels == NOT_ROOF
        intersection = intersection + (is_rejected & true).sum()
        union = union + (is_rejected | true).sum()
    assert right >= 54
    assert intersection / union > 0.8


@pytest.mark.parametrize("angle", [0.4, np.pi / 2, 2.7])
def test_turning_about_z_changes_nothing(angle):
    for seed in range(3):
        points, _, _ = cloud(seed)
        old, new = segment(points), segment(turn(points, angle))
        np.testing.assert_allclose(list(new.types.values()), list(old.types.values()), atol=1e-3)
        assert (old.labels == new.labels).mean() > 0.995


def test_moving_and_reordering_change_nothing():
    points, _, _ = cloud(3)
    order = np.random.default_rng(0).permutation(len(points))
    old, new = segment(points), segment(points[order] + (85_000.0, 446_000.0, 12.0))
    np.testing.assert_allclose(list(new.types.values()), list(old.types.values()), atol=1e-3)
    assert (old.labels[order] == new.labels).mean() > 0.995


def test_named_types_alone_are_chosen_among():
    points, _, _ = cloud(4, ("hip",))
    result = segment(points, Settings().replace({"fit": {"types": ("pyramid", "gable", "hip")}}))
    assert result.type == "hip"
    assert sum(result.types[name] for name in ("pyramid", "gable", "hip")) == pytest.approx(1.0)
    names = {ROOF_TYPES[label] for label in np.unique(result.labels) if label != NOT_ROOF}
    assert names <= {"pyramid", "gable", "hip"}


def test_labelled_real_roofs():
    if not REAL_ROOFS.is_dir():
        pytest.skip("needs ../shared/data/roofn3d/labelled")
    types = {
        path.name: segment(np.loadtxt(path)[:, :3]).type for path in REAL_ROOFS.glob("*/*.pts")
    }
    wrong = [
        path
        for path in REAL_ROOFS.glob("*/*.pts")
        if AS_GABLE.get(types[path.name], types[path.name]) != path.parent.name
    ]
    assert len(wrong) <= 2, wrong


def test_labelled_real_roofs_with_the_fits_evidence():
    if not REAL_ROOFS.is_dir():
        pytest.skip("needs ../shared/data/roofn3d/labelled")
    right = 0
    for path in sorted(REAL_ROOFS.glob("*/*.pts")):
        points = np.loadtxt(path)[:, :3]
        result = segment(points)
        fit = partial(fit_roof, points, weights=result.weights)
        _, posterior = choose_most_probable(
            lambda types, fit=fit: fit(settings=Settings.from_dict({"fit": {"types": types}})),
            result.types,
        )
        most_probable = next(iter(posterior))
        right += AS_GABLE.get(most_probable, most_probable) == path.parent.name
    assert right >= 11


def test_labels_are_carried_back_from_the_nearest_samples():
    sampled = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]])
    probability = np.array([[0.9, 0.0, 0.1], [0.0, 0.2, 0.8], [0.1, 0.8, 0.1]])
    labels, not_roof = carried_back(probability, sampled, sampled + 0.01)
    assert labels.tolist() == [0, NOT_ROOF, 1]
    np.testing.assert_allclose(not_roof, [0.1, 0.8, 0.1], atol=0.01)


def test_points_weigh_nothing_only_where_they_are_surely_no_roof():
    logits = np.log([[0.1, 0.9], [0.3, 0.7], [0.9, 0.1]])
    sampled = np.repeat(np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]]), 12, axis=0)
    result = Segmentation({"gable": 1.0}, np.repeat(logits, 12, axis=0), sampled, sampled)
    assert result.weights.tolist() == [0.0] * 12 + [1.0] * 24
    assert result.is_roof.tolist() == [False] * 24 + [True] * 12
    first_only = Segmentation({"gable": 1.0}, logits[[0] * 12], sampled[:12], sampled[:12])
    assert first_only.weights.tolist() == [1.0] * 12


def test_points_are_labelled_only_when_asked_for(monkeypatch):
    points, _, _ = cloud(0)
    monkeypatch.setattr(
        inference, "carried_back", lambda *_: pytest.fail("nobody asked for the labels")
    )
    assert segment(points).type


def test_a_large_cloud_takes_bounded_memory():
    rng = np.random.default_rng(0)
    xy = rng.uniform(0, (20.0, 12.0), (600_000, 2))
    points = np.column_stack([xy, 8 - 0.6 * abs(xy[:, 1] - 6)])
    segment(points[:1000])
    tracemalloc.start()
    result = segment(points)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert result.type == "gable" and len(result.labels) == len(points)
    assert peak < 12 * points.nbytes


@pytest.mark.parametrize(
    ("points", "error", "words"),
    [
        (np.zeros((9, 3)), FitError, "at least 10 points"),
        (np.ones((50, 3)), FitError, "all in one place"),
        (
            np.r_[np.random.default_rng(0).random((20, 3)), [[np.nan, 0, 0]]],
            FitError,
            "finite coordinates",
        ),
        (np.zeros((20, 2)), InputError, r"\(n, 3\) array"),
        (np.zeros(30), InputError, r"\(n, 3\) array"),
        (np.array([["a", "b", "c"]] * 20), InputError, "array of numbers"),
    ],
)
def test_points_that_cannot_be_a_roof_get_one_sentence(points, error, words):
    with pytest.raises(error, match=words):
        segment(points)


def test_weights_that_cannot_be_used_get_one_sentence(tmp_path):
    points = np.random.default_rng(0).random((20, 3))
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(SHIPPED_WEIGHTS.read_bytes()[:1000])
    for path, words in ((tmp_path / "none.onnx", "no such file"), (broken, "cannot read")):
        with pytest.raises(InputError, match=words):
            segment(points, Settings().replace({"segment": {"weights": str(path)}}))


def test_another_networks_onnx_file_is_refused(tmp_path):
    onnx = pytest.importorskip("onnx", reason="needs the extra `train` (onnx)")
    other = onnx.load(SHIPPED_WEIGHTS)
    onnx.helper.set_model_props(other, {"format": "something else"})
    onnx.save(other, tmp_path / "other.onnx")
    with pytest.raises(InputError, match="something else"):
        segment(
            np.random.default_rng(0).random((20, 3)),
            Settings().replace({"segment": {"weights": str(tmp_path / "other.onnx")}}),
        )


def test_a_gpu_that_is_absent_is_refused():
    import onnxruntime

    if "CUDAExecutionProvider" in onnxruntime.get_available_providers():
        pytest.skip("ONNX Runtime has CUDA here")
    with pytest.raises(SettingsError, match="CUDA"):
        segment(
            np.random.default_rng(0).random((20, 3)),
            Settings().replace({"segment": {"device": "cuda"}}),
        )


def test_types_the_network_does_not_know_are_refused():
    with pytest.raises(SettingsError, match="igloo"):
        segment(
            np.random.default_rng(0).random((20, 3)),
            Settings().replace({"fit": {"types": ("igloo",)}}),
        )


TYPES = {"gable": 0.6, "hip": 0.3, "flat": 0.1}


def test_posterior_is_a_distribution_best_first():
    rng = np.random.default_rng(0)
    for _ in range(50):
        prior = dict(zip("abcde", rng.dirichlet(np.ones(5)), strict=True))
        posterior = combine(prior, {name: rng.normal(0, 200) for name in prior})
        assert sum(posterior.values()) == pytest.approx(1.0)
        assert list(posterior.values()) == sorted(posterior.values(), reverse=True)


def test_a_zero_probability_is_bounded_so_that_evidence_can_undo_it():
    evidence = -2 * np.log(SMALLEST_PRIOR) / EVIDENCE_EXPONENT * 10
    assert next(iter(combine({"gable": 1.0, "hip": 0.0}, {"gable": evidence, "hip": 0.0}))) == "hip"


def test_types_without_evidence_or_without_prior():
    assert combine(TYPES, {}) == pytest.approx(TYPES)
    assert combine(TYPES, {"gable": float("inf"), "hip": float("nan")}) == pytest.approx(TYPES)
    assert set(combine(TYPES, {"gable": 1.0, "cone": 1.0})) == {*TYPES, "cone"}
    assert combine({}, {"gable": 10.0, "hip": 10.0}) == pytest.approx({"gable": 0.5, "hip": 0.5})
    assert combine({}, {}) == {}


def test_a_type_the_fit_gave_up_is_behind_the_best_but_its_evidence_says_little():
    bics = {"gable": 0.0, "hip": 4.0}
    even = dict.fromkeys(TYPES, 1 / 3)
    assert list(combine(even, bics, points=200)) == ["gable", "hip", "flat"]
    assert (
        next(iter(combine({"flat": 0.99, "gable": 0.005, "hip": 0.005}, bics, points=200)))
        == "flat"
    )
    many_points = combine(even, bics, points=2000)["flat"]
    few_points = combine(even, bics, points=20)["flat"]
    assert many_points < few_points


class FakeFit:
    """What `choose_most_probable` needs of a fit."""

    points_used = 100

    def __init__(self, names, noise_m=0.05, outlier_share=0.0, objective="likelihood"):
        self.type, self.bics = (
            (names[0], {names[0]: 50.0}) if names else ("gable", {"gable": 0.0, "hip": 8.0})
        )
        self.noise_m, self.outlier_share, self.objective = noise_m, outlier_share, objective


def test_most_probable_fits_again_only_where_the_network_disagrees_with_the_evidence():
    requests = []

    def fit(names):
        requests.append(names)
        return FakeFit(names)

    choice, posterior = choose_most_probable(fit, {"gable": 0.9, "hip": 0.1})
    assert choice.type == "gable" == next(iter(posterior)) and requests == [()]
    choice, posterior = choose_most_probable(fit, {"gable": 0.01, "hip": 0.99})
    assert choice.type == "hip" == next(iter(posterior)) and requests == [(), (), ("hip",)]


@pytest.mark.parametrize("worse", [{"noise_m": 0.09}, {"outlier_share": 0.05}])
def test_a_named_type_far_from_the_points_is_not_built(worse):
    def fit(names):
        return FakeFit(names, **(worse if names else {}))

    choice, posterior = choose_most_probable(fit, {"gable": 0.01, "hip": 0.99})
    assert next(iter(posterior)) == "hip" and choice.type == "gable"


def test_with_the_papers_objective_the_named_type_is_built():
    def fit(names):
        return FakeFit(names, noise_m=0.9 if names else 0.5, objective="paper")

    choice, _ = choose_most_probable(fit, {"gable": 0.01, "hip": 0.99})
    assert choice.type == "hip"


def test_expected_distance_is_the_mean_over_noise_and_outliers():
    distances = np.abs(np.random.default_rng(0).normal(0, 0.05, 100_000))
    assert expected_distance(FakeFit(())) == pytest.approx(distances.mean(), rel=0.01)
    assert expected_distance(FakeFit((), outlier_share=1.0)) == OUTLIER_DISTANCE_M


def write_cloud(path, seed, shift=(85_000.0, 446_000.0, 10.0)):
    points = np.round(draw_sample(np.random.default_rng(seed)).xyz + shift, 3)
    np.savetxt(path, points, fmt="%.3f")
    return points


def test_points_and_table_say_what_segment_says(tmp_path):
    clouds = [tmp_path / "a.xyz", tmp_path / "b.xyz"]
    points = [write_cloud(path, seed) for seed, path in enumerate(clouds)]
    out = tmp_path / "labelled.laz"
    assert segment_files(clouds, out, Settings()) == {}
    las = laspy.read(out)
    np.testing.assert_allclose(las.xyz, np.concatenate(points), atol=1e-3)
    results = [segment(cloud) for cloud in points]
    assert (las.roof_type == np.concatenate([f.labels + 1 for f in results])).mean() > 0.99
    assert np.bincount(las.building).tolist() == [0, *map(len, points)]
    rows = list(csv.DictReader(out.with_suffix(".csv").read_text().splitlines()))
    assert [row["type"] for row in rows] == [f.type for f in results]
    assert sum(float(rows[0][name]) for name in results[0].types) == pytest.approx(1.0, abs=1e-3)


def test_one_bad_file_does_not_stop_the_others_and_the_exit_code_tells(tmp_path):
    write_cloud(tmp_path / "good.xyz", 1)
    np.savetxt(tmp_path / "few.xyz", np.random.default_rng(0).random((5, 3)))
    arguments = [
        str(tmp_path / "few.xyz"),
        str(tmp_path / "good.xyz"),
        "--out",
        str(tmp_path / "out.laz"),
    ]
    result = CliRunner().invoke(import_command("segment"), arguments)
    assert result.exit_code == 1
    assert "at least 10 points" in result.output
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 2


def test_nothing_to_label_and_wrong_names_are_refused(tmp_path):
    np.savetxt(tmp_path / "few.xyz", np.random.default_rng(0).random((5, 3)))
    with pytest.raises(InputError, match="at least one building"):
        segment_files([tmp_path / "few.xyz"], tmp_path / "out.laz", Settings())
    with pytest.raises(OutputError, match="laz"):
        segment_files([tmp_path / "few.xyz"], tmp_path / "out.txt", Settings())
