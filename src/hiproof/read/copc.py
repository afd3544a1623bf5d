"""Points of a COPC file, from the octree's nodes that meet a box.

The points of each node are checked against the node's cube.

Only those nodes are fetched and decoded. The nodes themselves were found, once a file, when its
header was checked.
"""

from __future__ import annotations

from typing import BinaryIO

import laspy
import lazrs
import numpy as np

from .las_header import LasFacts, Octree
from .las_points import SELECTION, Decoded, take_fields
from .plausible import Implausible

Box = tuple[float, float, float, float]


def copc_points(
    file: BinaryIO, facts: LasFacts, octree: Octree, box: Box
) -> tuple[np.ndarray, Decoded]:
    """Return the nodes that meet `box`, and the points in all of them.

    `box` is (xmin, ymin, xmax, ymax). The nodes' points follow one another.
    """
    nodes = find_nodes(facts, octree, box)
    chunks = list(zip(nodes["points"].tolist(), nodes["bytes"].tolist(), strict=True))
    file.seek(0)
    form = laspy.LasHeader.read_from(file, read_evlrs=False).point_format
    points = laspy.PackedPointRecord.zeros(int(nodes["points"].sum()), form)
    if len(nodes):
        compressed = np.frombuffer(
            b"".join(read_node_bytes(file, node) for node in nodes), np.uint8
        )
        laszip = np.frombuffer(facts.laszip, np.uint8)
        content, selection = points.array.view(np.uint8), SELECTION.to_lazrs()
        lazrs.decompress_points_with_chunk_table(compressed, laszip, content, chunks, selection)
    return nodes, take_fields(points, facts)


def read_node_bytes(file: BinaryIO, node: np.void) -> bytes:
    file.seek(int(node["start"]))
    return file.read(int(node["bytes"]))


def find_nodes(facts: LasFacts, octree: Octree, box: Box) -> np.ndarray:
    """Return the nodes that hold points and meet `box` in plan.

    They are in the order in which they stand in the file.
    """
    lower, upper = cubes(facts, octree, octree.nodes)
    meets = (lower[:, :2] <= box[2:]).all(axis=1) & (upper[:, :2] >= box[:2]).all(axis=1)
    result = octree.nodes[meets]
    return result[np.argsort(result["start"], kind="stable")]


def cubes(facts: LasFacts, octree: Octree, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper corners (n, 3) of the nodes' cubes.

    Cubes are wider by what rounding may move a point.
    """
    level, place = nodes["key"][:, :1], nodes["key"][:, 1:]
    side = np.ldexp(2 * octree.half, -level)
    lower = octree.centre - octree.half + place * side
    return lower - facts.rounding, lower + side + facts.rounding


def check_nodes(xyz: np.ndarray, nodes: np.ndarray, facts: LasFacts, octree: Octree) -> None:
    """Raise Implausible where a node's points leave its cube.

    The nodes' points follow one another in `xyz` (n, 3).
    """
    if not len(nodes):
        return
    starts = np.cumsum([0, *nodes["points"][:-1]])
    lower, upper = cubes(facts, octree, nodes)
    outside = (np.minimum.reduceat(xyz, starts) < lower) | (
        np.maximum.reduceat(xyz, starts) > upper
    )
    if outside.any():
        level, *place = nodes["key"][np.argmax(outside.any(axis=1))].tolist()
        raise Implausible(
            f"its octree's node {place} of level {level} has points outside its bounds; it is "
            "damaged"
        )
