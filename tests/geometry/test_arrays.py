"""Sorting and copying in compiled code are NumPy's, to the last element."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hiproof.geometry.arrays import (
    compute_median,
    copy_row,
    copy_rows,
    list_distinct,
    sort_order,
    sort_values,
)

# few numbers, so that many are equal
NUMBERS = st.sampled_from([-np.inf, -2.5, -1.0, 0.0, 0.5, 1.0, 3.0, np.inf])


@given(values=arrays(float, st.integers(0, 70), elements=NUMBERS))
def test_equal_values_keep_their_order(values):
    assert np.array_equal(sort_order(values), np.argsort(values, kind="stable"))
    assert np.array_equal(sort_values(values), np.sort(values))
    assert np.array_equal(list_distinct(values), np.unique(values))


@given(values=arrays(float, st.integers(1, 70), elements=st.floats(-1e6, 1e6)))
def test_the_median_is_numpys(values):
    assert compute_median(values) == np.median(values)


@pytest.mark.parametrize("n", [0, 1, 3])
def test_rows_beyond_the_copied_ones_stay(n):
    rows, target = np.arange(2.0 * n).reshape(n, 2), np.full((4, 2), 9.0)
    copy_rows(target, rows)
    assert np.array_equal(target[:n], rows) and (target[n:] == 9.0).all()
    row = np.full(4, 9.0)
    copy_row(row, np.arange(float(n)))
    assert np.array_equal(row[:n], np.arange(n)) and (row[n:] == 9.0).all()
