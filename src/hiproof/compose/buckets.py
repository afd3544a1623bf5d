"""Look up what lies near a place of a plan, in square buckets. Compiled.

Items are the numbers of vertices or edges. Each is in every bucket that its box reaches into. So
the cost of noding is in proportion to the number of edges, however large the plan is.

Buckets are a layout, the first link of each bucket, and links. The layout (6,) holds the lowest x
and y, the size of a bucket, the numbers of columns and rows, and that of links in use. A link is an
item and the next link, -1 at the end.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled
from ..geometry.arrays import copy_rows

SEGMENTS_A_BUCKET = 8  # on average; more take longer to look through, fewer to enter


@compiled
def grow_array(array):
    """Return a copy of `array` with twice the rows."""
    larger = np.empty((2 * len(array), array.shape[1]), array.dtype)
    copy_rows(larger, array)
    return larger


@compiled
def append_row(rows, count, a, b):
    """Append (a, b) to `rows`, of which `count` are used, or a copy; returns rows and count."""
    if count == len(rows):
        rows = grow_array(rows)
    rows[count, 0], rows[count, 1] = a, b
    return rows, count + 1


@compiled
def lay_buckets(xy, segments):
    """Lay empty buckets over places `xy` (n, 2), for so many segments."""
    lowest_x, lowest_y, x, y = xy[0, 0], xy[0, 1], xy[0, 0], xy[0, 1]
    for v in range(len(xy)):
        lowest_x, x = min(lowest_x, xy[v, 0]), max(x, xy[v, 0])
        lowest_y, y = min(lowest_y, xy[v, 1]), max(y, xy[v, 1])
    width, height = x - lowest_x, y - lowest_y
    most = max(1, segments // SEGMENTS_A_BUCKET)
    size = 1 + np.int64(max((width + height) / most, np.sqrt(float(width) * float(height) / most)))
    layout = np.zeros(6, np.int64)
    layout[0], layout[1], layout[2] = lowest_x, lowest_y, size
    layout[3], layout[4] = width // size + 1, height // size + 1
    first = np.full(layout[3] * layout[4], -1, np.int64)
    return layout, first, np.empty((2 * segments + 16, 2), np.int64)


@compiled
def find_buckets(layout, x_low, y_low, x_high, y_high):
    """Return the columns and rows that a box reaches into: first, last, first, last."""
    return (
        max(0, (x_low - layout[0]) // layout[2]),
        min(layout[3] - 1, (x_high - layout[0]) // layout[2]),
        max(0, (y_low - layout[1]) // layout[2]),
        min(layout[4] - 1, (y_high - layout[1]) // layout[2]),
    )


@compiled
def enter_item(item, x_low, y_low, x_high, y_high, buckets):
    """Enter an item with its box. Returns the buckets."""
    layout, first, links = buckets
    left, right, low, high = find_buckets(layout, x_low, y_low, x_high, y_high)
    for column in range(left, right + 1):
        for k in range(column * layout[4] + low, column * layout[4] + high + 1):
            links, layout[5] = append_row(links, layout[5], item, first[k])
            first[k] = layout[5] - 1
    return layout, first, links


@compiled
def enter_edge(e, xy, edges, buckets):
    """Enter the edge of this number. Returns the buckets."""
    a, b = xy[edges[e, 0]], xy[edges[e, 1]]
    return enter_item(
        e, min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1]), buckets
    )


@compiled
def list_near(x_low, y_low, x_high, y_high, buckets, items):
    """List items whose buckets meet a box, perhaps repeated, in `items` or longer; and count."""
    layout, first, links = buckets
    if len(items) < layout[5]:
        items = np.empty(len(links), np.int64)
    count = 0
    left, right, low, high = find_buckets(layout, x_low, y_low, x_high, y_high)
    for column in range(left, right + 1):
        for k in range(column * layout[4] + low, column * layout[4] + high + 1):
            link = first[k]
            while link >= 0:
                items[count] = links[link, 0]
                count += 1
                link = links[link, 1]
    return items, count
