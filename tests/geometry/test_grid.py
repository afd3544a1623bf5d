"""Cells are numbered as NumPy numbers distinct rows."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hiproof.geometry.grid import cell_range, count_cells, number_cells

WHOLE = st.integers(-(10**8), 10**8).map(float) | st.integers(-2, 2).map(float)


@given(arrays(float, st.tuples(st.integers(0, 30), st.just(2)), elements=WHOLE))
def test_cells_are_numbered_as_numpy_numbers_rows(cells):
    expected, number = np.unique(cells, axis=0, return_inverse=True)
    result, found_number = number_cells(cells)
    assert np.array_equal(result, expected) and np.array_equal(found_number, number.ravel())
    assert count_cells(cells) == len(expected)


def test_the_range_of_cells_holds_all_points():
    xy = np.array([[-0.5, 3.9], [8.0, 4.0]])
    assert cell_range(xy, 4.0) == ((-1, 0), (4, 2))
