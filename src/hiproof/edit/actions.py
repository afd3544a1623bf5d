"""One edit of a building, as the page requests it, by the functions of `parametric`."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..errors import InputError
from ..model import Building, Quality
from ..parametric.arrange import add_dormer, merged_parts, replace_part, split_part, with_recess
from ..parametric.building import build
from ..parametric.change import changed_part
from ..parametric.edit import BY_HAND
from ..parametric.record import list_at, number, place, read_building, require_mapping
from ..parametric.refit import measure_building, note_fit, refit_parts, select_inside
from ..settings import Settings
from ..status import Status

Record = Mapping[str, Any]


def apply_edit(
    record: Record, requested: Any, points: np.ndarray, settings: Settings, is_measured: bool = True
) -> Building:
    """Build `record` (an object of parameters.jsonl) after the edit `requested`.

    requested: {"action": ..., "part": ..., ...}. points: world points (n, 3) it is refitted to and
    measured on, unless a hand still drags (`is_measured` False). settings: those of its run. Raises
    InputError, FitError or CompositionError, one sentence, for an edit that makes no building.

    >>> ring = [[-6, -4], [6, -4], [6, 4], [-6, 4], [-6, -4]]
    >>> flat = {"type": "flat", "position": [0, 0, 5], "parameters": {"width": 8, "length": 12}}
    >>> shed = {"id": "shed", "origin": [0, 0, 0], "outline": [ring], "z_ground": 0,
    ...     "parts": [flat]}
    >>> gable = {"action": "change", "part": 0, "change": {"type": "gable", "height": 3}}
    >>> apply_edit(shed, gable, np.zeros((0, 3)), Settings()).type
    'gable'
    """
    action = require_mapping(requested, "an edit").get("action")
    if action not in ACTIONS:
        raise InputError(f"expected an edit ({', '.join(ACTIONS)}), got {action!r:.40}; choose one")
    parts = ACTIONS[action](record, list_at(record, "parts"), requested, points)
    result = build(
        {**record, "status": Status.MODELLED.code, "quality": None, "detail": BY_HAND}
        | {"parts": parts},
        settings.compose,
    )
    result = dataclasses.replace(result, quality=Quality())  # no figure of the earlier model stays
    result = note_fit(result) if action == "refit" else result
    local = result.roof.frame.to_local(points)
    return measure_building(result, local) if is_measured and len(local) else result


def show_parts(record: Record, parts: list, requested: Record, points: np.ndarray) -> list:
    """Return the parts unchanged."""
    return parts


def change(record: Record, parts: list, requested: Record, points: np.ndarray) -> list:
    """Change part `part` by the values of `change`, as `Building.with_part`."""
    index = part_at(parts, requested, "part")
    return replace_part(
        parts,
        index,
        changed_part(
            parts[index],
            dict(require_mapping(requested.get("change"), "change")),
            record["origin"][2],
        ),
    )


def remove(record: Record, parts: list, requested: Record, points: np.ndarray) -> list:
    index = part_at(parts, requested, "part")
    if len(parts) < 2:
        raise InputError(
            "expected two or more parts to leave one out, got one; keep it, or change its type"
        )
    return [*parts[:index], *parts[index + 1 :]]


def split_part_at(record: Record, parts: list, requested: Record, points: np.ndarray) -> list:
    """Cut part `part` across `side` at `share` of it."""
    index = part_at(parts, requested, "part")
    share = number(requested.get("share", 0.5), "share")
    return [
        *parts[:index],
        *split_part(parts[index], requested.get("side", "length"), share),
        *parts[index + 1 :],
    ]


def merge(record: Record, parts: list, requested: Record, points: np.ndarray) -> list:
    """Merge parts `part` and `other`, in the place of the first."""
    first, second = part_at(parts, requested, "part"), part_at(parts, requested, "other")
    if first == second:
        raise InputError("expected two parts to merge, got one twice; choose another")
    merged = merged_parts(parts[first], parts[second])
    return [
        merged if index == first else part for index, part in enumerate(parts) if index != second
    ]


def dormer(record: Record, parts: list, requested: Record, points: np.ndarray) -> list:
    """Add a dormer to part `part` at `place` [x, y, z] about the origin, or half-way up."""
    index = part_at(parts, requested, "part")
    roof = read_building(record)[1]
    return [*parts, add_dormer(roof, index, read_click(requested))] if roof is not None else parts


def recess(record: Record, parts: list, requested: Record, points: np.ndarray) -> list:
    """Add a recess to part `index` at `place`, or in its middle."""
    index = part_at(parts, requested, "part")
    roof = read_building(record)[1]
    return with_recess(parts, roof, index, read_click(requested)) if roof is not None else parts


def read_click(requested: Record) -> tuple[float, float] | None:
    """Read where the roof was clicked, x and y about the origin."""
    if requested.get("place") is None:
        return None
    x, y, _ = place(requested["place"], "place").tolist()
    return x, y


def refit(record: Record, parts: list, asked: Record, points: np.ndarray) -> list:
    """Fit all parts to the points again but for what is `held`."""
    roof = read_building(record)[1]
    return (
        parts
        if roof is None
        else refit_parts(roof, parts, select_inside(roof, points), read_held(asked))
    )


ACTIONS: dict[str, Callable[[Record, list, Record, np.ndarray], list]] = {
    "show": show_parts,
    "change": change,
    "remove": remove,
    "split": split_part_at,
    "merge": merge,
    "dormer": dormer,
    "recess": recess,
    "refit": refit,
}


def part_at(parts: list, requested: Record, name: str) -> int:
    """Return the index of a part that an edit names."""
    index = requested.get(name)
    if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(parts):
        raise InputError(
            f"expected {name} from 0 to {len(parts) - 1}, got {index!r:.40}; choose one of the "
            "parts"
        )
    return index


def read_held(requested: Record) -> dict[int, tuple[str, ...]]:
    """Read what a refit holds: names of parameters, and "z", by part."""
    mapping = require_mapping(requested.get("held") or {}, "held")
    try:
        return {int(index): tuple(map(str, names)) for index, names in mapping.items()}
    except (TypeError, ValueError) as error:
        raise InputError(
            f"expected held as names by part, got {error}; give part numbers and lists"
        ) from error
