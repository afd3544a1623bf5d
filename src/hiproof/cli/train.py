"""`hiproof train`: train the network that recognises roofs (extra `train`)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def train(
    data: Annotated[
        list[str],
        typer.Option(
            help="simulated, denhaag:FILE or roofn3d:DIR; repeat the option to mix several"
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            help="folder for weights, checkpoints, curve and model card; resumes a run in it"
        ),
    ],
    types: Annotated[
        str | None, typer.Option(help="roof types to distinguish, such as pyramid,gable,hip")
    ] = None,
    samples: Annotated[
        int | None, typer.Option(min=1, help="total number of clouds to train on")
    ] = None,
    epoch: Annotated[
        int | None, typer.Option(min=1, help="number of clouds between two validations")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="seed of all random numbers")] = 1,
    device: Annotated[str, typer.Option(help="auto, cpu or cuda")] = "auto",
    threads: Annotated[int, typer.Option(min=1, help="number of threads")] = 1,
) -> None:
    """Train the network that recognises roof types (extra `train`).

    To use the result, name it in the setting segment.weights.
    """
    from ..learn import TrainSettings, train

    arguments = {
        "samples": samples,
        "epoch": epoch,
        "types": tuple(types.split(",")) if types else None,
    }
    settings = TrainSettings(
        seed=seed,
        device=device,
        threads=threads,
        **{name: value for name, value in arguments.items() if value is not None},
    )
    path = train(list(data), out, settings, report=typer.echo)
    typer.echo(f"wrote {path}")
