"""Fixtures that several test files share, and no stale compiled code under test."""

from pathlib import Path

import pytest

import hiproof
import planted
from hiproof.city import run as city_run
from hiproof.city.run import Request, reconstruct_area
from tiny_town import write_town


def pytest_configure(config):
    """Remove compiled functions older than a compiled source beside them: the compiler's cache sees changes in its own file only."""
    if hasattr(config, "workerinput"):  # done by the process that started this worker
        return
    for folder in {cached.parent for cached in Path(hiproof.__file__).parent.rglob("*.nbi")}:
        compiled = [source for source in folder.parent.glob("*.py") if "njit" in source.read_text()]
        changed = max((source.stat().st_mtime for source in compiled), default=0.0)
        for cached in folder.glob("*.nb[ic]"):
            if cached.stat().st_mtime < changed:
                cached.unlink(missing_ok=True)


@pytest.fixture(scope="session")
def town_files(tmp_path_factory):
    """Paths of the tiny town's cloud and footprints."""
    return [str(path) for path in write_town(tmp_path_factory.mktemp("town"))]


@pytest.fixture(scope="session")
def undisturbed(town_files, tmp_path_factory):
    """The output folder of a run over the tiny town that nothing disturbs: what every other run has to give."""
    out = tmp_path_factory.mktemp("undisturbed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(city_run, "solve_tile", planted.solve_quickly)
        reconstruct_area(Request((town_files[0],), out, town_files[1]))
    return out
