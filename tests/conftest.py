"""Fixtures that several test files share."""

import gc
import multiprocessing
import os
import signal
import warnings

import pytest

import pages
import planted
from hiproof import log, masking
from hiproof.city import run as city_run
from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work import processes, solve
from hiproof.city.work.warm import make_ready
from hiproof.compiled import news
from hiproof.garbage import RARELY
from hiproof.parametric.run import build_file
from sample_models import write_scanned_run
from sample_parameters import write_parameters_of_each_kind
from tiny_town import write_town


def pytest_configure(config):
    """Compile before several processes test, so that no two compile the same. A shell has what it
    starts in the background ignore Ctrl-C, and processes that tests interrupt would ignore it too.
    """
    gc.set_threshold(RARELY)  # imports and tests make objects that stay
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        news.listener = news.Lines(print)
        make_ready()


def pytest_collection_finish():
    """Look for garbage among what tests make alone: it took a twelfth of their CPU time."""
    gc.freeze()


@pytest.fixture(autouse=True, scope="session")
def leave_files_to_the_system():
    """Wait for no disk: files of tests need not outlast a power cut, and runs sync dozens each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda descriptor: None)
        yield


@pytest.fixture(autouse=True)
def restore_log():
    """What a test starts of the log ends with it."""
    handlers, level, show = log.LOGGER.handlers[:], log.LOGGER.level, warnings.showwarning
    yield
    log.LOGGER.handlers[:], warnings.showwarning = handlers, show
    log.LOGGER.setLevel(level)


@pytest.fixture(autouse=True)
def restore_secrets(monkeypatch):
    """Secrets that a test uses are hidden in its own messages alone."""
    monkeypatch.setattr(masking, "SECRETS", masking.Secrets())


@pytest.fixture(autouse=True)
def forked_workers(monkeypatch):
    """Workers are forked from one process that has imported what they need, where that can be."""
    if "forkserver" in multiprocessing.get_all_start_methods():
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(planted.PRELOADED)
        monkeypatch.setattr(processes, "get_context", lambda _: context)


@pytest.fixture
def spawned_workers(forked_workers, monkeypatch):
    """Workers are started as those of users are, and import all that they need."""
    monkeypatch.setattr(processes, "get_context", multiprocessing.get_context)


@pytest.fixture
def quick_tiles(monkeypatch):
    """Buildings of a run are counted points, not fitted."""
    monkeypatch.setattr(city_run, "solve_tile", planted.solve_quickly)


@pytest.fixture(scope="session")
def town_files(tmp_path_factory):
    """Paths of the tiny town's cloud and footprints."""
    return [str(path) for path in write_town(tmp_path_factory.mktemp("town"))]


@pytest.fixture(scope="session")
def reference_run(town_files, tmp_path_factory):
    """The output folder of a run over the tiny town that nothing disturbs: what every other run has
    to give.
    """
    out = tmp_path_factory.mktemp("undisturbed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(city_run, "solve_tile", planted.solve_quickly)
        reconstruct_area(Request((town_files[0],), out, town_files[1]))
    return out


@pytest.fixture(scope="session")
def town_run(town_files, tmp_path_factory):
    """The folder of a run over the tiny town; do not write into it."""
    out = tmp_path_factory.mktemp("town_run")
    reconstruct_area(Request((town_files[0],), out, town_files[1]))
    return out


@pytest.fixture
def solved_ids(monkeypatch):
    """The ids of buildings that are solved, as they are."""
    ids, original = [], solve.solve_one

    def solve_one(plan, job, *known):
        ids.append(job.id)
        return original(plan, job, *known)

    monkeypatch.setattr(solve, "solve_one", solve_one)
    return ids


@pytest.fixture(scope="session")
def sample_run(tmp_path_factory):
    """The folder of a small finished run and its points; do not write into it."""
    return write_scanned_run(tmp_path_factory.mktemp("sample"))


@pytest.fixture(scope="session")
def run_of_each_kind(tmp_path_factory):
    """The folder of a run with a building of each kind; do not write into it."""
    folder = tmp_path_factory.mktemp("each_kind")
    write_parameters_of_each_kind(folder / "given" / "parameters.jsonl")
    build_file(folder / "given" / "parameters.jsonl", folder / "run")
    return folder / "run"


@pytest.fixture(scope="session")
def browser():
    """Debian's Chromium without a window."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="no playwright here; pip install playwright"
    )
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=pages.BROWSER, args=pages.FLAGS)
        yield browser
        browser.close()
