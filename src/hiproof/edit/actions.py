"""One edit of a building, as the page asks for it: parts in, a building out, by the functions of
`parametric`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..errors import InputError
from ..model import Building, Quality
from ..parametric.arrange import dormer_on, merged_parts, split_part
from ..parametric.building import build
from ..parametric.change import changed_part
from ..parametric.edit import BY_HAND
from ..parametric.recess import placed, with_recess
from ..parametric.record import building_of, list_at, mapping, number, place
from ..parametric.refit import fitted_again, measured, refitted_parts, within
from ..settings import Settings
from ..status import Status

Record = Mapping[str, Any]


def edited(
    record: Record, asked: Any, points: np.ndarray, settings: Settings, is_measured: bool = True
) -> Building:
    """The building of `record` (an object of parameters.jsonl) after the edit `asked`: {"action":
    ..., "part": ..., ...}.

    points: world points (n, 3) it is refitted to and measured on, unless a hand still drags
    (`is_measured` False). settings: those of its run. Raises InputError, FitError or
    CompositionError, one sentence, for an edit that makes no building.

    >>> ring = [[-6, -4], [6, -4], [6, 4], [-6, 4], [-6, -4]]
    >>> flat = {"type": "flat", "position": [0, 0, 5], "parameters": {"width": 8, "length": 12}}
    >>> shed = {"id": "shed", "origin": [0, 0, 0], "outline": [ring], "z_ground": 0,
    ...     "parts": [flat]}
    >>> gable = {"action": "change", "part": 0, "change": {"type": "gable", "height": 3}}
    >>> edited(shed, gable, np.zeros((0, 3)), Settings()).type
    'gable'
    """
    action = mapping(asked, "an edit").get("action")
    if action not in ACTIONS:
        raise InputError(f"expected an edit ({', '.join(ACTIONS)}), got {action!r:.40}; choose one")
    parts = ACTIONS[action](record, list_at(record, "parts"), asked, points)
    found = build(by_hand(record) | {"parts": parts}, settings.compose)
    found = dataclasses.replace(found, quality=Quality())  # no figure of the earlier model stays
    found = fitted_again(found) if action == "refit" else found
    local = found.roof.frame.to_local(points)
    return measured(found, local) if is_measured and len(local) else found


def by_hand(record: Record) -> dict[str, Any]:
    return {**record, "status": Status.MODELLED.code, "quality": None, "detail": BY_HAND}


def shown(record: Record, parts: list, asked: Record, points: np.ndarray) -> list:
    """Nothing changed: the building as its parts say."""
    return parts


def change(record: Record, parts: list, asked: Record, points: np.ndarray) -> list:
    """Part `part` with the values of `change`, as `Building.with_part` takes them."""
    index = part_at(parts, asked, "part")
    return placed(
        parts,
        index,
        changed_part(
            parts[index], dict(mapping(asked.get("change"), "change")), record["origin"][2]
        ),
    )


def remove(record: Record, parts: list, asked: Record, points: np.ndarray) -> list:
    index = part_at(parts, asked, "part")
    if len(parts) < 2:
        raise InputError(
            "expected two or more parts to leave one out, got one; keep it, or change its type"
        )
    return [*parts[:index], *parts[index + 1 :]]


def split(record: Record, parts: list, asked: Record, points: np.ndarray) -> list:
    """Part `part` cut across `side` at `share` of it."""
    index = part_at(parts, asked, "part")
    share = number(asked.get("share", 0.5), "share")
    return [
        *parts[:index],
        *split_part(parts[index], asked.get("side", "length"), share),
        *parts[index + 1 :],
    ]


def merge(record: Record, parts: list, asked: Record, points: np.ndarray) -> list:
    """Parts `part` and `other` as one, in the place of the first."""
    first, second = part_at(parts, asked, "part"), part_at(parts, asked, "other")
    if first == second:
        raise InputError("expected two parts to merge, got one twice; choose another")
    merged = merged_parts(parts[first], parts[second])
    return [
        merged if index == first else part for index, part in enumerate(parts) if index != second
    ]


def dormer(record: Record, parts: list, asked: Record, points: np.ndarray) -> list:
    """A dormer on part `part` at `place`, [x, y, z] about the origin, or half-way up its slope."""
    index = part_at(parts, asked, "part")
    roof = building_of(record)[1]
    return [*parts, dormer_on(roof, index, clicked(asked))] if roof is not None else parts


def recess(record: Record, parts: list, asked: Record, points: np.ndarray) -> list:
    """A recess in part `index` at `place`, or in its middle."""
    index = part_at(parts, asked, "part")
    roof = building_of(record)[1]
    return with_recess(parts, roof, index, clicked(asked)) if roof is not None else parts


def clicked(asked: Record) -> tuple[float, float] | None:
    """Where the roof was clicked, x and y about the origin."""
    if asked.get("place") is None:
        return None
    x, y, _ = place(asked["place"], "place").tolist()
    return x, y


def refit(record: Record, parts: list, asked: Record, points: np.ndarray) -> list:
    """All parts fitted to the points again but for what is `held`."""
    roof = building_of(record)[1]
    return (
        parts if roof is None else refitted_parts(roof, parts, within(roof, points), held_of(asked))
    )


ACTIONS: dict[str, Callable[[Record, list, Record, np.ndarray], list]] = {
    "show": shown,
    "change": change,
    "remove": remove,
    "split": split,
    "merge": merge,
    "dormer": dormer,
    "recess": recess,
    "refit": refit,
}


def part_at(parts: list, asked: Record, name: str) -> int:
    """The index of a part that an edit names."""
    index = asked.get(name)
    if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(parts):
        raise InputError(
            f"expected {name} from 0 to {len(parts) - 1}, got {index!r:.40}; choose one of the "
            "parts"
        )
    return index


def held_of(asked: Record) -> dict[int, tuple[str, ...]]:
    """What a refit holds: names of parameters, and "z", by part."""
    held = mapping(asked.get("held") or {}, "held")
    try:
        return {int(index): tuple(map(str, names)) for index, names in held.items()}
    except (TypeError, ValueError) as error:
        raise InputError(
            f"expected held as names by part, got {error}; give part numbers and lists"
        ) from error
