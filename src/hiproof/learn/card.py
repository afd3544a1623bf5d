"""The record of a training run: its curve and its model card.

The curve is a picture, and the card is JSON and Markdown.
"""

from __future__ import annotations

import json
from pathlib import Path

from .. import __version__


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
    """Write `model_card.json` and `model_card.md`.

    They have data, settings, figures of the best epoch, and what trained it.
    """
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
