"""Laws of the pieces of a city run: tiles own each building once, the ledger keeps what is done,
dead workers end nothing.
"""

import os
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from hiproof.city.folder.ledger import Ledger
from hiproof.city.plan.work_plan import Job, cut_into_tiles, neighbourhood
from hiproof.city.work import queue
from hiproof.city.work.executors import InProcess
from hiproof.city.work.ground import (
    FAR_STEP_M,
    BareAround,
    GroundAround,
    LowestAround,
    ModelAround,
    ground_cells,
    lowest_in_cells,
)
from hiproof.city.work.processes import Processes
from hiproof.city.work.sort import Reach
from hiproof.city.work.tasks import WorkerLost
from hiproof.read.terrain import TerrainChain
from small_tasks import double


def jobs_at(xy):
    return tuple(
        Job(i, str(i), shapely.box(x, y, x + 8, y + 8), None) for i, (x, y) in enumerate(xy)
    )


@pytest.mark.parametrize("max_jobs", [1, 3, 1000])
def test_each_building_is_owned_by_one_tile(max_jobs):
    jobs = jobs_at(np.random.default_rng(0).uniform(-500, 500, (60, 2)))
    tiles = cut_into_tiles(jobs, 250.0, max_jobs)
    owned = sorted(i for members in tiles.values() for i in members)
    assert owned == list(range(60))
    assert max(len(members) for members in tiles.values()) <= max_jobs


def sloped_ground(rng, n=20000, size=100.0):
    xy = rng.uniform(0, size, (n, 2))
    return np.column_stack([xy, 0.1 * xy[:, 0] - 0.05 * xy[:, 1] + rng.normal(0, 0.02, n)])


def make_ground(ground_class, cells, box):
    return ground_class(cells if ground_class is GroundAround else lambda: cells, box)


@pytest.mark.parametrize("ground_class", [GroundAround, BareAround, LowestAround])
def test_ground_of_a_building_ignores_what_lies_outside_its_box(ground_class):
    rng = np.random.default_rng(5)
    ground = sloped_ground(rng)
    box = np.array([20.0, 20.0, 50.0, 50.0])
    inside = ((ground[:, :2] >= box[:2]) & (ground[:, :2] < box[2:])).all(axis=1)
    xy = rng.uniform(31, 40, (50, 2))
    whole = make_ground(ground_class, ground_cells(ground), box).height_at(xy)
    twice = rng.permutation(np.concatenate([ground[inside], ground[inside][:500]]))
    assert np.array_equal(whole, make_ground(ground_class, ground_cells(twice), box).height_at(xy))


@pytest.mark.parametrize("share", [1.0, 0.1, 0.01])
def test_ground_heights_equal_plain_weighted_planes(share):
    rng = np.random.default_rng(6)
    cells, box = (
        ground_cells(sloped_ground(rng, int(4000 * share))),
        np.array([20.0, 25.0, 60.0, 70.0]),
    )
    xyz = cells.xyz[np.isfinite(cells.xyz[:, :, 2])]
    xyz = xyz[((np.floor(xyz[:, :2]) >= box[:2]) & (np.floor(xyz[:, :2]) < box[2:])).all(axis=1)]
    for place in rng.uniform(15, 75, (60, 2)):
        steps = np.abs(np.floor(xyz[:, :2]) - np.floor(place)).max(axis=1)
        lower = np.sort(xyz[steps <= 9, 2])
        lowest = lower[1 if len(lower) >= 10 else 0] if len(lower) else np.nan
        assert np.array_equal(
            make_ground(LowestAround, cells, box).height_at(place[None]), [lowest], equal_nan=True
        )
        reach = next((reach for reach in (2, 5) if (steps <= reach).sum() >= 3), 9)
        nearby = xyz[steps <= reach]
        weight = 1 / (((nearby[:, :2] - place) ** 2).sum(axis=1) + 0.25)
        height = np.nan
        if len(nearby):
            mean = weight @ nearby / weight.sum()
            offset, rise = nearby[:, :2] - mean[:2], nearby[:, 2] - mean[2]
            moments = (weight[:, None] * offset).T @ offset / weight.sum() + 0.1 * np.eye(2)
            slope = np.linalg.solve(moments, (weight * rise) @ offset / weight.sum())
            height = mean[2] + (place - mean[:2]) @ slope
        assert GroundAround(cells, box).height_at(place[None]) == pytest.approx(
            [height], nan_ok=True
        )


class VoidModel:
    """A terrain model of a slope that has no height within a void around a box."""

    source = "terrain model"

    def __init__(self, box, void):
        self.area = shapely.box(*box).buffer(void)

    def height_at(self, xy):
        return np.where(shapely.contains_xy(self.area, xy), np.nan, xy @ (0.1, -0.05))


@pytest.mark.parametrize("void", [0.3, 2.0, 7.0, 8.5, 15.0, 30.0])
def test_a_void_of_a_terrain_model_has_the_ground_of_the_nearest_heights(void):
    for corner in np.random.default_rng(7).uniform(-1e6, 1e6, (5, 2)):
        box = np.concatenate([np.floor(corner), np.ceil(corner + (12.0, 18.0))])
        model, border = VoidModel(box, void), shapely.get_coordinates(shapely.box(*box))
        chain = TerrainChain(
            [model, ModelAround(model, box), ModelAround(model, box, FAR_STEP_M, is_guess=True)]
        )
        heights, sources = chain.heights_and_sources(border)
        assert np.abs(heights - border @ (0.1, -0.05)).max() < 0.1 + 0.01 * void
        assert sources == ("nearest heights of the terrain model",)


def test_far_from_a_terrain_model_the_ground_is_unknown():
    box = np.array([0.0, 0.0, 10.0, 10.0])
    terrain = ModelAround(VoidModel(box, 60.0), box, FAR_STEP_M)
    assert np.isnan(terrain.height_at(np.array([[0.0, 0.0], [10.0, 5.0]]))).all()


def test_a_ledger_in_a_folder_that_cannot_be_written_is_read(tmp_path, monkeypatch):
    path = tmp_path / "ledger.sqlite"
    ledger = Ledger(path)
    ledger.set(merged="yes")
    ledger.close()
    monkeypatch.setattr("hiproof.city.folder.ledger.os.access", lambda *_: False)
    reader = Ledger(path, read_only=True)
    assert reader.get("merged") == "yes" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("executor", [InProcess(), Processes(2)], ids=["in process", "processes"])
def test_executors_return_every_task_with_result_or_error(executor):
    got = {
        task[0]: (result, type(error))
        for task, result, error in executor.run(double, [(i,) for i in range(6)])
    }
    executor.close()
    assert got == {i: ((None, ValueError) if i == 3 else (2 * i, type(None))) for i in range(6)}


def test_workers_have_the_environment_and_the_folder_of_the_moment(
    tmp_path, monkeypatch, spawned_workers
):
    for name in ("first", "second"):
        folder = tmp_path / name
        folder.mkdir()
        monkeypatch.setenv("HIPROOF_TOWN", name)
        monkeypatch.chdir(folder)
        executor = Processes(1)
        ((_, town, _),) = executor.run(os.getenv, [("HIPROOF_TOWN",)])
        ((_, current, _),) = executor.run(os.getcwd, [()])
        executor.close()
        assert (town, current) == (name, str(folder))


@pytest.mark.parametrize("members", [(1, 2, 3), (2,)], ids=["among others", "alone"])
def test_a_deadly_building_is_found_by_leaving_out_the_others(members, monkeypatch):
    """Building 2 ends its process; no task is tried more often than may be chance, and none that is
    known to be deadly.
    """
    monkeypatch.setattr(queue, "load_plan", lambda folder: SimpleNamespace(tiles={"tile": members}))
    attempts = []

    def run(function, tasks):
        for task in tasks:
            attempts.append(task[3:])
            died = None if attempts[-1] and 2 in attempts[-1][0] else WorkerLost("died")
            yield task, None if died else task[3], died

    executor = SimpleNamespace(run=run)
    assert queue.solve_in_quarantine(executor, None, ("folder", "tile", None)) == ((2,), None)
    by_one = [((2, 3),), *[((1, 3),)] * queue.TRIES, ((1, 2),)] if len(members) > 1 else []
    assert attempts == [*[()] * queue.TRIES, *by_one, ((2,),)]


def test_points_within_reach_equal_the_plain_test():
    rng = np.random.default_rng(1)
    xy = rng.uniform(-20, 60, (2000, 2))
    jobs = jobs_at(rng.uniform(0, 40, (5, 2)))
    roof, terrain = (np.array([neighbourhood(job, reach) for job in jobs]) for reach in (0.0, 3.0))

    def plain(boxes):
        return np.array([any((p >= b[:2]).all() and (p < b[2:]).all() for b in boxes) for p in xy])

    indices = rng.permutation(len(xy))[:1500]
    bits = Reach(roof, terrain).bits(xy, indices)
    assert np.array_equal(bits & 1 > 0, plain(roof)[indices])
    assert np.array_equal(bits & 2 > 0, plain(terrain)[indices])


def test_lowest_points_do_not_depend_on_how_they_are_cut():
    rng = np.random.default_rng(2)
    points = rng.uniform(-5, 5, (500, 3))
    whole = lowest_in_cells(points)
    pieces = lowest_in_cells(
        np.concatenate(
            [lowest_in_cells(part) for part in np.array_split(rng.permutation(points), 7)]
        )
    )
    assert np.array_equal(whole, pieces)
    cells = {}
    for x, y, z in points:
        cell = (np.floor(x) + 0.5, np.floor(y) + 0.5)
        cells[cell] = min(z, cells.get(cell, np.inf))
    assert {(x, y) for x, y, _ in whole} == set(cells)
    assert all(abs(cells[x, y] - z) < 1e-4 for x, y, z in whole)
