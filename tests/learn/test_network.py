"""The network: its graph, its symmetry, and that ONNX Runtime says what PyTorch says."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra `train` (torch)")
onnx = pytest.importorskip("onnx", reason="needs the extra `train` (onnx)")

from hiproof.errors import InputError  # noqa: E402
from hiproof.learn.data import open_source  # noqa: E402
from hiproof.learn.export import export, read_weights  # noqa: E402
from hiproof.learn.network import (  # noqa: E402
    NetworkSettings,
    RoofNetwork,
    network_inputs,
)
from hiproof.learn.sample import (  # noqa: E402
    ACROSS_AXES,
    ALONG_AXES,
    TRAINING,
    AugmentSettings,
    symmetric,
    vary_cloud,
)
from hiproof.segment.arrange import Layout, arrange  # noqa: E402
from hiproof.segment.inference import SHIPPED_WEIGHTS, load, run  # noqa: E402

pytestmark = pytest.mark.train

TINY = NetworkSettings(
    types=("gable", "hip", "pyramid"),
    layout=Layout(points=64, levels=(32, 16, 8), neighbours=6),
    widths=((8, 12), (12, 16), (16, 20), (20, 24)),
    up_widths=(16, 12),
)


def tiny_network(seed=0):
    """A network whose statistics have seen some clouds, so that evaluation is not trivial."""
    torch.manual_seed(seed)
    network = RoofNetwork(TINY).train()
    with torch.no_grad():
        network(*network_inputs(clouds(8), TINY.layout))
    return network.eval()


def clouds(count, layout=TINY.layout, start=0):
    source = open_source("simulated")
    return [arrange(source.sample(TRAINING, start + i).xyz, layout) for i in range(count)]


def largest_difference(network, path, arrangements):
    with torch.no_grad():
        expected = network(*network_inputs(arrangements, network.settings.layout))
    probabilities = run(load(str(path)), arrangements)
    return max(np.abs(a.numpy() - b).max() for a, b in zip(expected, probabilities, strict=True))


@pytest.mark.parametrize("count", [1, 3])
def test_onnx_equals_torch_for_a_fresh_network(tmp_path, count):
    network = tiny_network()
    path = export(network, tmp_path / f"tiny{count}.onnx")
    assert largest_difference(network, path, clouds(count, start=20)) < 1e-4
    assert load(str(path)).types == TINY.types and load(str(path)).layout == TINY.layout


def test_onnx_equals_torch_for_the_shipped_weights():
    """The shipped file's own weights, put back into a PyTorch network, give the same logits."""
    model = load(str(SHIPPED_WEIGHTS))
    network = RoofNetwork(NetworkSettings(types=model.types, layout=model.layout)).eval()
    read_weights(network, SHIPPED_WEIGHTS)
    assert largest_difference(network, SHIPPED_WEIGHTS, clouds(4, model.layout, start=40)) < 1e-4


def test_weights_of_another_network_or_none_are_refused(tmp_path):
    tiny = export(tiny_network(), tmp_path / "tiny.onnx")
    (tmp_path / "broken.onnx").write_bytes(tiny.read_bytes()[:500])
    for path in (SHIPPED_WEIGHTS, tmp_path / "broken.onnx", tmp_path / "none.onnx"):
        with pytest.raises(InputError, match="weights of such a network"):
            read_weights(RoofNetwork(TINY), path)


def test_repeated_points_of_a_small_cloud_change_nothing_for_the_others():
    """A cloud smaller than the layout is filled with repeats, whose logits are the originals'."""
    network = tiny_network()
    xyz = open_source("simulated").sample(TRAINING, 5).xyz[:40]
    arranged = arrange(xyz, TINY.layout)
    with torch.no_grad():
        logits, _ = network(*network_inputs([arranged], TINY.layout))
    np.testing.assert_allclose(logits[40:].numpy(), logits[:24].numpy(), atol=1e-5)


def test_gradient_reaches_every_weight():
    network = RoofNetwork(TINY).train()
    points, types = network(*network_inputs(clouds(4), TINY.layout))
    (points.square().sum() + types.square().sum()).backward()
    assert all(
        parameter.grad is not None and parameter.grad.abs().sum() > 0
        for parameter in network.parameters()
    )


def test_symmetric_mirrors_along_and_across_and_nothing_else():
    features, visible = clouds(1)[0].features, set()
    for seed in range(20):
        signs = symmetric(features, np.random.default_rng(seed)) / np.where(
            features == 0, 1, features
        )
        assert np.isin(signs[features != 0], (-1, 1)).all()
        along, across = (
            np.sign(signs[features[:, columns[0]] != 0, columns[0]][0])
            for columns in (ALONG_AXES, ACROSS_AXES)
        )
        expected = np.ones(features.shape[1])
        expected[list(ALONG_AXES)], expected[list(ACROSS_AXES)] = along, across
        np.testing.assert_array_equal(
            np.where(features == 0, expected, signs), np.tile(expected, (len(features), 1))
        )
        visible.add((along, across))
    assert len(visible) == 4


def test_varied_keeps_labels_with_their_points():
    sample = open_source("simulated").sample(TRAINING, 6)
    xyz, labels = sample.xyz, sample.labels
    settings = AugmentSettings(scale=0.0, stretch=0.0, jitter_m=0.0)
    changed, new_labels = vary_cloud(xyz, labels, np.random.default_rng(1), settings)
    label_of = {tuple(point): label for point, label in zip(xyz, labels, strict=True)}
    assert [label_of[tuple(point)] for point in changed] == new_labels.tolist()
    assert len(changed) <= len(xyz)
