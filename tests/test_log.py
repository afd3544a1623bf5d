"""What goes to the console and what to the file, from this process and its workers; no secret to
either.
"""

import logging
import warnings
from pathlib import Path

import pytest

import planted
from hiproof import log
from hiproof.city import run as city_run
from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work.processes import Processes
from hiproof.errors import InputError, InputWarning, OutputError
from programs import run_hiproof, run_python


def read_lines(path):
    """(level, message) of each line of a log file."""
    return [tuple(line.split(" ", 4)[i] for i in (2, 4)) for line in path.read_text().splitlines()]


@pytest.mark.parametrize(
    ("level", "console", "file"),
    [
        ("debug", ["debug", "info", "warning", "error"], ["debug", "info", "warning", "error"]),
        ("info", ["info", "warning", "error"], ["info", "warning", "error"]),
        ("warning", ["warning", "error"], ["info", "warning", "error"]),
        ("error", ["error"], ["info", "warning", "error"]),
    ],
)
def test_each_place_gets_its_levels(level, console, file, tmp_path, capsys):
    log.start(log.Level(level), tmp_path / "deep" / "run.log")
    for name in ("debug", "info", "warning", "error"):
        log.LOGGER.log(log.Level(name).number, name)
    assert capsys.readouterr().err.splitlines() == [f"hiproof: {name}" for name in console]
    assert read_lines(tmp_path / "deep" / "run.log") == [(name.upper(), name) for name in file]


def test_secrets_are_masked_in_messages_arguments_and_tracebacks(tmp_path, capsys):
    log.start(file=tmp_path / "run.log")
    try:
        raise ValueError("https://u:s3cret@host")
    except ValueError:
        log.LOGGER.error("at %s", "postgresql://u:s3cret@host", exc_info=True)
    warnings.warn("https://u:s3cret@host/a.laz is odd", InputWarning)
    output = capsys.readouterr().err + (tmp_path / "run.log").read_text()
    assert output.count("Traceback") == output.count("is odd") == 2 and "s3cret" not in output


def test_a_terminal_obeys_no_name(tmp_path, capsys):
    log.start(file=tmp_path / "run.log")
    odd = "a\x1b[31m\u202e\x9b\x07"
    log.LOGGER.error("building %s", odd)
    warnings.warn(f"{odd} is odd", InputWarning)
    output = capsys.readouterr().err + (tmp_path / "run.log").read_text(encoding="utf-8")
    assert output.count(r"a\x1b[31m\u202e\x9b\x07") == 4
    assert str(InputError(odd)) == r"a\x1b[31m\u202e\x9b\x07"


def test_what_other_packages_say_is_for_debugging_alone(tmp_path, capsys):
    """NumPy's warnings and rasterio's remarks in their own words help nobody who did not write
    this.
    """
    for level, n_lines in (("warning", 0), ("debug", 1)):
        log.start(log.Level(level), tmp_path / f"{level}.log")
        warnings.warn(f"invalid value encountered in {level}", RuntimeWarning)
        logging.getLogger("rasterio._env").warning("CPLE_AppDefined in a.tif")
        output = capsys.readouterr().err
        assert (
            output.count("invalid value encountered") == output.count("CPLE_AppDefined") == n_lines
        )


def test_starting_again_adds_to_the_file_and_repeats_nothing(tmp_path, capsys):
    for _ in range(2):
        log.start(file=tmp_path / "run.log")
        log.LOGGER.warning("once")
    assert read_lines(tmp_path / "run.log") == [("WARNING", "once")] * 2
    assert capsys.readouterr().err == "hiproof: once\n" * 2


def test_a_file_that_cannot_be_written_gets_one_sentence(tmp_path):
    with pytest.raises(OutputError, match="--log-file"):
        log.start(file=tmp_path)


def test_workers_write_to_the_same_places(tmp_path, capfd, spawned_workers):
    log.start(file=tmp_path / "run.log")
    executor = Processes(1)
    list(
        executor.run(
            warnings.warn, [("3 points of https://u:s3cret@host were left out", InputWarning)]
        )
    )
    executor.close()
    assert read_lines(tmp_path / "run.log") == [
        ("WARNING", "3 points of https://u:...@host were left out")
    ]
    assert capfd.readouterr().err == "hiproof: 3 points of https://u:...@host were left out\n"


def test_the_file_tells_of_every_step_and_of_lost_workers(
    town_files, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(city_run, "solve_tile", planted.solve_killed_once)
    log.start(log.Level.debug, tmp_path / "run.log")
    reconstruct_area(Request((town_files[0],), tmp_path / "out", town_files[1], processes=2))
    lines = read_lines(tmp_path / "run.log")
    message = "\n".join(f"{level} {text}" for level, text in lines)
    assert "INFO version" in message and "4 buildings in 1 work tile\n" in message
    assert "INFO sort:0 is done" in message and "is done: 4 buildings" in message
    assert "WARNING solve:" in message
    assert "was lost (a worker process died) and is tried again" in message
    assert (
        sum(level == "DEBUG" and text.startswith("building house-") for level, text in lines) == 4
    )
    assert lines[-1][1].startswith("4 buildings: {")


def test_the_command_line_keeps_its_errors_in_the_file(tmp_path, monkeypatch, capsys):
    def refuse(request, progress):
        raise InputError("expected points at https://u:s3cret@host, got none")

    monkeypatch.setattr("hiproof.city.run.reconstruct_area", refuse)
    (tmp_path / "a.laz").write_bytes(b"LASF")
    arguments = ["reconstruct", tmp_path / "a.laz", "--out", tmp_path / "out", "--quiet"]
    assert run_hiproof(*arguments, "--log-file", tmp_path / "run.log") == 2
    assert read_lines(tmp_path / "run.log") == [
        ("ERROR", "expected points at https://u:...@host, got none")
    ]
    assert capsys.readouterr().err == "hiproof: expected points at https://u:...@host, got none\n"


def test_the_library_itself_sets_nothing_up():
    code = "import hiproof.log, logging; print(logging.getLogger('hiproof').handlers)"
    assert run_python(code) == "[]\n"


def test_lines_of_several_workers_stay_whole(tmp_path):
    log.start(file=tmp_path / "run.log")
    executor = Processes(2)
    list(executor.run(warnings.warn, [(f"task {i}", InputWarning) for i in range(40)]))
    executor.close()
    assert sorted(read_lines(tmp_path / "run.log")) == sorted(
        ("WARNING", f"task {i}") for i in range(40)
    )


@pytest.mark.skipif(
    not Path("/dev/full").exists(), reason="no /dev/full, a device that is always full"
)
def test_a_full_disk_ends_the_log_and_not_the_work(tmp_path, capsys):
    log.start(file=Path("/dev/full"))
    for number in range(3):
        log.LOGGER.warning("warning %d", number)
    output = capsys.readouterr().err.splitlines()
    full = (
        "hiproof: expected to write the log to /dev/full, got: No space left on device; the work "
        "goes on without the log"
    )
    assert sorted(output) == sorted([full, *(f"hiproof: warning {number}" for number in range(3))])
    log.start(file=tmp_path / "run.log")
    log.LOGGER.warning("kept")
    assert read_lines(tmp_path / "run.log") == [("WARNING", "kept")]
