"""`hiproof segment`: label points with roof types, and write a table of types."""

from __future__ import annotations

from pathlib import Path

import click

from ..progress import show_progress


def segment(
    clouds: list[Path],
    *,
    out: Path,
    crs: str | None = None,
    unit: str | None = None,
    weights: str = "",
    device: str = "cpu",
) -> int:
    """Label every point with a roof type or not-roof (extra `network`).

    The table holds the roof type of each building. The LAZ has the extra dimensions roof_type
    (number of the type's column in the table, from 1; 0 is no roof), not_roof (a probability) and
    building (number of the file on the command line, from 1). Exit code: 0 all buildings were
    labelled, 1 some were not, 2 unusable input.
    """
    with show_progress("label"):
        from ..segment.files import segment_files
        from ..settings import Settings
        from ..write.files import refuse_replacing

        table = out.with_suffix(".csv")
        refuse_replacing([out, table], [*clouds, weights])
        read = {name: value for name, value in (("crs", crs), ("unit", unit)) if value is not None}
        segment = {"weights": weights, "device": device}
        settings = Settings().replace({"read": read, "segment": segment})
        failures = segment_files(clouds, out, settings)
    for path, reason in failures.items():
        click.echo(f"{path}: {reason}", err=True)
    return 1 if failures else 0
