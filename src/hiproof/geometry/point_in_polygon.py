"""Whether a point lies in rings: the even-odd rule, edge by edge. Compiled."""

from __future__ import annotations

from ..compiled import compiled


@compiled
def flips(x0, y0, x1, y1, x, y):
    """Return whether an edge crosses the ray from (x, y) towards larger x.

    The edge runs from (x0, y0) to (x1, y1).

    A point is inside those rings of whose edges an odd number do; on a shared edge it is on one
    side only.
    """
    return (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0)
