"""The command line itself: groups, help, examples, completion, progress, `--quiet` and `--json`."""

import json
import re
import shlex
import time

import numpy as np
import pytest
from click.testing import CliRunner

from hiproof import progress
from hiproof.cli.app import app, import_command
from hiproof.cli.command import choose_level
from hiproof.cli.parameters import COMMANDS
from hiproof.compiled import news
from hiproof.errors import SettingsError
from hiproof.log import Level, start
from hiproof.progress import show_progress
from programs import run_python
from sample_models import sample_points, write_sample_run

GROUPS = ["Reconstruct", "Inspect", "Edit", "Export", "Network"]
COMMAND_LINE = {name: import_command(name) for name in app.commands}


def invoke(*arguments, **options):
    return CliRunner().invoke(app, arguments, prog_name="hiproof", **options)


def list_options(text):
    return {word for word in text.split() if word.startswith("--")}


def test_commands_stand_in_groups():
    lines = [line for line in invoke("--help").output.splitlines() if line.endswith(":")]
    assert lines == [f"{group}:" for group in GROUPS] + ["Options:", "Example:"]


def test_the_help_imports_no_package_that_computes():
    code = (
        "import sys; from hiproof.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print([m for m in ('numpy', 'shapely', 'rich', 'numba') if m in sys.modules])"
    )
    assert run_python(code, "--help").splitlines()[-1] == "[]"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_ends_with_an_example_that_can_be_run(name):
    example = COMMANDS[name]["example"]
    program, command, *arguments = shlex.split(example.partition(" > ")[0])
    assert (program, command) == ("hiproof", name)
    text = invoke(name, "--help", env={"COLUMNS": "200"}).output.rstrip()
    assert text.endswith(f"Example:\n  {example}")
    COMMAND_LINE[name].make_context(name, arguments)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_holds_every_word_of_its_texts(name):
    """Brackets, backticks and stars are text, and nothing is cut to fit a column."""
    flag = "--help-all" if "first" in COMMANDS[name] else "--help"
    shown = "".join(invoke(name, flag, env={"COLUMNS": "80"}).output.split())
    command = COMMAND_LINE[name]
    texts = [command.help, *(param.help for param in command.params)]
    assert all(texts)
    assert [text for text in texts if "".join(text.split()) not in shown] == []


def test_commands_show_that_they_work_before_they_import_what_computes():
    code = """
import sys, hiproof.cli.app as app
for name in app.COMMANDS:
    app.import_command(name)
    print(name, *{"numpy", "shapely", "numba", "pyproj"} & set(sys.modules))
"""
    assert run_python(code).splitlines() == list(COMMANDS)


@pytest.mark.parametrize("name", ["reconstruct", "update", "enrich", "build"])
def test_a_long_command_explains_few_options_and_has_a_line_a_group_of_the_others(name):
    parameters, first = COMMAND_LINE[name].params, COMMANDS[name]["first"]
    brief, every = (
        invoke(name, flag, env={"COLUMNS": "200"}).output for flag in ("--help", "--help-all")
    )
    options = {"--" + option.replace("_", "-") for option in first}
    assert len(options - {"--help-all"}) <= 10
    assert set(re.findall(r"^  (--[\w-]+)", brief, re.MULTILINE)) - {"--help"} == options
    names = {param.opts[0] for param in parameters if param.opts[0].startswith("--")}
    assert names <= list_options(every)
    text = brief.partition("explained by --help-all:\n")[2].partition("\n\n")[0]
    headings = {getattr(param, "heading", "") for param in parameters if param.name not in first}
    subjects = {h.removeprefix("Settings: ") for h in headings if h.startswith("Settings: ")}
    more = {COMMANDS[name]["more"]} if "more" in COMMANDS[name] else set()
    assert {line.strip() for line in text.splitlines()} == subjects | more
    assert max(map(len, text.splitlines())) <= 80


def test_a_shell_completes_commands_and_options():
    def complete(words):
        environment = {"_HIPROOF_COMPLETE": "bash_complete", "COMP_WORDS": words}
        environment["COMP_CWORD"] = str(words.count(" "))
        return invoke(env=environment).output.split()

    assert sorted(complete("hiproof rep")) == ["plain,report", "plain,repro"]
    assert complete("hiproof reconstruct --building") == ["plain,--building-class"]


def test_quiet_and_verbose_choose_what_is_shown():
    assert choose_level(True, False) is Level.error
    assert choose_level(False, True) is Level.debug
    assert choose_level(False, False) is Level.warning
    with pytest.raises(SettingsError, match="got both"):
        choose_level(True, True)


@pytest.fixture
def show_stages(monkeypatch, capsys):
    """Lines on standard error of the stages that a function goes through, without a wait."""
    monkeypatch.setattr(progress, "FIRST_S", 0.0)

    def show(work, level=Level.warning):
        start(level)
        with show_progress("plan") as update:
            time.sleep(0.05)
            work(update)
        return capsys.readouterr().err.splitlines()

    return show


def test_a_line_says_when_a_stage_begins(show_stages):
    def work(update):
        for stage, total in (("sort", 2), ("solve", 1000)):
            for finished in range(3):
                update(stage, finished, total)

    assert show_stages(work) == [
        "hiproof: reading inputs",
        "hiproof: sorting points by building: 2 files",
        "hiproof: fitting roofs: 1,000 buildings",
    ]


def test_a_line_says_how_far_a_long_stage_is(show_stages, monkeypatch):
    monkeypatch.setattr(progress, "LINE_S", 0.02)

    def work(update):
        update("solve", 0, 100)
        update("solve", 25, 100)
        time.sleep(0.2)

    assert "hiproof: fitting roofs: 25 of 100 buildings" in show_stages(work)


def test_compiling_is_shown_in_place_of_the_stage_that_waits_for_it(show_stages):
    def work(update):
        news.listener(3, 10)
        news.listener(5, 10)
        update("sort", 0, 2)

    assert show_stages(work) == [
        "hiproof: reading inputs",
        "hiproof: compiling for this machine, once for each version: up to 7 functions, about 10 s",
        "hiproof: sorting points by building: 2 files",
    ]
    assert "compiling" not in "".join(show_stages(lambda update: None))


def test_quiet_shows_nothing(show_stages):
    assert show_stages(lambda update: update("solve", 1, 2), Level.error) == []


def test_a_command_that_ends_at_once_shows_no_progress(capsys):
    start()
    with show_progress("plan") as update:
        update("solve", 0, 10)
    assert capsys.readouterr().err == ""


def test_check_and_evaluate_print_json(tmp_path):
    """A gable and a block with a courtyard, measured on points drawn from themselves."""
    write_sample_run(tmp_path)
    points = str(tmp_path / "points.xyz")
    np.savetxt(points, sample_points())
    checked = json.loads(invoke("check", str(tmp_path / "buildings.city.jsonl"), "--json").stdout)
    assert checked["valid"]
    assert [(file["solids"], file["invalid"]) for file in checked["files"]] == [(2, 0)]
    figures = json.loads(invoke("evaluate", str(tmp_path), points, "--json").stdout)
    assert figures["gable"]["buildings"] == 1
    assert figures["all"]["share_within_20cm"]["median"] > 0.99
