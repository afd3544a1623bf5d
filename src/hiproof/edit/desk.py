"""The requests that the page may make: buildings, points, edits, and accept or take back."""

from __future__ import annotations

import datetime
import functools
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..city.plan.overrides import read_overrides
from ..draw.primitives import primitive_svg
from ..errors import HiproofError, InputError, InputWarning
from ..evaluate.inputs import found_inputs
from ..evaluate.run import run_record
from ..log import LOGGER
from ..parametric.building import build
from ..parametric.record import list_at, number, text_at
from ..primitives.catalogue import CATALOGUE
from ..read.models.damage import finite
from ..status import Attention
from ..write.meshes.triangles import pack_values
from ..write.parameters import building_record
from ..write.values import plain_text
from .actions import apply_edit
from .edits import EDITS_FILE, Edits
from .folder import BuildingRow, RunFolder
from .points import RunPoints
from .seen import describe_building, select_points

MOST_ROWS = 500  # of the list at once; others are found by their id
MOST_NOTE = 500  # characters of a note or a name; a sentence or two
BELONGS = ("origin", "outline", "z_ground", "parts")  # of an accepted edit, in place of the run's
SAID = ("z_ground", "leave_out")  # of the building as a whole, by a person


class Desk:
    """The buildings of the run in `folder`, and the edits that `who` accepts.

    The run's files may have `moved_to` another folder. `only` names kinds of attention or ids of
    buildings, and limits the list to these.
    """

    def __init__(
        self, folder: Path, who: str, moved_to: Path | None = None, only: Sequence[str] = ()
    ) -> None:
        self.run, self.who = RunFolder(folder), plain_text(who)[:MOST_NOTE]
        self.only = frozenset(only)
        self.refuse_unknown()
        self.edits = Edits(folder, obeyed_by(folder, moved_to))
        self.points = RunPoints(folder, moved_to)

    def buildings(self, find: str = "") -> dict[str, Any]:
        """Return the most doubtful buildings, of those whose id holds `find`."""
        self.run.refresh()
        self.edits.of("")
        wanted = self.select_rows()
        result = [row for row in wanted if find in row.id]
        rows = [self.row(row) for row in result[:MOST_ROWS]]
        accepted = sum(row.id in self.edits.records for row in wanted)
        return {"rows": rows, "found": len(result), "all": len(wanted), "accepted": accepted}

    def select_rows(self) -> list[BuildingRow]:
        """Return the buildings of the list, the most doubtful first."""
        if not self.only:
            return self.run.rows
        return [row for row in self.run.rows if self.only & names_of(row)]

    def refuse_unknown(self) -> None:
        """Raise InputError where `only` names what no building of the run is or has."""
        kinds = [kind.code for kind in Attention]
        known = {name for row in self.run.rows for name in names_of(row)}
        for name in sorted(self.only - known):
            if name not in kinds:
                raise InputError(
                    f"expected --only to name {', '.join(kinds)} or ids of buildings in "
                    f"{self.run.folder}, got {name!r:.80}; check the name"
                )
            LOGGER.warning("no building of the run in %s is %s", self.run.folder, name)

    def row(self, row: BuildingRow) -> dict[str, Any]:
        return {
            "id": row.id,
            "type": row.type,
            "share": row.share,
            "doubt": row.doubt.amount,
            "reasons": row.doubt.reasons,
            "is_accepted": row.id in self.edits.records,
        }

    def record(self, id: str) -> tuple[dict[str, Any], dict[str, Any] | None, str]:
        """Return a building's object as accepted, its override, and its version."""
        record, (override, version) = self.run.record(id), self.edits.of(id)
        if override and isinstance(override.get("parts"), list):
            record = record | {name: override[name] for name in BELONGS if name in override}
        return record, override, version

    def building(self, id: str) -> dict[str, Any]:
        """Return a building as it is now, with mesh and parts, or a sentence why without."""
        record, override, version = self.record(id)
        authorship = {name: (override or {}).get(name) for name in ("who", "when", "note")}
        detail = finite(record.get("detail")) or ""
        result = {
            "id": id,
            "version": version,
            "accepted": authorship if override else None,
            "parts": finite(record.get("parts")),
        }
        result["said"] = {name: (override or {}).get(name) for name in SAID}
        result |= {"outcome": detail, "reasons": self.run.by_id[id].doubt.reasons}
        if not record.get("parts"):
            return result | {"error": detail or "no model"}
        try:
            return result | describe_building(
                build(record, self.run.head.compose), np.zeros((0, 3))
            )
        except HiproofError as error:
            return result | {"error": str(error)}

    def cloud(self, id: str) -> dict[str, Any]:
        """Return the points drawn, about the roof's origin; `missing` says why there are none."""
        record = self.record(id)[0]
        points = self.points.of(record)
        missing = self.points.missing or (
            "" if len(points) else "the run has no points of this building"
        )
        places = pack_values(select_points(points) - record["origin"], "<f4") if len(points) else ""
        return {"places": places, "count": len(points), "missing": missing}

    def draft(self, id: str, body: Mapping[str, Any]) -> dict[str, Any]:
        """Return a building's object with the page's `parts`, and a person's `z_ground`."""
        record = self.record(id)[0] | {
            "parts": list_at(body, "parts"),
            "terrain_line": [],
        }  # which no edit changes or shows
        if body.get("z_ground") is None:
            return record | {"z_ground": self.run.record(id).get("z_ground")}
        return record | {
            "z_ground": number(body["z_ground"], "z_ground"),
            "ground_source": "override",
        }

    def change(self, id: str, body: Mapping[str, Any]) -> dict[str, Any]:
        """Return the building after the edit `asked`, unmeasured while a hand drags (`dragged`)."""
        record = self.draft(id, body)
        points = self.points.of(record)
        edit = apply_edit(
            record, body.get("asked"), points, self.run.settings, not body.get("dragged")
        )
        return describe_building(edit, select_points(points))

    def alternatives(self, id: str, body: Mapping[str, Any]) -> dict[str, Any]:
        """Return every type that part `part` may have, refitted, by points that it explains."""
        record = self.draft(id, body)
        points, candidates = self.points.of(record), []
        for kind in CATALOGUE:
            requested = {"action": "change", "part": body.get("part"), "change": {"type": kind}}
            try:
                changed = building_record(
                    apply_edit(record, requested, points, self.run.settings, False)
                )
                edit = apply_edit(changed, {"action": "refit"}, points, self.run.settings)
            except HiproofError:
                continue
            share = edit.quality.share_within_20cm
            shown = round(float(share), 4) if np.isfinite(share) else None
            candidates.append({"type": kind, "share": shown})
        return {"types": sorted(candidates, key=lambda row: -(row["share"] or 0.0))}

    def accept(self, id: str, body: Mapping[str, Any]) -> dict[str, Any]:
        """Keep the page's building as an override, if the page knows its `version`."""
        self.run.record(id)
        is_out = body.get("leave_out") is True
        override = {"id": id} | ({"leave_out": True} if is_out else self.make_override(id, body))
        current = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        note = plain_text(text_at(body, "note")).strip()[:MOST_NOTE]
        override |= {"who": self.who, "when": current} | ({"note": note} if note else {})
        return {"version": self.edits.put(id, override, text_at(body, "version")), "when": current}

    def make_override(self, id: str, body: Mapping[str, Any]) -> dict[str, Any]:
        """Return the override of a building as the page has it, which can be built."""
        nothing = np.zeros((0, 3))
        record = building_record(
            apply_edit(self.draft(id, body), {"action": "show"}, nothing, self.run.settings)
        )
        override = (
            BELONGS
            if body.get("z_ground") is not None
            else [name for name in BELONGS if name != "z_ground"]
        )
        return {name: record[name] for name in override}

    def withdraw(self, id: str, body: Mapping[str, Any]) -> dict[str, Any]:
        """Take an accepted edit back: the building is the run's again."""
        self.run.record(id)
        return {"version": self.edits.put(id, None, text_at(body, "version"))}


@functools.cache
def render_drawing(kind: str) -> str:
    """Return the figure of a roof type as SVG; raises InputError for no type."""
    if kind not in CATALOGUE:
        raise InputError(
            f"expected a roof type ({', '.join(CATALOGUE)}), got {kind!r:.40}; choose one"
        )
    return primitive_svg(kind)


def names_of(row: BuildingRow) -> set[str]:
    """Return the names by which `--only` finds a building: its id and kinds of attention."""
    return {row.id, *(kind.code for kind in row.attention)}


def obeyed_by(folder: Path, moved_to: Path | None = None) -> dict[str, dict[str, Any]]:
    """Return the overrides that the run in `folder` used.

    One file then holds them and the edits. Where edits were accepted already, these hold them.
    """
    record = run_record(folder)
    overrides = (record.get("inputs") or {}).get("overrides")
    path = found_inputs(record, moved_to).overrides
    if not overrides or (folder / EDITS_FILE).exists():
        return {}
    if path is None:
        warnings.warn(
            f"{folder}: the overrides that the run obeyed are gone ({overrides}): a run with "
            f"{EDITS_FILE} will do without them; bring them back, or say with --clouds FOLDER "
            "where the run's files lie now",
            InputWarning,
        )
        return {}
    return dict(read_overrides(path))
