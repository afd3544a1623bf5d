"""What reaches the terminal: a word at Ctrl-C, and names from outside as they are, whatever they
look like.
"""

import os
import signal
import subprocess
import sys
import time
import warnings

import pytest

from fuzz.damaged_models import change, sound_lines
from hiproof import cli
from hiproof.city import run as city_run
from hiproof.city.work.processes import Processes
from hiproof.cli.evaluate import evaluate
from hiproof.compiled import news
from programs import run_python
from tiny_town import make_town, write_town


@pytest.fixture
def hiproof(monkeypatch, quick_tiles):
    """Runs the command line in this process; gives its exit code."""
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    monkeypatch.setattr(news, "listener", news.listener)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["hiproof", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        return end.value.code

    return run


@pytest.fixture
def town(tmp_path):
    return write_town(tmp_path / "town", make_town(2, 3.0))


def test_an_interrupted_run_says_what_is_kept_and_goes_on(
    hiproof, town, tmp_path, monkeypatch, capsys
):
    command = ("reconstruct", town[0], "--footprints", town[1], "--out", tmp_path / "out")
    with monkeypatch.context() as patch:

        def interrupt(*_):
            signal.raise_signal(
                signal.SIGINT
            )  # in this thread: os.kill may choose another, and this one goes on for a while

        patch.setattr(city_run, "merge", interrupt)
        assert hiproof(*command) == 130
    output = capsys.readouterr().err
    assert "interrupted" in output and "the same command goes on from there" in output
    assert hiproof(*command) == 0
    assert "solve 0.0 s" in capsys.readouterr().out


def interrupt_compiled_code(*_, **__):
    """What a call of compiled code does when Ctrl-C comes meanwhile."""
    inner = SystemError("returned a result with an exception set")
    inner.__cause__ = KeyboardInterrupt()
    raise SystemError("returned a result with an exception set") from inner


@pytest.mark.parametrize(
    "place",
    ["work.sort.lowest_in_cells", "work.solve.Surroundings", "work.solve.fragments", "run.merge"],
)
def test_an_interrupt_within_compiled_code_is_no_failure(
    hiproof, town, tmp_path, monkeypatch, capsys, place
):
    command = ("reconstruct", town[0], "--footprints", town[1], "--out", tmp_path / "out")
    with monkeypatch.context() as patch:
        patch.setattr(f"hiproof.city.{place}", interrupt_compiled_code)
        assert hiproof(*command) == 130
    assert "the same command goes on from there" in capsys.readouterr().err
    assert hiproof(*command) == 0


def test_an_interrupt_ends_a_build_from_parameters(hiproof, town, tmp_path, monkeypatch):
    out = tmp_path / "out"
    assert hiproof("reconstruct", town[0], "--footprints", town[1], "--out", out) == 0
    monkeypatch.setattr("hiproof.parametric.run.build", interrupt_compiled_code)
    assert hiproof("build", out / "parameters.jsonl", "--out", tmp_path / "built") == 130


INTERRUPT = """
import atexit, signal, sys

class Interrupt:
    def find_spec(name, path=None, target=None):
        if name == {moment!r}:
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Interrupt)
if {moment!r} == "the end":
    atexit.register(signal.raise_signal, signal.SIGINT)
"""


@pytest.mark.parametrize("moment", ["hiproof.cli", "numpy.linalg", "click", "the end"])
def test_an_interrupt_while_packages_are_imported_or_at_the_end_shows_no_traceback(
    moment, tmp_path
):
    (tmp_path / "sitecustomize.py").write_text(INTERRUPT.format(moment=moment))
    command = [sys.executable, "-m", "hiproof", "attributes"]
    paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run(
        command, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True
    )
    assert run.returncode == 130 and run.stderr in ("", f"hiproof: {cli.KEPT}\n")


def test_importing_the_package_leaves_interrupts_alone():
    script = (
        "import hiproof, signal; print(signal.getsignal(signal.SIGINT) is "
        "signal.default_int_handler)"
    )
    assert run_python(script) == "True\n"


def interrupt_worker():
    os.kill(os.getpid(), signal.SIGINT)
    return "finished"


def test_workers_leave_an_interrupt_to_their_parent():
    processes = Processes(1)
    try:
        ((_, result, error),) = processes.run(interrupt_worker, [()])
    finally:
        processes.close()
    assert (result, error) == ("finished", None)


def test_an_interrupt_does_not_wait_for_what_workers_are_at():
    processes = Processes(1)
    outcomes = processes.run(time.sleep, [(0,), (600,)])
    next(outcomes)
    with pytest.raises(KeyboardInterrupt):
        outcomes.throw(KeyboardInterrupt)
    processes.close()  # returns once the worker has ended


def test_a_file_that_is_named_like_markup_is_named_as_it_is(hiproof, town, tmp_path, capsys):
    broken = tmp_path / "[" / "red].laz"
    broken.parent.mkdir()
    broken.write_bytes(town[0].read_bytes()[:500])
    out = tmp_path / "[bold]out[" / "bold]"
    assert hiproof("reconstruct", town[0], broken, "--footprints", town[1], "--out", out) == 2
    output = capsys.readouterr().out
    assert f"not read: {broken}: expected" in output
    assert f"files: {out}" in output


def test_a_roof_type_that_looks_like_markup_is_shown_as_it_is(tmp_path, capsys):
    lines = sound_lines(tmp_path)
    attributes = (1, "CityObjects", ..., "attributes")
    marked = change(lines, *attributes, by=lambda known: known | {"hiproof_roof_type": "[/red]"})
    (tmp_path / "buildings.city.jsonl").write_bytes(marked)
    (tmp_path / "points.xyz").write_text("85000.0 446000.0 5.0\n85001.0 446000.0 5.0\n")
    evaluate(tmp_path, [str(tmp_path / "points.xyz")])
    assert "[/red]" in capsys.readouterr().out
