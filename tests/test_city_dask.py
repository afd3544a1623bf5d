"""The same run on a real Dask cluster: worker processes on this machine, killed in mid-work."""

import os
import subprocess
import sys

import pytest

import planted
from hiproof.city import run as city_run
from hiproof.city.run import Request, reconstruct_area
from hiproof.errors import InputError, OutputError
from hiproof.update import run as update_run
from hiproof.update.run import update_area
from run_records import by_id, records
from tiny_town import make_town
from tiny_updates import make_request

dask = pytest.importorskip("dask", reason="needs dask[distributed], the extra `city`")
distributed = pytest.importorskip("distributed", reason="needs dask[distributed], the extra `city`")


@pytest.fixture(scope="module")
def forked_workers():
    """Let Dask fork a dozen workers from one process that has imported what they need."""
    with dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"}):
        distributed.utils.get_mp_context().set_forkserver_preload(planted.PRELOADED)
        yield


@pytest.fixture(scope="module")
def cluster(forked_workers):
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        # a worker that dies while its nanny still starts it is not started again by the nanny
        cluster.adapt(minimum=2, maximum=2)
        yield cluster


@pytest.fixture(autouse=True)
def small_tiles(monkeypatch):
    monkeypatch.setattr("hiproof.city.plan.prepare.MOST_BUILDINGS_A_TILE", 1)


def test_an_update_on_a_cluster_whose_worker_is_killed_changes_no_byte(
    town_run, cluster, tmp_path, monkeypatch
):
    later = make_town(seed=7)
    later.xyz[later.classification == 6, 2] += 1.5
    cloud = later.write(tmp_path / "later.laz")
    monkeypatch.setattr("hiproof.update.plan.limit_buildings_per_tile", lambda _: 1)
    outs = tmp_path / "alone", tmp_path / "cluster"
    for out, address in zip(outs, (None, cluster.scheduler_address), strict=True):
        update_area(make_request(town_run, cloud, out, scheduler=address))
        monkeypatch.setattr(update_run, "update_tile", planted.kill_once_and_update)
    assert (outs[1] / ".hiproof" / "killed").exists()
    assert records(outs[0]) == records(outs[1])
    tables = [[(out / f"changes.{kind}").read_bytes() for kind in ("csv", "gpkg")] for out in outs]
    assert tables[0] == tables[1]


def test_a_building_that_kills_dask_workers_is_left_out_alone(
    town_files, reference_run, cluster, tmp_path, monkeypatch
):
    monkeypatch.setattr(city_run, "solve_tile", planted.solve_deadly)
    # one death is enough to blame a task here: each costs the start of a worker
    monkeypatch.setattr(cluster.scheduler, "allowed_failures", 0)
    monkeypatch.setattr("hiproof.city.work.queue.MOST_LOSSES", 1)
    monkeypatch.setattr("hiproof.city.work.queue.TRIES", 1)
    summary = reconstruct_area(
        Request((town_files[0],), tmp_path, town_files[1], scheduler=cluster.scheduler_address)
    )
    assert summary.buildings == 4
    assert [id for id, _ in summary.failures] == [planted.DEADLY]
    rows, expected = by_id(tmp_path), by_id(reference_run)
    assert {**rows, planted.DEADLY: None} == {**expected, planted.DEADLY: None}


def test_an_address_without_a_scheduler_gets_one_sentence(town_files, tmp_path, monkeypatch):
    monkeypatch.setattr("hiproof.city.work.executors.CONNECT_S", 1)
    with pytest.raises(InputError, match=r"Dask scheduler at tcp://127.0.0.1:9"):
        reconstruct_area(
            Request((town_files[0],), tmp_path, town_files[1], scheduler="tcp://127.0.0.1:9")
        )


def test_a_cluster_without_workers_ends_the_run_with_one_sentence(
    town_files, tmp_path, monkeypatch
):
    monkeypatch.setattr("hiproof.city.work.executors.WORKERLESS_S", 1)
    monkeypatch.setattr("hiproof.city.work.executors.POLL_S", 0.5)
    with (
        distributed.LocalCluster(n_workers=0, processes=True, dashboard_address=":0") as empty,
        pytest.raises(OutputError, match="expected workers at the Dask scheduler"),
    ):
        reconstruct_area(
            Request((town_files[0],), tmp_path, town_files[1], scheduler=empty.scheduler_address)
        )


def test_the_example_runs(town_files, tmp_path):
    example = [sys.executable, "examples/dask_two_workers.py", str(tmp_path / "out"), *town_files]
    got = subprocess.run(
        example,
        capture_output=True,
        text=True,
        env={
            **os.environ,
            "PYTHONPATH": "src",
            "DASK_DISTRIBUTED__WORKER__MULTIPROCESSING_METHOD": "forkserver",
        },
        check=False,
        timeout=300,
    )
    assert got.returncode == 0, got.stderr
    assert "4 buildings by two Dask workers" in got.stdout
