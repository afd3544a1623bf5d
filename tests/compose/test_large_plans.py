"""Large plans: noding comes to rest."""

import math

import numpy as np
import pytest
import shapely

from hiproof.compose import check_solid, compose
from hiproof.compose.arrangement import is_beside, node
from hiproof.frames import LocalFrame
from hiproof.model import Part, Piece, Roof

REACH = 12.0


def test_two_vertices_as_far_apart_as_the_reach_come_to_rest():
    """Each lay beside the edge from the other to a third one, and was put into it in turn."""
    segments = [
        [299967, 700000, 299967, 700051],
        [408500, 799900, 299966, 799900],
        [299978, 799900, 299978, 700051],
    ]
    xy, edges = node(np.array(segments), REACH)
    pairs = {frozenset(map(tuple, xy[edge].tolist())) for edge in edges}
    assert frozenset([(299978, 799900), (299967, 700051)]) in pairs
    assert len(edges) == 4


@pytest.mark.parametrize(("seed", "reach"), [(0, 12.0), (1, 12.0), (2, 300.0), (3, 300.0)])
def test_noded_vertices_keep_the_reach(seed, reach):
    rng = np.random.default_rng(seed)
    starts = rng.integers(0, 100_000, (60, 2))
    segments = np.hstack([starts, starts + rng.integers(-20_000, 20_000, (60, 2))])
    xy, edges = node(segments, reach)
    assert len(edges) > 60
    small_triangles = 0
    for v, place in enumerate(xy):
        for a, b in edges[(edges != v).all(axis=1)]:
            if is_beside(place, xy[a], xy[b], reach):
                ends = np.linalg.norm(xy[[a, b]] - place, axis=1)
                small_triangles += ends.min() < 2 * reach
                assert ends.min() < 2 * reach
    assert small_triangles <= 2


def make_checkerboard(squares):
    """A roof of squares of 2 m, low and high in turn."""
    parts = []
    for i in range(squares):
        for j in range(squares):
            box = shapely.box(2.0 * i, 2.0 * j, 2.0 * i + 2.0, 2.0 * j + 2.0)
            plane = np.array([[0.0, 0.0, 4.0 + 3.0 * ((i + j) % 2)]])
            parts.append(Part("flat", (Piece(box, plane),)))
    outline = shapely.box(0.0, 0.0, 2.0 * squares, 2.0 * squares)
    return Roof(tuple(parts), outline, LocalFrame(np.zeros(3)))


def test_any_number_of_crosswise_corners_is_mended():
    solid = compose(make_checkerboard(9), 0.0)
    assert not check_solid(solid)
    assert math.isclose(solid.volume, 4.0 * (41 * 4.0 + 40 * 7.0), rel_tol=1e-3)
