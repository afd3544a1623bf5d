"""Passages below buildings: a layer of them, or a column of the footprints."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from ..errors import InputError, InputWarning
from ..log import count_things
from ..model import Footprint
from .request import Request

if TYPE_CHECKING:
    from .frame import AreaFrame

LEAST_PASSAGE_M2 = 0.5  # of a footprint; less is two layers that do not quite meet


def add_passages(
    footprints: tuple[Footprint, ...], request: Request, frame: AreaFrame
) -> tuple[Footprint, ...]:
    """Return the footprints, each with the passages below it.

    They are those of the layer `underpasses` of the request, and of a column of the footprints: a
    building with a number there stands so high above the ground. Raises InputError for a layer that
    cannot be read, and for columns that are not there.
    """
    column = request.settings.read.raised_column
    if column:
        refuse_missing_column(footprints, column, "the footprints")
        footprints = tuple(raise_footprint(footprint, column) for footprint in footprints)
    if request.underpasses is None:
        return footprints
    layer = read_passages(request, frame)
    tree = shapely.STRtree([polygon for polygon, _ in layer])
    return tuple(
        replace(footprint, passages=(*footprint.passages, *select_below(footprint, layer, tree)))
        for footprint in footprints
    )


def raise_footprint(footprint: Footprint, column: str) -> Footprint:
    clearance = read_clearance(footprint.attributes.get(column))
    if clearance is None:
        return footprint
    return replace(footprint, passages=((footprint.polygon, clearance),))


def read_passages(request: Request, frame: AreaFrame) -> list[tuple[shapely.Polygon, float]]:
    """Read the polygons of passages, with the clearance (m) of each."""
    from ..read.footprints import read_footprints

    path, column = str(request.underpasses), request.settings.read.clearance_column
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)  # passages may overlap
        features = read_footprints(path, target_crs=frame.cloud, settings=request.settings)
    refuse_missing_column(features, column, f"the underpasses in {path}")
    layer = [
        (feature.polygon, clearance)
        for feature in features
        if (clearance := read_clearance(feature.attributes.get(column))) is not None
        and not feature.polygon.is_empty
    ]
    if missing := len(features) - len(layer):
        warnings.warn(
            f"{count_things(missing, 'underpass', 'underpasses')} of {path} left out: column "
            f"{column} has no number over 0 there",
            InputWarning,
        )
    return layer


def refuse_missing_column(features: Iterable[Footprint], column: str, subject: str) -> None:
    """Raise InputError where no feature has a column."""
    columns = {name for feature in features for name in feature.attributes}
    if columns and column not in columns:
        raise InputError(
            f"expected a column {column} of {subject} ({', '.join(sorted(columns))}), got none; "
            "name the one that holds the clearance"
        )


def read_clearance(value: Any) -> float | None:
    """Read a clearance in metres, None where there is none.

    >>> read_clearance("3.2"), read_clearance(0), read_clearance("high")
    (3.2, None, None)
    """
    try:
        clearance = float(value)
    except (TypeError, ValueError):
        return None
    return clearance if math.isfinite(clearance) and clearance > 0.0 else None


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
