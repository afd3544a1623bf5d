"""A run whose footprints changed redoes what changed and nothing else, and gives what a run from
the start gives.
"""

import dataclasses
import itertools
import shutil
from contextlib import contextmanager, suppress

import numpy as np
import pytest
import shapely

from hiproof.city import run as city_run
from hiproof.city.folder import resume
from hiproof.city.folder.ledger import Ledger
from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.city.work import solve
from hiproof.settings import Settings
from hiproof.write import files
from run_records import records
from tiny_town import make_town, write_footprints


@pytest.fixture
def town(town_files, tmp_path, solved_ids, quick_tiles):
    """The houses, their cloud, and a way to write and run another set of them."""
    houses, path = make_town().footprints, tmp_path / "footprints.geojson"
    request = Request((town_files[0],), tmp_path / "out", str(path))

    def run(footprints, **changes):
        path.unlink(missing_ok=True)
        write_footprints(path, footprints)
        return reconstruct_area(dataclasses.replace(request, **changes))

    return houses, request, run


@pytest.fixture
def finished_town(town):
    """The same, and a run over it."""
    town[2](town[0])
    return town


def move(polygon, shift):
    return shapely.transform(polygon, lambda xy: xy + shift)


def changes(houses):
    """Name: (footprints, ids of those that have to be done)."""
    first, second, *_ = houses
    distant_house = move(houses["house-0"], (0.0, 600.0))
    return {
        "the same again": (houses, []),
        "one is gone": ({id: houses[id] for id in list(houses)[1:]}, []),
        "one moved": ({**houses, second: move(houses[second], (0.3, 0.0))}, [second]),
        "one is new, far away": ({**houses, "new": distant_house}, ["new"]),
        "another order": (dict(reversed(houses.items())), []),
        "two swap their names": (
            {**houses, first: houses[second], second: houses[first]},
            [first, second],
        ),
        "all are others": (
            {f"{id}x": polygon for id, polygon in houses.items()},
            [f"{id}x" for id in houses],
        ),
    }


@pytest.mark.parametrize("name", changes(make_town().footprints))
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_changed_footprints_redo_what_changed_and_end_as_a_run_from_the_start(
    name, finished_town, solved_ids, tmp_path
):
    houses, request, run = finished_town
    footprints, expected = changes(houses)[name]
    solved_ids.clear()
    assert run(footprints).buildings == len(footprints)
    assert sorted(solved_ids) == sorted(expected)
    new_request = dataclasses.replace(request, out=tmp_path / "fresh")
    reconstruct_area(new_request)
    assert records(request.out) == records(new_request.out)
    solved_ids.clear()
    reconstruct_area(request)
    assert solved_ids == []


def test_another_choice_of_footprints_redoes_none(finished_town, solved_ids):
    houses, _, run = finished_town
    solved_ids.clear()
    assert run(houses, where="id < 'house-2'").buildings == 2
    assert run(houses, bbox=houses["house-3"].bounds).buildings == 1
    assert solved_ids == ["house-3"]  # the condition had let it go


def test_a_run_killed_while_it_does_what_changed_goes_on(finished_town, solved_ids, monkeypatch):
    houses, request, run = finished_town
    changed = {**houses, "house-1": move(houses["house-1"], (0.3, 0.0))}
    with monkeypatch.context() as patch:
        patch.setattr(city_run, "solve_tile", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            run(changed)
    solved_ids.clear()
    assert reconstruct_area(request).buildings == 4 and solved_ids == ["house-1"]


class Killed(BaseException):
    """The main process is killed."""


@contextmanager
def killed_at(step, monkeypatch):
    """Kill the run at its step of that number: a transaction or a file, begun or just done."""
    steps = itertools.count()

    def count():
        if next(steps) == step:
            raise Killed

    def slow(original):
        @contextmanager
        def wrap(*args, **options):
            count()
            with original(*args, **options) as value:
                yield value
                count()
            count()

        return wrap

    with monkeypatch.context() as patch:
        patch.setattr(Ledger, "transact", slow(Ledger.transact))
        patch.setattr(resume, "atomic", slow(resume.atomic))
        patch.setattr(files, "atomic", slow(files.atomic))
        patch.setattr(solve, "atomic_file", slow(solve.atomic_file))
        yield


@pytest.fixture(scope="module")
def made_once(tmp_path_factory):
    """The folder of a run over the houses, and one over two that swapped their names, once made."""
    folder = tmp_path_factory.mktemp("once")
    return folder / "tiles", folder / "swapped"


def read_all(out):
    return records(out) | {file.name: file.read_bytes() for file in (out / "models").iterdir()}


@pytest.mark.parametrize("step", range(20))
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_run_killed_at_any_step_of_a_change_ends_as_one_from_the_start(
    step, town, made_once, tmp_path, monkeypatch
):
    """With or without a way back to the first footprints before the run goes on."""
    houses, request, run = town
    first, second, *_ = houses
    swapped = {**houses, first: houses[second], second: houses[first]}
    settings = Settings.from_dict({"city": {"models": "both"}})
    request = dataclasses.replace(request, out=tmp_path / "tiles", settings=settings)
    first_run, swapped_run = made_once
    if not first_run.exists():
        run(houses, out=first_run, settings=settings)
        run(swapped, out=swapped_run, settings=settings)
    shutil.copytree(first_run, request.out)
    for footprints in (swapped, houses, swapped):
        with killed_at(step, monkeypatch), suppress(Killed):
            run(footprints, out=request.out, settings=settings)
    reconstruct_area(request)
    assert read_all(request.out) == read_all(swapped_run)


def test_models_by_work_tile_follow_changed_footprints(town, solved_ids, tmp_path):
    houses, _, run = town
    by_tile = Settings.from_dict({"city": {"models": "both"}})
    out = tmp_path / "tiles"
    run(houses, out=out, settings=by_tile)
    run({id: houses[id] for id in list(houses)[:2]}, out=out, settings=by_tile)
    texts = [file.read_text() for file in sorted((out / "models").glob("*.jsonl"))]
    assert sum(text.count('"CityJSONFeature"') for text in texts) == 2
    assert np.unique(solved_ids).size == 4
