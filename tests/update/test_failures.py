"""A building that fails in an update, or in a run of several surveys, stops no other."""

import logging

import pytest

from hiproof.city.request import Request
from hiproof.city.work.repro import solve_bundle
from hiproof.errors import DamagedRaster
from hiproof.parametric.building import build
from hiproof.update import best, several, solve
from hiproof.update.request import WHOLE_CITY
from hiproof.update.run import update_area
from run_records import by_id
from tiny_town import make_town
from tiny_updates import make_request

FAILING = "house-1"


@pytest.fixture(scope="module")
def later(tmp_path_factory):
    return make_town(seed=7).write(tmp_path_factory.mktemp("later") / "later.laz")


def update(run, later, out, **options):
    update_area(make_request(run, later, out, **options))


def take_surveys(town_files, later, out):
    clouds, epochs = (later, town_files[0]), ("2020", "2014")
    several.reconstruct_epochs(Request(clouds, out, town_files[1], epochs=epochs))


def raise_for(patch, owner, name, error):
    """Let the function `name` raise the error where its job is the house that fails."""
    original = getattr(owner, name)

    def raising(*arguments):
        if any(getattr(argument, "id", None) == FAILING for argument in arguments):
            raise error
        return original(*arguments)

    patch.setattr(owner, name, raising)


@pytest.mark.parametrize("over", ["buildings", WHOLE_CITY])
def test_a_building_that_fails_in_an_update_stops_no_other(
    town_run, later, over, tmp_path, monkeypatch
):
    update(town_run, later, tmp_path / "whole", significance_over=over)
    expected = by_id(tmp_path / "whole")
    raise_for(monkeypatch, solve.Updater, "judge", KeyError("no such wall"))
    check_failure(
        expected,
        tmp_path,
        lambda out: update(town_run, later, out, significance_over=over),
        monkeypatch,
    )


def test_a_building_that_fails_in_a_run_of_several_surveys_stops_no_other(
    town_files, later, tmp_path, monkeypatch
):
    take_surveys(town_files, later, tmp_path / "whole")
    expected = by_id(tmp_path / "whole")
    raise_for(monkeypatch, best, "is_same", KeyError("no such wall"))
    check_failure(expected, tmp_path, lambda out: take_surveys(town_files, later, out), monkeypatch)


def check_failure(expected, folder, work, monkeypatch):
    """Check that one building fails, with its trace in the log, and the others are as expected."""
    messages = []
    monkeypatch.setattr(
        logging.getLogger("hiproof"), "info", lambda *a: messages.append(a[0] % a[1:])
    )
    work(folder / "out")
    rows = by_id(folder / "out")
    failed = rows.pop(FAILING)
    assert failed["status"] == "internal_error" and "no such wall" in failed["detail"]
    assert rows == {id: row for id, row in expected.items() if id != FAILING}
    (trace,) = (text for text in messages if text.startswith(f"building {FAILING} failed"))
    assert "Traceback" in trace and "raise error" in trace
    monkeypatch.undo()
    building, _ = solve_bundle(folder / "out" / "failures" / FAILING, folder / "again")
    volume = build(expected[FAILING]).solid.volume
    assert building.solid.volume == pytest.approx(volume, rel=0.01)


def test_a_damaged_terrain_model_ends_both_with_its_sentence(
    town_run, town_files, later, tmp_path, monkeypatch
):
    damaged = DamagedRaster("expected a complete raster at dtm.tif, got: a hole; copy it again")
    raise_for(monkeypatch, solve.Updater, "judge", damaged)
    with pytest.raises(DamagedRaster, match="expected a complete raster"):
        update(town_run, later, tmp_path / "updated")
    raise_for(monkeypatch, best, "is_same", damaged)
    with pytest.raises(DamagedRaster, match="expected a complete raster"):
        take_surveys(town_files, later, tmp_path / "several")
