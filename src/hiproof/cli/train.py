"""`hiproof train`: train the network that recognises roofs (extra `train`)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def train(
    data: Annotated[
        list[str], typer.Option(help="simulated, denhaag:FILE or roofn3d:DIR; give it again to mix")
    ],
    out: Annotated[
        Path,
        typer.Option(
            help="folder for weights, checkpoints, curve and model card; a run in it goes on"
        ),
    ],
    types: Annotated[
        str | None, typer.Option(help="roof types to tell apart, such as pyramid,gable,hip")
    ] = None,
    samples: Annotated[int | None, typer.Option(min=1, help="clouds to show in all")] = None,
    epoch: Annotated[int | None, typer.Option(min=1, help="clouds between validations")] = None,
    seed: Annotated[int, typer.Option(min=0, help="every random draw follows from it")] = 1,
    device: Annotated[str, typer.Option(help="auto, cpu or cuda")] = "auto",
    threads: Annotated[int, typer.Option(min=1, help="processor threads")] = 1,
) -> None:
    """Train the network on labelled clouds; name the result in the setting segment.weights to use
    it.
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
