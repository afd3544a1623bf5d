"""Laws of the pieces of a city run: tiles own each building once, the ledger keeps what is done, dead workers end nothing."""

import os
import signal

import numpy as np
import pytest
import shapely

from hiproof.city.executors import InProcess, Processes, WorkerLost
from hiproof.city.ledger import Ledger
from hiproof.city.plan import Job, cut_into_tiles, neighbourhood
from hiproof.city.sort import in_any_box, lowest_in_cells


def jobs_at(xy):
    return tuple(Job(i, str(i), shapely.box(x, y, x + 8, y + 8), None) for i, (x, y) in enumerate(xy))


@pytest.mark.parametrize("most", [1, 3, 1000])
def test_each_building_is_owned_by_one_tile(most):
    jobs = jobs_at(np.random.default_rng(0).uniform(-500, 500, (60, 2)))
    tiles = cut_into_tiles(jobs, 250.0, most)
    owned = sorted(i for members in tiles.values() for i in members)
    assert owned == list(range(60))
    assert max(len(members) for members in tiles.values()) <= most


def test_a_building_without_area_is_still_owned():
    jobs = (Job(0, "empty", shapely.Polygon(), None),)
    assert list(cut_into_tiles(jobs, 250.0, 100).values()) == [(0,)]


def test_points_in_boxes_equal_the_plain_test():
    rng = np.random.default_rng(1)
    xy = rng.uniform(-20, 60, (2000, 2))
    boxes = np.array([neighbourhood(job, 3.0) for job in jobs_at(rng.uniform(0, 40, (5, 2)))])
    plain = np.array([any((p >= b[:2]).all() and (p < b[2:]).all() for b in boxes) for p in xy])
    assert np.array_equal(in_any_box(xy, boxes), plain)


def test_lowest_points_do_not_depend_on_how_they_are_cut():
    rng = np.random.default_rng(2)
    points = rng.uniform(-5, 5, (500, 3))
    whole = lowest_in_cells(points)
    pieces = lowest_in_cells(
        np.concatenate([lowest_in_cells(part) for part in np.array_split(rng.permutation(points), 7)])
    )
    assert np.array_equal(whole, pieces)
    cells = {}
    for x, y, z in points:
        cell = (np.floor(x) + 0.5, np.floor(y) + 0.5)
        cells[cell] = min(z, cells.get(cell, np.inf))
    assert {(x, y) for x, y, _ in whole} == set(cells)
    assert all(abs(cells[x, y] - z) < 1e-4 for x, y, z in whole)


def test_the_ledger_remembers_after_being_closed(tmp_path):
    path = tmp_path / "ledger.sqlite"
    ledger = Ledger(path)
    ledger.add_tasks([("solve:a", "solve", 0, 2), ("solve:b", "solve", 1, 1)])
    ledger.finish("solve:a", "done", "", [(0, "x", "modelled", "gable", "", 0.9, 0.05, 0.01)])
    ledger.close()
    again = Ledger(path)
    again.add_tasks([("solve:a", "solve", 0, 2)])
    assert again.open_tasks("solve") == ["solve:b"]
    assert again.counts("status") == {"modelled": 1}
    reader = Ledger(path, read_only=True)
    assert reader.counts("type") == {"gable": 1}


def double(x):
    if x == 3:
        raise ValueError("three")
    return 2 * x


def die_on_two(x):
    if x == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


@pytest.mark.parametrize("executor", [InProcess(), Processes(2)], ids=["in process", "processes"])
def test_executors_return_every_task_with_result_or_error(executor):
    got = {task[0]: (result, type(error)) for task, result, error in executor.run(double, [(i,) for i in range(6)])}
    executor.close()
    assert got == {i: ((None, ValueError) if i == 3 else (2 * i, type(None))) for i in range(6)}


def test_a_killed_worker_loses_its_tasks_but_not_the_others():
    executor = Processes(2)
    seen, lost = set(), set()
    tasks = [(i,) for i in range(6)]
    while tasks:
        again = []
        for task, result, error in executor.run(die_on_two, tasks):
            if error is None:
                seen.add(result)
            else:
                assert isinstance(error, WorkerLost)
                lost.add(task[0])
                again += [task] if task[0] != 2 else []
        tasks = again
    executor.close()
    assert seen == {0, 1, 3, 4, 5}
    assert 2 in lost
