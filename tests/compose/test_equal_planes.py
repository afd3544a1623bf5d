"""Check which planes count as one, against a comparison of each with every other."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hiproof.compose.cells import equal_planes

NUMBERS = st.sampled_from([0.0, 0.5, 0.5 + 6e-7, 0.5 + 2e-6, 4.0])


@given(arrays(float, st.tuples(st.integers(1, 12), st.just(3)), elements=NUMBERS))
def test_each_plane_has_the_number_of_the_first_that_equals_it(planes):
    is_equal = (np.abs(planes[:, None] - planes) < 1e-6).all(axis=2)
    assert equal_planes(planes).tolist() == is_equal.argmax(axis=1).tolist()
