"""Passages below buildings: a layer of them, or a column of the footprints."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from ...errors import InputWarning
from ...log import count_things
from ...model import Footprint
from ...read.numbers import MOST_SHOWN_VALUES, read_number
from ...read.outlines.footprints import read_footprints
from ...read.plausible import HIGHEST_BUILDING_M
from ..request import Request
from .frame import AreaFrame
from .overrides import refuse_missing_column

LEAST_PASSAGE_M2 = 0.5  # of a footprint; less is two layers that do not quite meet


def add_passages(
    footprints: tuple[Footprint, ...], request: Request, frame: AreaFrame
) -> tuple[Footprint, ...]:
    """Return the footprints, each with the passages below it.

    Passages come from the layer `underpasses` of the request, and from a column of the footprints:
    a building with a number there stands so high above the ground. Raises InputError for a layer
    that cannot be read, and for columns that are not there.
    """
    column = request.settings.read.raised_column
    if column:
        refuse_missing_column(footprints, column, "the footprints", "the clearance")
        footprints = tuple(
            replace(f, passages=((f.polygon, clearance),))
            if (clearance := read_clearance(f.attributes.get(column)))
            else f
            for f in footprints
        )
    if request.underpasses is None:
        return footprints
    layer = read_passages(request, frame)
    tree = shapely.STRtree([polygon for polygon, _ in layer])
    below = [select_below(footprint, layer, tree) for footprint in footprints]
    area = shapely.box(*shapely.total_bounds([footprint.polygon for footprint in footprints]))
    used = len({id(passage) for passages in below for passage in passages})
    near = len(tree.query(area, predicate="intersects"))
    if layer and used < max(1, near):
        found = f"{used} of {near} in" if used else "none of"
        warnings.warn(
            f"expected underpasses below the footprints, got {found} {request.underpasses} there; "
            "check its place and its CRS",
            InputWarning,
        )
    return tuple(
        replace(footprint, passages=(*footprint.passages, *passages))
        for footprint, passages in zip(footprints, below, strict=True)
    )


def read_passages(request: Request, frame: AreaFrame) -> list[tuple[shapely.Polygon, float]]:
    """Read the polygons of passages, with the clearance (m) of each."""
    path, column = str(request.underpasses), request.settings.read.clearance_column
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)  # passages may overlap
        features = read_footprints(path, target_crs=frame.cloud, settings=request.settings)
    refuse_missing_column(features, column, f"the underpasses in {path}", "the clearance")
    layer, unread = [], []
    for feature in features:
        value = feature.attributes.get(column)
        clearance = read_clearance(value)
        if clearance is None:
            unread.append(str(value)[:20])
        elif not feature.polygon.is_empty:
            layer.append((feature.polygon, clearance))
    if missing := len(features) - len(layer):
        subset = f" ({', '.join(unread[:MOST_SHOWN_VALUES])})" if unread else ""
        warnings.warn(
            f"{count_things(missing, 'underpass', 'underpasses')} of {path} left out: column "
            f"{column} has no number over 0 there{subset}",
            InputWarning,
        )
    return layer


def read_clearance(value: Any) -> float | None:
    """Read a clearance in metres, None where there is none.

    >>> read_clearance("3,2 m"), read_clearance(0), read_clearance("high")
    (3.2, None, None)
    """
    return read_number(value, 0.0, HIGHEST_BUILDING_M) or None


def select_below(
    footprint: Footprint, layer: list[tuple[shapely.Polygon, float]], tree: shapely.STRtree
) -> list[tuple[shapely.Polygon, float]]:
    """Return the passages of a layer that lie below a footprint, in its order."""
    if footprint.polygon.is_empty:
        return []
    near = np.sort(tree.query(footprint.polygon, predicate="intersects"))
    return [
        layer[k]
        for k in near
        if shapely.intersection(layer[k][0], footprint.polygon).area >= LEAST_PASSAGE_M2
    ]
