"""`hiproof demo`: the main job on the bundled neighbourhood."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def demo(
    folder: Annotated[Path, typer.Argument(help="folder for the results")] = Path("demo"),
) -> None:
    """Run the main job on the bundled simulated neighbourhood, all roof types in it."""
    from ..city.request import Request
    from ..simulate import demo_files
    from .running import run_request

    files = {name: str(path) for name, path in demo_files().items()}
    refuse_other_run(folder, files["cloud"])
    # the ground is the cloud's own: the terrain model beside it takes an extra, and a demo is the
    # same wherever it runs
    code = run_request(Request((files["cloud"],), folder, files["footprints"], restart=True))
    if code == 0:
        typer.echo(
            f"look at them: hiproof view {folder}; a page about them: hiproof report {folder}"
        )
    raise typer.Exit(code)


def refuse_other_run(folder: Path, cloud: str) -> None:
    """Raise OutputError where the folder holds a run of other clouds than the demo's, which would
    replace it.
    """
    from ..errors import OutputError
    from ..evaluate.run import run_record

    clouds = (run_record(folder).get("inputs") or {}).get("clouds") or []
    # wherever it was installed then
    if any(Path(str(other)).parts[-3:] != Path(cloud).parts[-3:] for other in clouds):
        raise OutputError(
            f"expected a folder for the demo, got {folder}, which holds a run of {clouds[0]}; name "
            "another"
        )
