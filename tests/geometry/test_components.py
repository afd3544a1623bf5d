"""Laws of connected components: what a graph search finds, numbered by first members."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hiproof.geometry.components import label_components

MOST = 12


@given(st.lists(st.tuples(st.integers(0, MOST - 1), st.integers(0, MOST - 1)), max_size=20))
def test_components_are_those_of_a_graph_search(links):
    result = label_components(MOST, np.array(links, np.int64).reshape(-1, 2).T)
    expected = np.full(MOST, -1)
    for member in range(MOST):
        if expected[member] >= 0:
            continue
        number, front = expected.max() + 1, {member}
        while front:
            node = front.pop()
            expected[node] = number
            ends = {
                link_start + other - node
                for link_start, other in links
                if node in (link_start, other)
            }
            front |= {end for end in ends if expected[end] < 0}
    assert result.tolist() == expected.tolist()


def test_a_long_chain_in_any_order_is_one_component():
    chain = np.random.default_rng(0).permutation(5000)
    assert not label_components(5000, np.stack([chain[:-1], chain[1:]])).any()


def test_nothing_has_no_components():
    assert len(label_components(0, np.zeros((2, 0), np.int64))) == 0
