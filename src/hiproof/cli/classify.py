"""`hiproof classify`: a copy of a LAS or LAZ file with classes.

Ground and buildings get a class.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import click

from ..progress import show_progress
from .parameters import Argument, Option


def classify(
    cloud: Annotated[Path, Argument(help="LAS, LAZ or COPC file")],
    out: Annotated[Path, Option(help="LAZ or LAS file to write")],
    crs: Annotated[str | None, Option(help="CRS of the cloud (default: that of the file)")] = None,
    unit: Annotated[
        str | None, Option(help="metre, foot or us-survey-foot, for clouds without a CRS")
    ] = None,
) -> None:
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
