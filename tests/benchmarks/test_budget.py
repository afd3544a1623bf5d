"""A budget counts every second once, and all its stages exist."""

from pkgutil import resolve_name

import pytest
from benchmarks.budget import STAGES, Clock, refuse_incomplete


def test_a_stage_does_not_count_the_stages_inside_it():
    new = 0.0

    def work(seconds):
        nonlocal new
        new += seconds

    clock = Clock(lambda: new)
    inner = clock.time_stage("inner", lambda: work(2.0))

    def outer():
        work(1.0)
        inner()
        inner()

    clock.time_stage("outer", outer)()
    assert clock.seconds == {"inner": 4.0, "outer": 1.0}
    assert sum(clock.seconds.values()) == new


@pytest.mark.parametrize("place", STAGES.values(), ids=STAGES)
def test_every_stage_is_a_function_of_a_run(place):
    assert callable(resolve_name(place))


def test_a_budget_that_misses_a_twentieth_of_the_time_is_refused():
    clock = Clock()
    clock.seconds["fit"] = 9.6
    refuse_incomplete(clock, 10.0)
    with pytest.raises(SystemExit, match="within 5%"):
        refuse_incomplete(clock, 11.0)
