"""The network: its graph, its symmetry, and that ONNX Runtime says what PyTorch says."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra `train` (torch)")
onnx = pytest.importorskip("onnx", reason="needs the extra `train` (onnx)")

from hiproof.learn.augment import AugmentSettings, symmetric, varied  # noqa: E402
from hiproof.learn.batch import network_inputs  # noqa: E402
from hiproof.learn.export import export  # noqa: E402
from hiproof.learn.network import NetworkSettings, RoofNetwork, turn_matrices  # noqa: E402
from hiproof.segment.arrange import TURNED_PAIRS, Layout, arrange  # noqa: E402
from hiproof.segment.inference import SHIPPED_WEIGHTS, load, run  # noqa: E402
from hiproof.simulate import training_sample  # noqa: E402

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
    return [arrange(training_sample(np.random.default_rng(start + i))[0], layout) for i in range(count)]


def largest_difference(network, path, arrangements):
    with torch.no_grad():
        expected = network(*network_inputs(arrangements, network.settings.layout))
    told = run(load(str(path)), arrangements)
    return max(np.abs(a.numpy() - b).max() for a, b in zip(expected, told, strict=True))


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
    stored = {
        tensor.name: onnx.numpy_helper.to_array(tensor) for tensor in onnx.load(SHIPPED_WEIGHTS).graph.initializer
    }
    missing, _ = network.load_state_dict(
        {k: torch.tensor(v) for k, v in named_weights(network, stored).items()}, strict=False
    )
    assert not [name for name in missing if not name.endswith("num_batches_tracked")]
    assert largest_difference(network, SHIPPED_WEIGHTS, clouds(4, model.layout, start=40)) < 1e-4


def named_weights(network, stored):
    """The file's tensors by the network's names; `export` keeps both the same."""
    return {name: stored[name] for name in network.state_dict() if name in stored}


def test_a_quarter_turn_changes_nothing():
    network, arranged = tiny_network(), clouds(2, start=30)
    inputs = network_inputs(arranged, TINY.layout)
    turned = (inputs[0] @ turn_matrices()[1], *inputs[1:])
    with torch.no_grad():
        for before, after in zip(network(*inputs), network(*turned), strict=True):
            torch.testing.assert_close(before, after, atol=1e-5, rtol=0)


def test_repeated_points_of_a_small_cloud_change_nothing_for_the_others():
    """A cloud smaller than the layout is filled with repeats, whose logits are the originals'."""
    network = tiny_network()
    xyz = training_sample(np.random.default_rng(5))[0][:40]
    arranged = arrange(xyz, TINY.layout)
    with torch.no_grad():
        logits, _ = network(*network_inputs([arranged], TINY.layout))
    np.testing.assert_allclose(logits[40:].numpy(), logits[:24].numpy(), atol=1e-5)


def test_gradient_reaches_every_weight():
    network = RoofNetwork(TINY).train()
    points, types = network(*network_inputs(clouds(4), TINY.layout))
    (points.square().sum() + types.square().sum()).backward()
    assert all(parameter.grad is not None and parameter.grad.abs().sum() > 0 for parameter in network.parameters())


def test_symmetric_keeps_lengths_and_heights():
    features = clouds(1)[0].features
    changed = symmetric(features, np.random.default_rng(3))
    for x, y in TURNED_PAIRS:
        np.testing.assert_allclose(np.hypot(*changed[:, [x, y]].T), np.hypot(*features[:, [x, y]].T), rtol=1e-5)
    np.testing.assert_array_equal(changed[:, [2, 5, 6, 7, 10]], features[:, [2, 5, 6, 7, 10]])


def test_varied_keeps_labels_with_their_points():
    xyz, labels, _ = training_sample(np.random.default_rng(6))
    still = AugmentSettings(scale=0.0, stretch=0.0, jitter_m=0.0)
    changed, kept = varied(xyz, labels, np.random.default_rng(1), still)
    label_of = {tuple(point): label for point, label in zip(xyz, labels, strict=True)}
    assert [label_of[tuple(point)] for point in changed] == kept.tolist()
    assert len(changed) <= len(xyz)
