"""Figures of finished models, one row a building, and summaries.

Models are measured against points, footprints and a reference model.

A building's points are those of the building classes inside its footprint; without footprints,
inside the plan outline of its own roof (which then cannot show points that the outline left out,
and the IoU is with their alpha shape).
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from ..compose.settle import round_number
from ..frames import LocalFrame
from ..model import ROOF, Quality, Solid
from ..model.roof_figures import roof_figures
from .metrics import compute_share_within_20cm, iou, plan_outline, quality, well_inside
from .models import BuildingModel

TEXT_COLUMNS = ("id", "type", "status", "quality", "ref_id")  # columns that are no figures


@dataclass(frozen=True)
class Comparison:
    """The differences of a model from its reference in m, degrees and m3, NaN if unknown."""

    reference_id: str
    ridge_height_m: float = float("nan")
    slope_deg: float = float("nan")
    azimuth_deg: float = float("nan")
    volume_m3: float = float("nan")
    volume_relative: float = float("nan")
    plan_iou: float = float("nan")


@dataclass(frozen=True)
class BuildingFigures:
    """All figures of one building."""

    id: str
    type: str
    status: str
    quality: Quality = field(default_factory=Quality)
    volume_m3: float = float("nan")
    comparison: Comparison | None = None
    grade: str = ""

    def row(self) -> dict[str, Any]:
        """Return one flat record, the comparison's columns prefixed with `ref_`."""
        row = {
            "id": self.id,
            "type": self.type,
            "status": self.status,
            "quality": self.grade,
            **asdict(self.quality),
        }
        row["volume_m3"] = self.volume_m3
        if self.comparison is not None:
            row |= {
                f"ref_{name.removeprefix('reference_')}": v
                for name, v in asdict(self.comparison).items()
            }
        return row


def evaluate_building(
    model: BuildingModel,
    points: np.ndarray,
    footprint: shapely.Polygon | None = None,
    reference: BuildingModel | None = None,
) -> BuildingFigures:
    """Return the figures of a model against `points` (n, 3), footprint and another model."""
    if model.solid is None:
        share = compute_share_within_20cm(
            np.full(len(points), np.inf), well_inside(points, footprint or shapely.Polygon())
        )
        missed = Quality(points=len(points), share_within_20cm=share)
        return BuildingFigures(model.id, model.roof_type, model.status, missed)
    frame = LocalFrame.around(model.solid.vertices)
    solid = model.solid.move(-frame.origin)
    local = frame.to_local(points).reshape(-1, 3)
    outline = None if footprint is None else shapely.transform(footprint, frame.to_local)
    return BuildingFigures(
        model.id,
        model.roof_type,
        model.status,
        quality(solid, local, outline),
        roof_figures(solid).volume_m3 if solid.select_faces(ROOF) else float("nan"),
        None
        if reference is None or reference.solid is None
        else compare(model.solid, reference.id, reference.solid),
        model.grade,
    )


def compare(solid: Solid, reference_id: str, reference: Solid) -> Comparison:
    """Return the differences of two solids in one frame, that of azimuths signed and least."""
    if not (solid.select_faces(ROOF) and reference.select_faces(ROOF)):
        return Comparison(reference_id)
    figures, theirs = roof_figures(solid), roof_figures(reference)
    turn = (figures.azimuth_deg - theirs.azimuth_deg + 180) % 360 - 180
    volume = figures.volume_m3 - theirs.volume_m3
    return Comparison(
        reference_id,
        figures.h_ridge - theirs.h_ridge,
        figures.slope_deg - theirs.slope_deg,
        turn,
        volume,
        volume / theirs.volume_m3 if theirs.volume_m3 > 0 else float("nan"),
        iou(plan_outline(solid), plan_outline(reference)),
    )


def points_by_outline(
    points: np.ndarray, outlines: Sequence[shapely.Geometry | None]
) -> list[np.ndarray]:
    """Return the points (m, 3) inside each outline in their order, none for None."""
    areas = np.array(
        [outline if outline is not None else shapely.Polygon() for outline in outlines],
        dtype=object,
    )
    if not len(areas):
        return []
    tree = shapely.STRtree(areas)
    point_of, area_of = tree.query(shapely.points(points[:, :2]), predicate="intersects")
    order = np.lexsort((point_of, area_of))
    bounds = np.searchsorted(area_of[order], np.arange(len(areas) + 1))
    return [points[point_of[order[a:b]]] for a, b in pairwise(bounds)]


def match_by_id_or_overlap(
    models: Sequence[BuildingModel], neighbours: Sequence[tuple[str, shapely.Geometry]]
) -> list[int | None]:
    """Return the index of each model's area: the one of its id, or one that overlaps it more.

    Another area counts where it overlaps the model in plan more than twice as much: ids that are
    numbers name other buildings in another file.
    """
    by_id = {id: i for i, (id, _) in enumerate(neighbours)}
    areas = np.array([area for _, area in neighbours], dtype=object)
    tree = shapely.STRtree(areas)
    result: list[int | None] = []
    for model in models:
        match = by_id.get(model.id)
        if len(areas) and model.solid is not None:
            outline = plan_outline(model.solid)
            candidates = np.sort(tree.query(outline, predicate="intersects"))
            overlaps = shapely.area(shapely.intersection(outline, areas[candidates]))
            if overlaps.any() and overlaps[candidates == match].sum() < 0.5 * overlaps.max():
                match = int(candidates[np.argmax(overlaps)])
        result.append(match)
    return result


def summarise(figures: Sequence[BuildingFigures]) -> dict[str, dict[str, Any]]:
    """Summarise figures: count, mean, median, 90th percentile, overall and per roof type."""
    groups = {"all": list(figures)}
    for kind in sorted({f.type for f in figures}):
        groups[kind] = [f for f in figures if f.type == kind]
    return {
        name: {"buildings": len(group), **column_summaries(group)} for name, group in groups.items()
    }


def column_summaries(figures: Sequence[BuildingFigures]) -> dict[str, dict[str, float]]:
    rows = [f.row() for f in figures]
    summaries = {}
    for name in [name for name in list_columns(rows) if name not in TEXT_COLUMNS]:
        values = np.array([row.get(name, np.nan) for row in rows], float)
        values = values[np.isfinite(values)]
        if len(values):
            middle, upper = np.percentile(values, (50, 90))
            summaries[name] = {
                "mean": round_number(values.mean()),
                "median": round_number(middle),
                "p90": round_number(upper),
            }
    return summaries


def list_columns(rows: list[dict[str, Any]]) -> list[str]:
    """Return the columns of all rows in the order of the longest."""
    return list(dict.fromkeys(name for row in sorted(rows, key=len, reverse=True) for name in row))


def to_csv(figures: Sequence[BuildingFigures]) -> str:
    """Format figures as a header and a line a building; empty without figures."""
    rows = [f.row() for f in figures]
    columns = list_columns(rows) or [*TEXT_COLUMNS[:4], *(f.name for f in fields(Quality))]
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: round_figure(value) for name, value in row.items()} for row in rows)
    return text.getvalue()


def to_json(figures: Sequence[BuildingFigures]) -> str:
    """Format the summary and every row as JSON; null where there is no figure."""
    rows = [{name: round_figure(value) for name, value in f.row().items()} for f in figures]
    return (
        json.dumps({"summary": summarise(figures), "buildings": rows}, indent=1, allow_nan=False)
        + "\n"
    )


def round_figure(value: Any) -> Any:
    """Round a figure; None where it is NaN, text as it is."""
    if isinstance(value, float):
        return round_number(value) if np.isfinite(value) else None
    return value
