"""`hiproof train`: train the network that recognises roofs (extra `train`)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import click

from ..log import Level, console_level
from ..progress import show_progress
from .parameters import Option


def train(
    data: Annotated[
        list[str],
        Option(help="simulated, denhaag:FILE or roofn3d:FOLDER; repeat the option to mix several"),
    ],
    out: Annotated[
        Path,
        Option(
            help="folder for weights, checkpoints, curve and model card; an interrupted training "
            "in it is resumed"
        ),
    ],
    types: Annotated[
        str | None,
        Option(
            help="roof types to distinguish, such as pyramid,gable,hip (default: all in the data)"
        ),
    ] = None,
    samples: Annotated[
        int | None,
        Option(low=1, help="total number of clouds to train on (default: 150,000)"),
    ] = None,
    epoch: Annotated[
        int | None,
        Option(low=1, help="number of clouds between two validations (default: 6,000)"),
    ] = None,
    seed: Annotated[int, Option(low=0, help="seed of all random numbers")] = 1,
    device: Annotated[str, Option(help="auto, cpu or cuda")] = "auto",
    threads: Annotated[int, Option(low=1, help="number of threads of the processor")] = 1,
) -> None:
    """Train the network that recognises roof types (extra `train`).

    To use the result, name its roof_types.onnx in the setting segment.weights.
    """
    arguments = {
        "samples": samples,
        "epoch": epoch,
        "types": tuple(types.split(",")) if types else None,
    }
    given: Any = {name: value for name, value in arguments.items() if value is not None}
    with show_progress("start") as update:
        from ..learn import TrainSettings, train

        settings = TrainSettings(seed=seed, device=device, threads=threads, **given)
        path = train(list(data), out, settings, print_epoch, update)
    click.echo(f"wrote {path}")


def print_epoch(line: str) -> None:
    """Print how an epoch went, unless `--quiet` is given."""
    if console_level() is not Level.error:
        click.echo(line)
