"""Garbage is collected seldom while a run works, and then as the caller has it."""

import gc
import weakref

import pytest

from hiproof.garbage import RARELY, collect_rarely, leave_garbage


def test_garbage_is_collected_rarely_inside_and_as_before_afterwards():
    before = gc.get_threshold()
    with pytest.raises(ZeroDivisionError), collect_rarely():
        assert gc.get_threshold() == (RARELY, *before[1:])
        1 / 0  # noqa: B018
    assert gc.get_threshold() == before


def test_objects_that_refer_to_each_other_are_still_freed():
    """So memory stays flat in runs of any length."""

    class Ring:
        count = 0

        def __init__(self):
            self.ring = self
            Ring.count += 1

        def __del__(self):
            Ring.count -= 1

    with collect_rarely():
        for _ in range(3 * RARELY):
            Ring()
        assert Ring.count <= 2 * RARELY


def test_no_garbage_is_collected_once_a_command_has_ended():
    class Loop:
        pass

    loop = Loop()
    loop.loop = loop
    kept = weakref.ref(loop)
    leave_garbage()
    del loop
    gc.collect()
    assert kept() is not None
