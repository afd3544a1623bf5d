"""From a trained network to the ONNX file of `hiproof.segment`, its curve, its model card."""

from __future__ import annotations

import dataclasses
import json
import warnings
from pathlib import Path

import torch

from .. import __version__
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


def write_curve(history: list[dict], path: Path) -> None:
    """Plot loss and validation figures by epoch as a PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4), layout="constrained")
    FigureCanvasAgg(figure)
    epochs = [record["epoch"] for record in history]
    left = figure.add_subplot()
    left.plot(
        epochs, [record["loss"] for record in history], color="tab:grey", label="training loss"
    )
    left.set(xlabel="epoch", ylabel="loss")
    right = left.twinx()
    for name, colour in (("balanced_accuracy", "tab:blue"), ("mean_iou", "tab:orange")):
        right.plot(
            epochs, [record[name] for record in history], color=colour, label=name.replace("_", " ")
        )
    right.set(ylim=(0, 1), ylabel="validation")
    figure.legend(loc="outside upper center", ncols=3)
    figure.savefig(path, dpi=110)


def write_card(
    folder: Path,
    description: str,
    settings: dict,
    history: list[dict],
    best_epoch: int,
    made_by: dict,
) -> None:
    """Write `model_card.json` and `.md`: data, settings, figures of the best epoch, maker."""
    best = next(record for record in history if record["epoch"] == best_epoch)
    card = {
        "hiproof": __version__,
        "data": description,
        "trained_on": made_by,
        "clouds_shown": best_epoch * settings["epoch"],
        "best_epoch": best_epoch,
        "validation": {name: best[name] for name in ("balanced_accuracy", "mean_iou", "recalls")},
        "settings": settings,
    }
    (folder / "model_card.json").write_text(json.dumps(card, indent=2) + "\n")
    (folder / "model_card.md").write_text(card_text(card))


def card_text(card: dict) -> str:
    """Return the model card as Markdown."""
    validation = card["validation"]
    recalls = "\n".join(
        f"| {name} | {value:.3f} |" for name, value in validation["recalls"].items()
    )
    settings = "\n".join(f"| {name} | {value} |" for name, value in card["settings"].items())
    return f"""# Model card: roof types

PointNet++ (four set abstractions, two feature propagations) that labels every point of a building's
airborne LiDAR cloud with a roof type or not-roof, and names the building's type.

- **Data**: {card["data"]}
- **Trained on**: {card["trained_on"]["device"]}, {card["trained_on"]["hours"]} hours,
  {card["clouds_shown"]} clouds shown
- **Best epoch by validation**: {card["best_epoch"]}
- **Validation**: balanced accuracy {validation["balanced_accuracy"]:.3f}, point mean IoU
  {validation["mean_iou"]:.3f}
- **Meant for**: clouds of one building, 10 points or more, about 1-20 points/m2, in metres, Z up.
  Its probabilities are the prior of the choice of type, never the last word.
- **Not meant for**: whole towns in one cloud, indoor or terrestrial scans, roofs that are none of
  the types.

| type | recall in validation |
| --- | --- |
{recalls}

| setting | value |
| --- | --- |
{settings}
"""
