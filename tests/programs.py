"""The command line, and processes of Python's own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import hiproof
from hiproof.cli import main

SOURCES = str(Path(hiproof.__file__).parents[1])


def run_hiproof(*arguments):
    """The exit code of a command, given as in a terminal."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as ended:
        patch.setattr(sys, "argv", ["hiproof", *map(str, arguments)])
        main()
    return ended.value.code


def run_python(code, *arguments, **environment):
    """What `code` prints in a process of its own, which has to end well."""
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "PYTHONPATH": SOURCES, **environment},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
