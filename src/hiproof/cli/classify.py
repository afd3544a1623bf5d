"""`hiproof classify`: a copy of a LAS or LAZ file with classes of ground and buildings."""

from __future__ import annotations

from pathlib import Path

import click

from ..progress import show_progress


def classify(cloud: Path, *, out: Path, crs: str | None = None, unit: str | None = None) -> None:
    """Find ground (class 2) and buildings (6), and write a copy with classes.

    hiproof finds both by the shape of the cloud. Points that had one of these classes and are
    neither become unclassified (1). Noise, water and bridges keep their classes, and everything
    else in the file stays as it is.
    """
    with show_progress("classify"):
        from ..classify.files import classify_file
        from ..settings import Settings

        read = {name: value for name, value in (("crs", crs), ("unit", unit)) if value is not None}
        counts = classify_file(cloud, out, Settings().replace({"read": read}))
    click.echo(
        f"{out}: {counts['ground']:,} ground and {counts['building']:,} building points of "
        f"{counts['points']:,}"
    )
