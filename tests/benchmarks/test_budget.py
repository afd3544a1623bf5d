"""A budget counts every second once, and all its stages exist."""

import time
from importlib import import_module

import pytest
from benchmarks.budget import STAGES, Clock


def work(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_a_stage_does_not_count_the_stages_inside_it():
    clock = Clock()
    inner = clock.timed("inner", lambda: work(0.02))

    def outer():
        work(0.01)
        inner()
        inner()

    start = time.process_time()
    clock.timed("outer", outer)()
    total = time.process_time() - start
    assert clock.seconds["inner"] == pytest.approx(0.04, abs=0.01)
    assert clock.seconds["outer"] == pytest.approx(0.01, abs=0.01)
    assert sum(clock.seconds.values()) == pytest.approx(total, rel=0.05)


@pytest.mark.parametrize("place", STAGES.values(), ids=STAGES)
def test_every_stage_is_a_function_of_a_run(place):
    module, path = place
    found = import_module(f"hiproof.{module}")
    for name in path.split("."):
        found = getattr(found, name)
    assert callable(found)
