"""A finished run over the tiny town whose roofs are all wrong: flat, as nothing else was allowed.
What a person mends.
"""

from pathlib import Path

import hiproof

WRONG = hiproof.Settings.from_dict({"segment": {"network": "never"}, "fit": {"types": ["flat"]}})


def make_request(
    town_files: list[str], out: Path, overrides: Path | None = None
) -> hiproof.Request:
    """The run's request, and with `overrides` that of the next one."""
    return hiproof.Request(
        (town_files[0],),
        out,
        town_files[1],
        settings=WRONG,
        overrides=str(overrides) if overrides else None,
    )
