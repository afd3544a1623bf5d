"""Whatever is wrong in a finished run, its readers say so in a sentence."""

import shutil

import pytest

from fuzz.damaged_runs import READERS, find_fault, find_faults, write_sound_run
from hiproof.log import LOGGER

COUNT = 70  # damaged runs, each read by one reader; `python -m fuzz.damaged_runs` tries more


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return write_sound_run(tmp_path_factory.mktemp("sound"))


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
def test_every_reader_reads_the_sound_run(reader, sound, tmp_path):
    assert find_fault(READERS[reader][0], shutil.copytree(sound, tmp_path / "run")) == ""


def test_damaged_runs_are_answered_with_a_sentence(sound, tmp_path):
    level = LOGGER.level
    try:
        assert list(find_faults(sound, tmp_path / "work", COUNT, 0, readers=1)) == []
    finally:
        LOGGER.setLevel(level)
