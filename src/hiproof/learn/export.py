"""From a trained network to the ONNX file that `hiproof.segment` runs."""

from __future__ import annotations

import dataclasses
import json
import warnings
from pathlib import Path

import torch

from ..segment.arrange import FEATURES
from ..segment.inference import FORMAT, INPUT_NAMES, OUTPUT_NAMES
from .batch import example_batch
from .network import RoofNetwork


def export(network: RoofNetwork, path: str | Path) -> Path:
    """Write `network` as ONNX to `path`, with its types and layout inside.

    Weights keep their names, so that they can be read back from the file. The graph takes the arrays of
    `segment.arrange.Arrangement`, flat over any number of buildings.
    """
    import onnx

    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    network = network.eval()
    flat = {name: {0: f"rows_{name}"} for name in INPUT_NAMES}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            network, example_batch(network.settings.layout), str(path), dynamo=False, do_constant_folding=False, opset_version=17,
            input_names=list(INPUT_NAMES), output_names=list(OUTPUT_NAMES), dynamic_axes=flat,
        )  # fmt: skip
    model = onnx.load(path)
    metadata = {
        "format": FORMAT,
        "types": json.dumps(network.settings.types),
        "layout": json.dumps(dataclasses.asdict(network.settings.layout)),
        "features": json.dumps(FEATURES),
    }
    onnx.helper.set_model_props(model, metadata)
    onnx.save(model, path)
    return path
