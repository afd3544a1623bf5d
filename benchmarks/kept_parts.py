"""Do changed buildings keep what did not change?

`benchmarks.changes` prints these figures of its simulated cities. The truth of a place is the
difference between the two roofs that were scanned there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from hiproof.model import Roof
from hiproof.parametric.building import build
from hiproof.parametric.file import read_parameters
from hiproof.parametric.record import polygon
from hiproof.update.lineage import make_grid, show_parts

SAME_M = 0.05  # differences of the true roofs below which a place did not change
OTHER_M = 0.15  # differences of the models from which on they show a change
SAME_SHARE = 0.9  # of the places of a part, or of a change, that did not change
SHAPE = ("type", "parameters", "rotation")
EXACT = (*SHAPE, "position")


def count_kept(folder: Path, roofs: Mapping[str, tuple[Roof, Roof]]) -> Counter[str]:
    """Count parts and places of changed buildings, by true roofs before and after."""
    counts: Counter[str] = Counter()
    before, after = (read_records(folder / name) for name in ("models", "updated"))
    for id, truth in roofs.items():
        old, new = before.get(id), after.get(id)
        if old is None or new is None or not new.get("change") or not new["change"]["lineage"]:
            continue
        counts += count_parts(old, new, truth)
    return counts


def read_records(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the objects of parameters.jsonl that have parts, by id."""
    records = read_parameters(folder / "parameters.jsonl")
    return {record["id"]: record for record in records if record["parts"]}


def count_parts(old: dict[str, Any], new: dict[str, Any], truth: tuple[Roof, Roof]) -> Counter[str]:
    """Count the parts, places and areas of a changed building."""
    models = build(old), build(new)
    xy = make_grid(models[0].roof.outline) + models[0].roof.frame.origin[:2]
    heights = [measure_heights(roof, xy) for roof in truth]
    known = np.isfinite(heights).all(axis=0)
    xy, d = xy[known], (heights[1] - heights[0])[known]
    is_same = np.abs(d) < SAME_M
    counts: Counter[str] = Counter(buildings=1)
    shown = show_parts(models[0].roof, xy - models[0].roof.frame.origin[:2])
    lineage = new["change"]["lineage"]
    for number, part in enumerate(old["parts"]):
        here = d[shown == number]
        if not len(here) or np.mean(np.abs(here - np.median(here)) < SAME_M) < SAME_SHARE:
            continue
        kind = "unchanged" if abs(np.median(here)) < SAME_M else "moved"
        names = EXACT if kind == "unchanged" else SHAPE
        counts[f"{kind} parts"] += 1
        counts[f"{kind} continued"] += number in lineage
        counts[f"{kind} kept"] += any(is_equal(part, other, names) for other in new["parts"])
    a, b = (np.nan_to_num(measure_heights(model.roof, xy)) for model in models)
    counts["unchanged places"] += int(is_same.sum())
    counts["differ"] += int((is_same & (np.abs(b - a) > OTHER_M)).sum())
    for place in new["change"]["places"]:
        area = shapely.union_all([polygon(rings, "an outline") for rings in place["outlines"]])
        inside = is_same[shapely.intersects_xy(area, *xy.T)]
        counts["reported"] += 1
        counts["not real"] += bool(len(inside) and inside.mean() >= SAME_SHARE)
    return counts


def is_equal(part: dict[str, Any], other: dict[str, Any], names: tuple[str, ...]) -> bool:
    """Return whether two parts have the same place in plan and the same values."""
    same = part["position"][:2] == other["position"][:2]
    return same and all(part[name] == other[name] for name in names)


def measure_heights(roof: Roof, xy: np.ndarray) -> np.ndarray:
    """Return the height (n,) of a roof at places (n, 2) in the world."""
    return roof.height_at(xy - roof.frame.origin[:2]) + roof.frame.origin[2]


def describe_kept(counts: Counter[str]) -> dict[str, float]:
    """Return shares of parts that are kept, and of places that differ or are reported."""
    figures: dict[str, float] = {"changed buildings with a new model": counts["buildings"]}
    for kind, what in (("unchanged", "their parameters"), ("moved", "all but their heights")):
        parts = counts[f"{kind} parts"]
        figures[f"{kind} parts"] = parts
        figures[f"{kind} parts that are continued"] = counts[f"{kind} continued"] / max(parts, 1)
        figures[f"{kind} parts that keep {what}"] = counts[f"{kind} kept"] / max(parts, 1)
    places = max(counts["unchanged places"], 1)
    figures["unchanged places at which models differ"] = counts["differ"] / places
    figures["reported places"] = counts["reported"]
    figures["reported places that did not change"] = counts["not real"]
    return figures
