"""What a damaged point file is answered with: one sentence that names it and says what is wrong."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import planted
from fuzz.damaged_clouds import damaged_clouds, read_field, sound_clouds
from hiproof.city import run as city_run
from hiproof.city.run import Request, reconstruct_area
from hiproof.errors import InputError
from hiproof.read.points.pointcloud import iter_points, read_header
from run_records import records
from tiny_town import make_town, write_town

QUICK = settings(
    max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), database=None
)


def read(path):
    """The points and classes of the file, or the one sentence that it is answered with."""
    try:
        read_header(path)
        clouds = list(iter_points(path))
    except InputError as error:
        return str(error)
    return np.concatenate([cloud.xyz for cloud in clouds]), np.concatenate(
        [cloud.classification for cloud in clouds]
    )


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return damaged_clouds(tmp_path_factory.mktemp("clouds"))


class Sound:
    """A sound file of the town: its content, what it holds, and a path for changed copies."""

    def __init__(self, path, raw):
        self.path, self.raw = path, raw
        self.xyz, self.classes = self.answer(raw)

    def answer(self, raw):
        self.path.unlink(missing_ok=True)
        self.path.write_bytes(raw)
        return read(self.path)


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sound")
    return {
        name: Sound(folder / f"changed{ending}", raw)
        for name, (ending, raw) in sound_clouds(folder).items()
    }


def test_every_damaged_cloud_is_named_with_what_is_wrong(corpus):
    answers = {case.name: (case, read(case.path)) for case in corpus}
    silent = [name for name, (_, answer) in answers.items() if not isinstance(answer, str)]
    assert not silent
    unclear = {
        name: answer
        for name, (case, answer) in answers.items()
        if not (
            answer.startswith("expected")
            and str(case.path) in answer
            and re.search(case.sentence, answer)
        )
    }
    assert not unclear


def test_sound_clouds_are_read(sound):
    for file in sound.values():
        assert len(file.xyz) == len(file.classes) == 7200


@pytest.mark.parametrize("name", ["las 1.2", "las 1.4", "laz 1.2", "laz 1.4", "copc"])
@QUICK
@given(data=st.data())
def test_a_changed_byte_before_the_points_is_noticed_or_changes_nothing(name, sound, data):
    file = sound[name]
    place = data.draw(st.integers(0, int(read_field(file.raw, "data start")) - 1))
    changed = bytearray(file.raw)
    changed[place] ^= data.draw(st.integers(1, 255))
    answer = file.answer(bytes(changed))
    if isinstance(answer, str):
        assert answer.startswith("expected") and "got" in answer
        return
    assert abs(answer[0] - file.xyz).max() < 1.0  # as far as bounds are held against points
    assert (answer[1] == file.classes).all()


@pytest.mark.parametrize("with_footprints", [True, False], ids=["with footprints", "without"])
def test_damaged_clouds_are_named_and_harm_no_building(
    with_footprints, corpus, tmp_path, monkeypatch
):
    """Every fifth of them: what is said of each is checked above."""
    if with_footprints:
        monkeypatch.setattr(city_run, "solve_tile", planted.solve_quickly)
    cloud, footprints = map(str, write_town(tmp_path, make_town(2, 3.0)))
    footprints = footprints if with_footprints else None
    damaged = {str(case.path): case.sentence for case in corpus[::5]}
    single_run = reconstruct_area(Request((cloud,), tmp_path / "alone", footprints))
    summary = reconstruct_area(Request((cloud, *damaged), tmp_path / "together", footprints))
    assert single_run.exit_code == 0 and summary.exit_code == 2
    reasons = dict(summary.broken_inputs)
    assert reasons.keys() == damaged.keys()
    assert all(re.search(sentence, reasons[path]) for path, sentence in damaged.items())
    assert records(tmp_path / "together") == records(tmp_path / "alone")


def test_a_run_of_damaged_clouds_alone_is_refused(corpus, tmp_path):
    _, footprints = write_town(tmp_path, make_town(2, 3.0))
    paths = [str(case.path) for case in corpus[:3]]
    with pytest.raises(InputError, match="expected"):
        reconstruct_area(Request(tuple(paths), tmp_path / "out", str(footprints)))
