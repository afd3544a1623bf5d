"""`hiproof train`: train the network that recognises roofs (extra `train`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..log import Level, console_level
from ..progress import show_progress


def train(
    *,
    data: list[str],
    out: Path,
    types: str | None = None,
    samples: int | None = None,
    epoch: int | None = None,
    seed: int = 1,
    device: str = "auto",
    threads: int = 1,
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
