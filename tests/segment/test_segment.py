"""The shipped network: what it must recognise, what it may not depend on, and what it refuses."""

import tracemalloc
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from benchmarks.samples import training_sample

from hiproof.errors import FitError, InputError, SettingsError
from hiproof.fit import fit_roof
from hiproof.segment import NOT_ROOF, Segmentation, choose_most_probable, inference, segment
from hiproof.segment.inference import SHIPPED_WEIGHTS, carried_back, load
from hiproof.settings import Settings
from hiproof.simulate import ROOF_TYPES

REAL_ROOFS = Path(__file__).parents[2] / ".." / "shared" / "data" / "roofn3d" / "labelled"
AS_GABLE = {"asymmetric_gable": "gable"}


def turn(xyz, angle):
    c, s = np.cos(angle), np.sin(angle)
    return xyz @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def cloud(seed, types=ROOF_TYPES):
    """Points (n, 3), labels (n,) with -1 for not-roof, and the type's name."""
    points, labels, type = training_sample(
        np.random.default_rng([77, seed]), types, density=(4.0, 8.0)
    )
    return points, np.where(labels == len(types), NOT_ROOF, labels), types[type]


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
