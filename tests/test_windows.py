"""What Windows does otherwise, as far as it can be tried elsewhere: names that are not there, files
that are in use, limits.
"""

import ast
import os
from pathlib import Path

import pytest

import hiproof
from hiproof.city.work import processes
from hiproof.write.files import atomic_file
from programs import run_python

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
