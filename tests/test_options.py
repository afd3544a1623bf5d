"""Options are checked before anything runs: each configuration gets one sentence and exit code 2,
or the run begins.
"""

import dataclasses
import warnings

import pytest

from hiproof import log
from hiproof.city.plan.checks import refuse_unusable
from hiproof.city.run import Summary
from hiproof.errors import InputWarning
from hiproof.evaluate.overview import Overview
from hiproof.settings import Settings
from programs import run_hiproof

RUNS = None
HUGE = "9" * 5000

# name: (TOML, further options, part of the sentence or RUNS)
CONFIGURATIONS = {
    "nothing": ("", [], RUNS),
    "every default": ("{defaults}", [], RUNS),
    "two classes": ("[read]\nbuilding_classes = [6, 67]", [], RUNS),
    "one class": ("[read]\nbuilding_classes = 6", [], RUNS),
    "class 0 and 255": ("[read]\nbuilding_classes = [0, 255]\nground_classes = []", [], RUNS),
    "class 256": ("[read]\nbuilding_classes = [256]", [], "between 0 and 255, got 256"),
    "class -1": ("[read]\nground_classes = [-1]", [], "between 0 and 255, got -1"),
    "class 999": ("", ["--building-class", "999"], "between 0 and 255, got 999"),
    "ground class 999": ("", ["--ground-class", "999"], "read.ground_classes between 0 and 255"),
    "class of 5,000 digits": ("", ["--building-class", HUGE], "Invalid value"),
    "class with a point": ("", ["--building-class", "6.5"], "Invalid value"),
    "no class": ("[read]\nbuilding_classes = []", [], "1 or more values, got none"),
    "class of text": ('[read]\nbuilding_classes = ["6"]', [], "a whole number, got '6'"),
    "class of a float": ("[read]\nbuilding_classes = [6.0]", [], "a whole number, got 6.0"),
    "class of a boolean": ("[read]\nbuilding_classes = [true]", [], "a whole number, got True"),
    "class of infinity": ("[read]\nbuilding_classes = [inf]", [], "a whole number, got inf"),
    "class of a table": ("[read]\nbuilding_classes = [{{a = "
                         "1}}]", [], "a whole number, got a dict of 1"),
    "class of a list": ("[read]\nbuilding_classes = [[6]]", [], "a whole number, got a list of 1"),
    "class of a date": ("[read]\nbuilding_classes = [2020-01-01]", [], "a whole number"),
    "number of 5,000 "
    "digits": (f"[read]\nsplit_min_points = {HUGE}", [], "expected a TOML settings file"),
    "hexadecimal of 5,000 "
    "digits": (f"[read]\nbuilding_classes = [0x{HUGE}]", [], "more than 15 digits"),
    "number of text": ('[read]\nsplit_min_points = "30"', [], "a whole number, got '30'"),
    "infinite whole number": ("[read]\nsplit_min_points = inf", [], "a whole number, got inf"),
    "whole number as a "
    "boolean": ("[city]\nmax_points_a_building = true", [], "a whole number, got True"),
    "infinite length": ("[compose]\nsnap_m = inf", [], "between 0.001 and 0.05 m, got inf"),
    "length that is no "
    "number": ("[compose]\nsnap_m = nan", [], "between 0.001 and 0.05 m, got nan"),
    "negative length": ("[compose]\nsnap_m = -0.01", [], "between 0.001 and 0.05 m, got -0.01"),
    "length of text": ('[compose]\nsnap_m = "0.01"', [], "a number, got '0.01'"),
    "length of a boolean": ("[compound]\ntolerance_m = true", [], "a number, got True"),
    "length of a list": ("[compound]\ntolerance_m = [0.2]", [], "a number, got a list of 1"),
    "whole length": ("[read]\nsplit_gap_m = 2", [], RUNS),
    "softness below "
    "zero": ("[fit]\nside_softness_m = [-1.0]", [], "between 0.001 and 1.0 m, got -1.0"),
    "softness no "
    "number": ("[fit]\nside_softness_m = [nan]", [], "between 0.001 and 1.0 m, got nan"),
    "softness of text": ('[fit]\nside_softness_m = ["a"]', [], "a number, got 'a'"),
    "softness of all kinds": ('[fit]\nside_softness_m = [-1, nan, "a"]', [], "got -1"),
    "no softness": ("[fit]\nside_softness_m = []", [], "1 or more values"),
    "points below the "
    "least": ("[city]\nmax_points_a_building = 10", [], "between 1000 and 10000000"),
    "boolean of a number": ("[write]\nparquet = 1", [], "true or false, got 1"),
    "boolean of text": ('[write]\nparquet = "yes"', [], "true or false, got 'yes'"),
    "text of a number": ("[read]\ncrs = 28992", [], "to be text, got 28992"),
    "unknown section": ("[reading]\na = 1", [], "[reading]"),
    "unknown setting": ("[read]\nclasses = [6]", [], "got 'classes'"),
    "a section that is none": ("read = 3", [], "got read = 3;"),
    "no TOML": ("read = [", [], "expected a TOML settings file"),
    "unknown choice": ('[fit]\nobjective = "pretty"', [], "likelihood, paper, got 'pretty'"),
    "unknown choice of an option": ("", ["--detail", "most"], "fine, full, main, got 'most'"),
    "unknown models": ("", ["--models", "none"], "merged, tiles, both, got 'none'"),
    "very long choice": ("", ["--parts", "x" * 5000], "xxx..."),
    "types": ("", ["--types", "gable, hip"], RUNS),
    "types misspelt": ("", ["--types", "Gable,hipp"], "'Gable' (did you mean gable?), 'hipp' (did "
                                                      "you mean hip?)"),
    "types of another kind": ("", ["--types", "igloo"], "got 'igloo'"),
    "types with a comma too many": ("", ["--types", "gable,"], "got ''"),
    "types of numbers": ("[fit]\ntypes = [1]", [], "to be text, got 1"),
    "types misspelt in the file": ('[fit]\ntypes = ["half-hip"]', [], "did you mean half_hip?"),
    "weights that are "
    "missing": ('[segment]\nweights = "missing.onnx"', [], "weights at missing.onnx"),
    "weights that are no "
    "network": ('[segment]\nweights = "{cloud}"', [], "expected an ONNX network"),
    "missing weights nobody asks "
    "for": ('[segment]\nweights = "missing.onnx"', ["--network", "never"], RUNS),
    "no CUDA": ('[segment]\ndevice = "cuda"', [], "expected a CUDA device"),
    "CRS in degrees": ('[read]\ncrs = "EPSG:4326"', [], "projected CRS, got WGS 84 in degrees"),
    "CRS in degrees as an "
    "option": ("", ["--crs", "EPSG:4326"], "projected CRS, got WGS 84 in degrees"),
    "CRS of heights": ("", ["--crs", "EPSG:5709"], RUNS),
    "CRS that nobody knows": ("", ["--crs", "EPSG:99999999"], 'such as "EPSG:7415"'),
    "CRS that is noise": ("", ["--crs", "\x01 {{}}"], 'such as "EPSG:7415"'),
    "CRS": ("", ["--crs", "EPSG:7415"], RUNS),
    "CRS in feet": ("", ["--crs", "EPSG:2263+6360", "--unit", "us-survey-foot"], RUNS),
    "unit": ("", ["--unit", "foot"], RUNS),
    "unknown unit": ("", ["--unit", "yard"], "auto, metre, foot, us-survey-foot, got 'yard'"),
    "unit against the "
    "CRS": ("", ["--crs", "EPSG:7415", "--unit", "foot"], "in foot, as --unit says"),
    "no jobs": ("", ["--jobs", "0"], "--jobs between 1 and 1024, got 0"),
    "negative jobs": ("", ["--jobs", "-4"], "--jobs between 1 and 1024, got -4"),
    "10^12 jobs": ("", ["--jobs", "1000000000000"], "--jobs between 1 and 1024"),
    "jobs of 4,000 digits": ("", ["--jobs", "9" * 4000], "more than 15 digits"),
    "id without footprints": ("", ["--id-attribute", "bag"], "footprints with --id-attribute"),
    "layer without footprints": ("", ["--layer", "roofs"], "footprints with --layer"),
    "missing settings": ("", ["--config", "missing.toml"], "missing.toml"),
    "settings that are a folder": ("", ["--config", "."], "expected a TOML settings file"),
}  # fmt: skip


def test_warnings_are_sentences_without_their_place_in_the_source(capsys):
    log.start()
    warnings.warn("a.laz: names no CRS;\n taken as metres", InputWarning)
    assert capsys.readouterr().err == "hiproof: a.laz: names no CRS; taken as metres\n"


@pytest.fixture
def begun(monkeypatch):
    """The requests that pass the checks; the run itself is left out."""
    requests = []

    def check_only(request, progress):
        refuse_unusable(request)
        requests.append(request)
        return Summary((), Overview(0, 0), {}, {}, (), (), {})

    monkeypatch.setattr("hiproof.city.run.reconstruct_area", check_only)
    monkeypatch.setattr("hiproof.progress.FIRST_S", 60.0)  # no line of progress on slow machines
    return requests


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_a_configuration_begins_or_gets_one_sentence(name, begun, town_files, tmp_path, capsys):
    toml, options, expected = CONFIGURATIONS[name]
    config = tmp_path / "settings.toml"
    config.write_text(toml.format(defaults=Settings().to_toml(), cloud=town_files[0]))
    given = [option.replace("{{}}", "{}") for option in options]
    places = ["--out", tmp_path / "out", "--config", config]
    code = run_hiproof("reconstruct", town_files[0], *places, *given)
    output = capsys.readouterr().err
    assert (code, len(begun)) == ((0, 1) if expected is RUNS else (2, 0)), output
    assert "Traceback" not in output
    if expected is not RUNS:
        assert expected in output and len(output) < 1000
        assert output.startswith(("hiproof: expected ", "Usage: "))
    assert not (tmp_path / "out").exists()


ALL = [
    (s.name, f)
    for s in dataclasses.fields(Settings)
    for f in dataclasses.fields(getattr(Settings(), s.name))
]


@pytest.mark.parametrize(("section", "declared"), ALL, ids=[f"{s}.{f.name}" for s, f in ALL])
def test_every_setting_has_help_and_a_default_within_its_own_bounds(section, declared):
    assert declared.metadata["help"]
    default = getattr(getattr(Settings(), section), declared.name)
    assert Settings.from_dict({section: {declared.name: default}}) == Settings()


def test_toml_comes_back_the_same(tmp_path):
    changed = Settings.from_dict(
        {"read": {"building_classes": [6, 67]}, "fit": {"objective": "paper"}}
    )
    path = tmp_path / "settings.toml"
    for encoding in ("utf-8", "utf-8-sig"):  # as editors under Windows write it
        path.write_text(changed.to_toml(), encoding=encoding)
        assert Settings.from_toml(path) == changed
    assert Settings.from_dict(changed.to_dict()) == changed


def test_toml_explains_every_setting():
    text = Settings().to_toml()
    for section, declared in ALL:
        assert f"[{section}]" in text
        assert declared.metadata["help"] in text
