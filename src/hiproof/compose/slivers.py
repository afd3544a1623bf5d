"""Cells of a plan too small or thin to be a face, given to their neighbours."""

from __future__ import annotations

import numpy as np

from ..geometry.components import label_components
from .arrangement import OUTSIDE, HalfEdges, edge_lengths, heights

UNSEEN_UNITS = 100.0  # a centimetre: a face thinner than that is none
BEYOND_UNITS = 1000.0  # a decimetre by which a face may rise or fall further than what is around it


def merge_slivers(
    xy: np.ndarray,
    edges: np.ndarray,
    traced: HalfEdges,
    label: np.ndarray,
    patched: np.ndarray,
    planes: np.ndarray,
    min_area: float,
    min_width: float,
) -> None:
    """Give every region too small or thin to a neighbour, smallest first, in `label` (f,).

    The neighbour is the one with the longest common border.

    A patch alone comes last, for what lies between it and the region it belongs to may become that
    region's. One that would carry its plane on to where no roof is around keeps out, unless nobody
    could see the region.
    """
    sides, length = traced.face.reshape(-1, 2), edge_lengths(xy, edges)
    keeps_out = np.zeros(len(label), bool)
    for _ in range(len(label)):
        links = sides[label[sides[:, 0]] == label[sides[:, 1]]].T
        region = label_components(len(label), links)
        first = np.unique(region, return_index=True)[1]
        size = np.bincount(region[1:], traced.area[1:], len(first))
        is_patch = np.bincount(region[1:], ~patched[1:], len(first)) == 0
        beside = region[sides]
        is_border = beside[:, 0] != beside[:, 1]
        border = np.bincount(beside.ravel(), np.repeat(length * is_border, 2), len(first))
        is_inner = is_border & (label[sides] != OUTSIDE).all(axis=1)
        is_sliver = (size < min_area) | (2 * size < min_width * border)
        slivers = np.unique(beside[is_inner])
        slivers = slivers[is_sliver[slivers] & ~keeps_out[first[slivers]]]
        if not len(slivers):
            break
        smallest = slivers[np.lexsort((size[slivers], is_patch[slivers]))[0]]
        is_unseen = bool(
            size[smallest] < min_area
            or 2 * size[smallest] < min(min_width, UNSEEN_UNITS) * border[smallest]
        )
        is_end = (beside[is_border] == smallest).any(axis=1)
        ends, at = xy[edges[is_border][is_end]], beside[is_border][is_end]
        neighbour = np.where(at[:, 0] == smallest, at[:, 1], at[:, 0])
        shared = length[is_border][is_end]
        heir = choose_heir(ends, neighbour, shared, label[first], planes, smallest, is_unseen)
        if heir == OUTSIDE:
            keeps_out |= region == smallest
        else:
            label[region == smallest] = heir


def choose_heir(
    ends: np.ndarray,
    neighbour: np.ndarray,
    length: np.ndarray,
    label: np.ndarray,
    planes: np.ndarray,
    sliver: int,
    anyone: bool,
) -> int:
    """Return the label of the region that takes a sliver over, OUTSIDE where there is none.

    It shares the longest border with the sliver, and its planes stay over it within the heights
    around it (or it is `anyone`). The sliver's border has edges with `ends` (m, 2, 2), of a
    `length` (m,), beside the region `neighbour` (m,). `label` (r,) is that of regions.
    """
    x, y = np.moveaxis(ends, -1, 0)
    shared = np.bincount(neighbour, length * (label[neighbour] != OUTSIDE), len(label))
    around = []
    for regions in (np.full_like(neighbour, sliver), neighbour):
        is_roofed = label[regions] >= 0
        roofs = planes[label[regions[is_roofed]], None]
        around.append(heights(roofs, x[is_roofed], y[is_roofed]).ravel())
    z_around = np.concatenate(around)
    lower, upper = z_around.min(initial=np.inf), z_around.max(initial=-np.inf)
    fits = shared > 0.0
    for r in np.flatnonzero(fits & (label >= 0)):
        z = heights(planes[label[r]], x, y)
        fits[r] = ((lower - BEYOND_UNITS < z) & (z < upper + BEYOND_UNITS)).all()
    if label[sliver] < 0 or (anyone and not fits.any()):
        fits = shared > 0.0
    return int(label[np.where(fits, shared, 0.0).argmax()]) if fits.any() else OUTSIDE


def keep_largest_component(traced: HalfEdges, label: np.ndarray) -> None:
    """Turn all but the largest connected inside to OUTSIDE in `label` (f,), cut at necks."""
    sides, is_inside = traced.face.reshape(-1, 2), label != OUTSIDE
    component = label_components(len(label), sides[is_inside[sides].all(axis=1)].T)
    size = np.bincount(component, traced.area * is_inside)
    label[component != size.argmax()] = OUTSIDE
