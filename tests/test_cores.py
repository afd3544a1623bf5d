"""How many processes a run takes where nobody says, and what each leaves to the system."""

import ast
import gc
import os
import weakref
from pathlib import Path

import pytest

import hiproof
from hiproof.city import run
from hiproof.city.request import Request
from hiproof.city.work import cores, processes
from hiproof.city.work.cores import BUILDINGS_A_PROCESS, as_many_as_pay, limit_threads
from hiproof.city.work.executors import InProcess
from hiproof.city.work.processes import Processes
from hiproof.garbage import RARELY, collect_rarely, leave_garbage
from hiproof.write.files import atomic_file
from programs import run_python


@pytest.mark.parametrize(
    "quota, n_cores, expected",
    [
        ("200000 100000\n", 8, 2),
        ("150000 100000", 8, 2),
        ("10000 100000", 8, 1),
        ("max 100000", 8, 8),
        ("800000 100000", 2, 2),
    ],
)
def test_a_container_has_the_cores_of_its_quota(tmp_path, monkeypatch, quota, n_cores, expected):
    file = tmp_path / "cpu.max"
    file.write_text(quota)
    monkeypatch.setattr(cores, "QUOTA", file)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(n_cores), raising=False)
    assert cores.cores() == expected


def test_without_a_quota_all_cores_count(tmp_path, monkeypatch):
    monkeypatch.setattr(cores, "QUOTA", tmp_path / "none")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(5), raising=False)
    assert cores.cores() == 5


def test_processes_never_outnumber_cores_tiles_or_what_the_buildings_pay_for(monkeypatch):
    monkeypatch.setattr(cores, "cores", lambda: 4)
    for buildings in (0, 1, BUILDINGS_A_PROCESS, 2 * BUILDINGS_A_PROCESS, 10**6):
        for tiles in (0, 1, 3, 100):
            count = as_many_as_pay(buildings, tiles)
            assert 1 <= count <= max(1, min(4, tiles, buildings // BUILDINGS_A_PROCESS))
    assert as_many_as_pay(2 * BUILDINGS_A_PROCESS, 2) == 2
    assert as_many_as_pay(BUILDINGS_A_PROCESS, 9, footprints=False) > 1


@pytest.mark.parametrize("error", [ImportError, PermissionError])
def test_where_there_are_no_semaphores_one_process_does_all(monkeypatch, error):
    class Context:
        def Semaphore(self):
            raise error

    monkeypatch.setattr(cores, "cores", lambda: 4)
    assert as_many_as_pay(10**4, 100) == 4
    monkeypatch.setattr("multiprocessing.get_context", lambda kind: Context())
    assert as_many_as_pay(10**4, 100) == 1


def test_linear_algebra_of_workers_takes_one_thread_unless_the_user_said_otherwise(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    environment = dict(os.environ)
    with limit_threads():
        assert (os.environ["OMP_NUM_THREADS"], os.environ["OPENBLAS_NUM_THREADS"]) == ("3", "1")
    assert dict(os.environ) == environment


@pytest.mark.parametrize("pay, kind", [(1, InProcess), (2, Processes)])
def test_a_run_takes_as_many_as_pay_for_what_is_left(tmp_path, town_files, monkeypatch, pay, kind):
    """And an outcome that does not depend on how many these are."""
    requests, counts = [], []
    monkeypatch.setattr(run, "as_many_as_pay", lambda *left: requests.append(left) or pay)
    make = run.make_executor
    monkeypatch.setattr(
        run, "make_executor", lambda *given: counts.append(make(*given)) or counts[-1]
    )
    request = Request((town_files[0],), tmp_path / "out", town_files[1], processes=None)
    summary = run.reconstruct_area(request)
    run.reconstruct_area(request)
    (buildings, tiles, footprints), repeat = requests
    assert buildings == summary.buildings and tiles > 0 and footprints and repeat == (0, 0, True)
    assert type(counts[1]) is kind


def test_garbage_is_collected_rarely_inside_and_as_before_afterwards():
    before = gc.get_threshold()
    with pytest.raises(ZeroDivisionError), collect_rarely():
        assert gc.get_threshold() == (RARELY, *before[1:])
        1 / 0  # noqa: B018
    assert gc.get_threshold() == before


def test_objects_that_refer_to_each_other_are_still_freed():
    """So memory stays flat in runs of any length."""

    class Ring:
        count = 0

        def __init__(self):
            self.ring = self
            Ring.count += 1

        def __del__(self):
            Ring.count -= 1

    with collect_rarely():
        for _ in range(3 * RARELY):
            Ring()
        assert Ring.count <= 2 * RARELY


def test_no_garbage_is_collected_once_a_command_has_ended():
    class Loop:
        pass

    loop = Loop()
    loop.loop = loop
    kept = weakref.ref(loop)
    leave_garbage()
    del loop
    gc.collect()
    assert kept() is not None


PACKAGE = Path(hiproof.__file__).parent
NOT_ON_WINDOWS = {"fcntl", "resource", "pwd", "grp", "termios", "posix", "pty"}
WITHOUT_POSIX = """
import errno, os, pkgutil, importlib, signal
del errno.EDQUOT, os.sched_getaffinity, os.fork, signal.SIGKILL
import hiproof
from hiproof.city import run
from hiproof.city.work import cores
from hiproof.city.work import executors
from hiproof.city.folder import marks
from hiproof.city.work import warm
from hiproof.write import files
print(cores.cores() > 0)
"""


def test_no_module_is_imported_that_windows_lacks():
    modules = {
        name.split(".")[0]
        for file in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        for name in (
            [a.name for a in node.names]
            if isinstance(node, ast.Import)
            else [getattr(node, "module", "") or ""]
        )
        if isinstance(node, (ast.Import, ast.ImportFrom))
    }
    assert modules & NOT_ON_WINDOWS == set() and "numpy" in modules


def test_names_that_windows_lacks_are_not_needed():
    assert run_python(WITHOUT_POSIX).strip() == "True"


def test_files_are_synced_through_descriptors_that_may_write(tmp_path, monkeypatch):
    """Windows refuses the others."""
    fcntl = pytest.importorskip("fcntl", reason="Windows itself tells nothing of a descriptor")
    descriptors = []

    def fsync(descriptor):
        if not os.path.isdir(f"/proc/self/fd/{descriptor}"):
            descriptors.append(fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_ACCMODE)

    monkeypatch.setattr(os, "fsync", fsync)
    with atomic_file(tmp_path / "a.txt") as file:
        file.write(b"whole")
    assert descriptors and all(mode != os.O_RDONLY for mode in descriptors)


def test_no_more_processes_are_started_than_windows_can_wait_for(monkeypatch):
    monkeypatch.setattr(processes.sys, "platform", "win32")
    assert processes.Processes(100).count == 61 and processes.Processes(4).count == 4
