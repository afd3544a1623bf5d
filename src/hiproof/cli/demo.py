"""`hiproof demo`: the main job on the bundled neighbourhood."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def demo(*, out: Path = Path("demo")) -> int:
    """Model the 26 houses of a bundled, simulated neighbourhood.

    Every roof type occurs in it.
    """
    from .running import run_request

    return run_request(lambda: make_request(out))


def make_request(out: Path) -> Any:
    """Make the request of the demo.

    The ground is that of the cloud: the terrain model beside it takes an extra, and a demo is the
    same wherever it runs.
    """
    from ..city.request import Request
    from ..simulate import demo_files

    files = {name: str(path) for name, path in demo_files().items()}
    refuse_other_run(out, files["cloud"])
    return Request((files["cloud"],), out, files["footprints"], restart=True)


def refuse_other_run(folder: Path, cloud: str) -> None:
    """Raise OutputError where the folder holds a run of other clouds, which would be lost."""
    from ..errors import OutputError
    from ..evaluate.run import run_record

    clouds = (run_record(folder).get("inputs") or {}).get("clouds") or []
    # wherever it was installed then
    if any(Path(str(other)).parts[-3:] != Path(cloud).parts[-3:] for other in clouds):
        raise OutputError(
            f"expected a folder for the demo, got {folder}, which holds a run of {clouds[0]}; name "
            "another"
        )
