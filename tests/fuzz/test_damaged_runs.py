"""Whatever is wrong in a finished run, its readers say so in a sentence."""

import shutil

import pytest

from fuzz.damaged_runs import FILES, READERS, find_fault, find_faults, write_sound_run
from hiproof.log import LOGGER

COUNT = 40  # damaged runs, each read by one reader


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return write_sound_run(tmp_path_factory.mktemp("sound"))


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
def test_every_reader_reads_the_sound_run(reader, sound, tmp_path):
    assert find_fault(READERS[reader][0], shutil.copytree(sound, tmp_path / "run")) == ""


@pytest.mark.parametrize(
    ("reader", "file", "sound_value", "damaged_value"),
    [
        ("convert a file", 0, '"type":"RoofSurface"', '"type":"gable"'),
        ("edit", 1, '"status":"no_points","quality":null,"detail":"', None),
        ("edit", 1, '"quality":null', '"quality":[]'),
    ],
)
def test_a_value_of_another_kind_is_answered_with_a_sentence(
    reader, file, sound_value, damaged_value, sound, tmp_path
):
    run = shutil.copytree(sound, tmp_path / "run")
    path = run / FILES[file]
    text = path.read_text(encoding="utf-8")
    assert sound_value in text
    if damaged_value is None:  # the text that follows becomes an infinite number
        start = text.index(sound_value)
        stop = text.index('"', start + len(sound_value))
        before, after = text[: start + len(sound_value) - 1], text[stop + 1 :]
        path.write_text(f"{before}Infinity{after}", encoding="utf-8")
    else:
        path.write_text(text.replace(sound_value, damaged_value), encoding="utf-8")
    assert find_fault(READERS[reader][0], run) == ""


def test_damaged_runs_are_answered_with_a_sentence(sound, tmp_path):
    level = LOGGER.level
    try:
        assert list(find_faults(sound, tmp_path / "work", COUNT, 0, readers=1)) == []
    finally:
        LOGGER.setLevel(level)
