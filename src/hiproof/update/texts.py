"""Texts of unchanged buildings, taken from the earlier run as they are.

A run keeps the texts of its buildings by work tile. They still hold where the line of a building in
parameters.jsonl does, and where the files of both runs have the same head. So what is unchanged is
neither composed nor written anew.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from .. import __version__
from ..city.merge.join import list_text_files
from ..city.plan.work_plan import PLAN_FILE, WorkPlan
from ..errors import HiproofError
from ..evaluate.run import run_record
from ..model import Building
from ..parametric.building import build
from ..write.files import STATE_FOLDER
from ..write.fragments import Fragments, load_fragments
from ..write.head import FileHead
from ..write.naming import gml_name
from ..write.parameters import head_record
from ..write.run_files import fragments
from ..write.values import dump
from .earlier import RUN_PARAMETERS

LINES = "parameters"  # the module whose texts are the lines of parameters.jsonl


@dataclass(frozen=True)
class KeptBuilding(Building):
    """An unchanged building that is not composed: its `texts` are there.

    `main_type` is the type that its record names.
    """

    texts: Fragments = field(default_factory=dict)
    main_type: str | None = None

    @property
    def type(self) -> str | None:
        """Roof type of the part that shows the largest area."""
        return self.main_type


def find_texts(run: Path, plan: WorkPlan) -> str:
    """Return the state folder of `run`, "" where its texts are not those of this plan.

    They have to be made by this version, with the same head and the same names.
    """
    state = Path(run) / STATE_FOLDER
    try:
        with (state / PLAN_FILE).open("rb") as plans, (run / RUN_PARAMETERS).open("rb") as lines:
            names, head = json.loads(plans.readline())["names"], json.loads(lines.readline())
    except (OSError, ValueError, KeyError):
        return ""
    head.pop("update", None)  # every update has its own
    is_same = dump(head) == dump(head_record(plan.head)) and not names and not plan.names
    return str(state.absolute()) if is_same and run_record(run)["hiproof"] == __version__ else ""


def load_texts(state: str, tile: str, head: FileHead) -> dict[bytes, Fragments]:
    """Return the texts of a tile's buildings by their line.

    There are none where they are lost, or where those of the first building are no longer what is
    made of it: then the code is another.
    """
    files = list_text_files(Path(state), tile) if state else []
    try:
        texts = {part[LINES].text: part for file in files for part in load_fragments(file)}
        line, first = next(iter(texts.items()))
        building = build(json.loads(line), head.compose)
        names = building.id, gml_name(building.id)
        return texts if fragments(building, names, head)[1] == first else {}
    except (HiproofError, ValueError, KeyError, StopIteration):
        return {}


def keep_texts(
    building: Building, record: dict[str, Any], texts: dict[bytes, Fragments]
) -> KeptBuilding | None:
    """Return the building of a record with its texts, None where `texts` lack them."""
    found = texts.get(dump(record) + b"\n")
    if found is None:
        return None
    values = {item.name: getattr(building, item.name) for item in fields(building)}
    return KeptBuilding(**values, texts=found, main_type=record["type"])
