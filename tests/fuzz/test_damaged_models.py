"""What `check`, `convert` and `report` answer to damaged files of a run: a sentence, never a
traceback or a wrong file.
"""

import re
from functools import cache

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fuzz.damaged_models import (
    RECORDS,
    damaged_files,
    damaged_models,
    invalid_models,
    odd_models,
    sound_lines,
)
from hiproof.cli import check
from hiproof.cli.convert import FormatName, convert
from hiproof.cli.report import report
from hiproof.errors import HiproofError
from hiproof.evaluate.models import read_models
from hiproof.read.models.solids import read_solids
from sample_models import SOLIDS, write_sample_run

MODELS = "buildings.city.jsonl"
COMMANDS = {
    "convert to glb": lambda folder: convert(folder, format=FormatName.glb),
    "convert to obj": lambda folder: convert(folder, format=FormatName.obj),
    "report": lambda folder: report(folder),
}
WRITTEN = {
    "convert to glb": "buildings.glb",
    "convert to obj": "buildings.obj",
    "report": "report.html",
}


def answer(command, *arguments):
    """(exit code, what is said) of a command; an exception that is not for the user is raised."""
    try:
        return command(*arguments) or 0, ""
    except HiproofError as error:
        return 2, str(error)


@pytest.fixture
def run_folder(tmp_path):
    write_sample_run(tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    return cache(lambda make: make(tmp_path_factory.mktemp("models")))


@pytest.mark.parametrize("command", COMMANDS)
def test_damaged_files_are_refused_with_a_sentence(command, run_folder, cases):
    for name, content in cases(damaged_files).items():
        (run_folder / MODELS).write_bytes(content)
        code, output = answer(COMMANDS[command], run_folder)
        assert (
            code == 2
            and output.startswith("expected")
            and "got" in output
            and str(run_folder) in output
        ), name
    assert sorted(path.name for path in run_folder.iterdir() if path.suffix != ".mtl") == [
        MODELS,
        "run.json",
    ]


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("make", [damaged_models, invalid_models])
def test_a_damaged_building_is_named_and_the_others_are_used(
    make, command, run_folder, cases, caplog
):
    written = run_folder / WRITTEN[command]
    for name, content in cases(make).items():
        (run_folder / MODELS).write_bytes(content)
        written.unlink(missing_ok=True)
        caplog.clear()
        assert answer(COMMANDS[command], run_folder) == (2, ""), name
        (output,) = caplog.messages
        assert "left out: expected" in output and "got" in output and str(run_folder) in output, (
            name
        )
        assert "house-1" in output or re.search(r"line \d", output), name
        assert re.search(b"block[ _]2", written.read_bytes()), name


def test_a_run_of_damaged_buildings_alone_is_refused(run_folder):
    path = run_folder / MODELS
    path.write_text(path.read_text().replace('"Solid"', '"Solid", "boundaries": 3'))
    path.write_text(re.sub(r'"boundaries": \[\[.*?\]\]\]\]', '"boundaries": 3', path.read_text()))
    for command in COMMANDS.values():
        code, output = answer(command, run_folder)
        assert code == 2, output


def count_bad_solids(path):
    return check.count_bad([check.check_file(path, 0.01)])


def test_damaged_files_cannot_be_checked(run_folder, cases):
    for name, content in cases(damaged_files).items():
        (run_folder / MODELS).write_bytes(content)
        code, output = answer(count_bad_solids, run_folder / MODELS)
        assert code == 2 and output.startswith("expected") and "got" in output, name


@pytest.mark.parametrize(
    ("write", "told"),
    [
        (damaged_models, "1 solid, 1 valid, 0 invalid, 1 damaged building left out"),
        (invalid_models, "2 solids, 1 valid, 1 invalid"),
    ],
)
def test_damaged_buildings_and_solids_that_are_none_are_invalid(
    write, told, run_folder, cases, capsys
):
    for name, content in cases(write).items():
        (run_folder / MODELS).write_bytes(content)
        assert answer(count_bad_solids, run_folder / MODELS)[0] == 1, name
        assert told in capsys.readouterr().out, name


@pytest.mark.parametrize("command", COMMANDS)
def test_unusual_models_are_used(command, run_folder, cases):
    for name, content in cases(odd_models).items():
        (run_folder / MODELS).write_bytes(content)
        assert answer(COMMANDS[command], run_folder)[0] == 0, name


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", RECORDS)
def test_a_damaged_record_is_answered_with_a_sentence_or_does_not_matter(name, command, run_folder):
    (run_folder / "run.json").write_bytes(RECORDS[name])
    code, output = answer(COMMANDS[command], run_folder)
    assert code == (0 if name in ("clouds are numbers", "a path with a zero") else 2)
    assert code == 0 or "expected" in output


@pytest.fixture(scope="module")
def sound_text(tmp_path_factory):
    folder = tmp_path_factory.mktemp("changed")
    sound_lines(folder)
    return folder, (folder / MODELS).read_text()


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), database=None)
@given(data=st.data())
def test_any_change_of_the_text_is_read_or_answered(data, sound_text):
    folder, text = sound_text
    start = data.draw(st.integers(0, len(text) - 1))
    length = data.draw(st.integers(0, 20))
    inserted = data.draw(
        st.sampled_from(["", "null", "-1", "1e999", "[]", "{}", '"', "9" * 400, "0.5", "[[", "NaN"])
    )
    (folder / MODELS).write_text(text[:start] + inserted + text[start + length :])
    for read in (read_models, read_solids):
        try:
            results = list(read(folder / MODELS))
        except HiproofError as error:
            assert str(error).startswith("expected")
        else:
            assert len(results) <= len(SOLIDS) + 1
