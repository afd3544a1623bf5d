"""One edit of a building, as the page requests it, by the functions of `parametric`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..model import Building, Quality
from ..parametric.arrange import add_dormer, merge_parts, replace_part, split_part, with_recess
from ..parametric.building import build
from ..parametric.change import change_part
from ..parametric.edit import BY_HAND
from ..parametric.record import list_at, number, place, read_building, require_mapping
from ..parametric.refit import measure_building, note_fit, refit_parts, select_inside
from ..settings import Settings
from ..status import Status

Record = Mapping[str, Any]
ACTIONS = ("show", "change", "remove", "split", "merge", "dormer", "recess", "refit")  # of Edit


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
    parts = getattr(Edit(record, list_at(record, "parts"), requested, points), action)()
    result = build(
        {**record, "status": Status.MODELLED.code, "quality": None, "detail": BY_HAND}
        | {"parts": parts},
        settings.compose,
    )
    result = dataclasses.replace(result, quality=Quality())  # no figure of the earlier model stays
    result = note_fit(result) if action == "refit" else result
    local = result.roof.frame.to_local(points)
    return measure_building(result, local) if is_measured and len(local) else result


class Edit(NamedTuple):
    """The object of a building, its parts, what is requested, and the world points (n, 3)."""

    record: Record
    parts: list
    requested: Record
    points: np.ndarray

    def show(self) -> list:
        """Return the parts unchanged."""
        return self.parts

    def change(self) -> list:
        """Change part `part` by the values of `change`, as `Building.with_part`."""
        index = self.part_at("part")
        change = dict(require_mapping(self.requested.get("change"), "change"))
        changed = change_part(self.parts[index], change, self.record["origin"][2])
        return replace_part(self.parts, index, changed)

    def remove(self) -> list:
        index = self.part_at("part")
        if len(self.parts) < 2:
            raise InputError(
                "expected two or more parts to leave one out, got one; keep it, or change its type"
            )
        return [*self.parts[:index], *self.parts[index + 1 :]]

    def split(self) -> list:
        """Cut part `part` across `side` at `share` of it."""
        index, share = self.part_at("part"), number(self.requested.get("share", 0.5), "share")
        halves = split_part(self.parts[index], self.requested.get("side", "length"), share)
        return [*self.parts[:index], *halves, *self.parts[index + 1 :]]

    def merge(self) -> list:
        """Merge parts `part` and `other`, in the place of the first."""
        first, second = self.part_at("part"), self.part_at("other")
        if first == second:
            raise InputError("expected two parts to merge, got one twice; choose another")
        merged = merge_parts(self.parts[first], self.parts[second])
        return [merged if k == first else p for k, p in enumerate(self.parts) if k != second]

    def dormer(self) -> list:
        """Add a dormer to part `part` at `place` [x, y, z] about the origin, or half-way up."""
        index, roof = self.part_at("part"), read_building(self.record)[1]
        return (
            self.parts
            if roof is None
            else [*self.parts, add_dormer(roof, index, self.read_click())]
        )

    def recess(self) -> list:
        """Add a recess to part `index` at `place`, or in its middle."""
        index, roof = self.part_at("part"), read_building(self.record)[1]
        return (
            self.parts if roof is None else with_recess(self.parts, roof, index, self.read_click())
        )

    def refit(self) -> list:
        """Fit all parts to the points again but for what is `held`."""
        roof = read_building(self.record)[1]
        if roof is None:
            return self.parts
        return refit_parts(roof, self.parts, select_inside(roof, self.points), self.read_held())

    def part_at(self, name: str) -> int:
        """Return the index of a part that an edit names."""
        index, count = self.requested.get(name), len(self.parts)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < count:
            raise InputError(
                f"expected {name} from 0 to {count - 1}, got {index!r:.40}; choose one of the parts"
            )
        return index

    def read_click(self) -> tuple[float, float] | None:
        """Read where the roof was clicked, x and y about the origin."""
        if self.requested.get("place") is None:
            return None
        x, y, _ = place(self.requested["place"], "place").tolist()
        return x, y

    def read_held(self) -> dict[int, tuple[str, ...]]:
        """Read what a refit holds: names of parameters, and "z", by part."""
        mapping = require_mapping(self.requested.get("held") or {}, "held")
        try:
            return {int(index): tuple(map(str, names)) for index, names in mapping.items()}
        except (TypeError, ValueError) as error:
            raise InputError(
                f"expected held as names by part, got {error}; give part numbers and lists"
            ) from error
