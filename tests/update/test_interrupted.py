"""An update that is interrupted goes on, and gives the bytes of one that never was."""

from functools import partial

import pytest

from hiproof.update import before
from hiproof.update import run as update_run
from hiproof.update.run import update_area
from hiproof.update.solve import update_tile
from run_records import RECORDS
from tiny_town import make_town
from tiny_updates import make_request

FILES = (*RECORDS, "buildings.gpkg", "changes.csv", "changes.gpkg")


@pytest.fixture(autouse=True)
def small_tiles(monkeypatch):
    monkeypatch.setattr("hiproof.update.plan.limit_buildings_per_tile", lambda _: 1)


@pytest.fixture(scope="module")
def make_update(town_run, tmp_path_factory):
    later = make_town(seed=7)
    later.xyz[later.classification == 6, 2] += 1.5
    cloud = later.write(tmp_path_factory.mktemp("update") / "later.laz")
    return partial(make_request, town_run, cloud)


@pytest.fixture(scope="module")
def whole(make_update, tmp_path_factory):
    out = tmp_path_factory.mktemp("whole")
    update_area(make_update(out))
    return read_files(out)


def read_files(out):
    return {name: (out / name).read_bytes() for name in FILES}


def stop(*_):
    raise KeyboardInterrupt


def stop_at(count):
    """The task that is interrupted when it comes to its work tile of that number."""
    done = []

    def solve(*arguments):
        done.append(arguments)
        return update_tile(*arguments) if len(done) < count else stop()

    return solve


def test_an_update_stopped_between_tiles_goes_on(make_update, whole, tmp_path, monkeypatch):
    for count in (1, 3):
        monkeypatch.setattr(update_run, "update_tile", stop_at(count))
        with pytest.raises(KeyboardInterrupt):
            update_area(make_update(tmp_path))
    monkeypatch.setattr(update_run, "update_tile", update_tile)
    update_area(make_update(tmp_path))
    assert read_files(tmp_path) == whole


STEPS = [(before, name) for name in ("sort_earlier", "save_roofs_outside", "register_surveys")]
STEPS += [(update_run, "write_changes")]


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step[1])
def test_an_update_stopped_before_or_after_its_tiles_goes_on(
    step, make_update, whole, tmp_path, monkeypatch
):
    with monkeypatch.context() as patch:
        patch.setattr(*step, stop)
        with pytest.raises(KeyboardInterrupt):
            update_area(make_update(tmp_path))
    update_area(make_update(tmp_path))
    assert read_files(tmp_path) == whole
    assert not (tmp_path / ".hiproof" / "earlier").exists()
