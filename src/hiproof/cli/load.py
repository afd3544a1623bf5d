"""`hiproof load`: the models of a run into PostGIS."""

from __future__ import annotations

from pathlib import Path


def run(folder: Path, dsn: str, prefix: str) -> int:
    from ..write.postgis import load_postgis

    print(
        f"{load_postgis(folder, dsn, prefix)} buildings loaded into {prefix}_buildings, {prefix}_roofs and {prefix}_parts"
    )
    return 0
