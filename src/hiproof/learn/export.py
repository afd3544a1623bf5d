"""From a trained network to the ONNX file that `hiproof.segment` runs."""

from __future__ import annotations

import dataclasses
import json
import warnings
from pathlib import Path

import torch

from ..errors import InputError
from ..segment.inference import FORMAT, INPUT_NAMES, OUTPUT_NAMES
from ..segment.sampling import POINT_FEATURES
from .network import RoofNetwork, example_batch


def export(network: RoofNetwork, path: str | Path) -> Path:
    """Write `network` as ONNX to `path`, with its types and layout inside.

    Weights keep their names, so that they can be read back from the file. The graph takes the
    arrays of `segment.arrange.Arrangement`, flat over any number of buildings.
    """
    import onnx

    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    network = network.eval()
    flat = {name: {0: f"rows_{name}"} for name in INPUT_NAMES}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            network,
            example_batch(network.settings.layout),
            str(path),
            dynamo=False,
            do_constant_folding=False,
            opset_version=17,
            input_names=list(INPUT_NAMES),
            output_names=list(OUTPUT_NAMES),
            dynamic_axes=flat,
        )
    model = onnx.load(path)
    metadata = {
        "format": FORMAT,
        "types": json.dumps(network.settings.types),
        "layout": json.dumps(dataclasses.asdict(network.settings.layout)),
        "features": json.dumps(POINT_FEATURES),
    }
    onnx.helper.set_model_props(model, metadata)
    onnx.save(model, path)
    return path


def read_weights(network: RoofNetwork, path: str | Path) -> None:
    """Put the weights of an ONNX file that `export` wrote into `network`.

    Raises InputError for a file that cannot be read or is of a network of other types or sizes.
    """
    import onnx

    try:
        tensors = onnx.load(path).graph.initializer
        stored = {
            tensor.name: torch.tensor(onnx.numpy_helper.to_array(tensor)) for tensor in tensors
        }
        weights = {name: stored.get(name, value) for name, value in network.state_dict().items()}
        if missing := [name for name, _ in network.named_parameters() if name not in stored]:
            raise ValueError(f"it has no {missing[0]}")
        network.load_state_dict(weights)
    except Exception as error:
        raise InputError(
            f"expected {path} to hold the weights of such a network, got: "
            f"{str(error).splitlines()[0]}; name a file that `hiproof train` wrote for the same "
            "types, or start from random weights"
        ) from error
