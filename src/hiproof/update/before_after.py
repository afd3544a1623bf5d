"""Changed buildings before and after an update.

Each model is drawn over the points of its survey.
"""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from ..data_files import fill_page, read_asset
from ..errors import escape_unseen
from ..evaluate.inputs import locate_input
from ..evaluate.metrics import psd
from ..evaluate.models import BuildingModel
from ..evaluate.report import ASSETS
from ..evaluate.report_pictures import building_pictures
from ..evaluate.run import EvaluatedRun, evaluate_run
from ..read.models.damage import Damaged, refuse
from ..write.attribute_list import OWN
from ..write.meshes.triangles import pack_values, solid_mesh

MOST_CHANGE_POINTS = 2000
"""Points of a survey drawn of a building: at 10 points/m2 all of a house, 32 kB in the page."""


def make_scene(
    before: tuple[BuildingModel, np.ndarray], after: tuple[BuildingModel, np.ndarray]
) -> dict[str, Any]:
    """Return the models and points of a building before and after."""
    places = [
        xyz
        for model, points in (before, after)
        for xyz in (points, np.empty((0, 3)) if model.solid is None else model.solid.vertices)
    ]
    corner = np.concatenate(places).min(axis=0, initial=np.inf)
    origin = np.where(np.isfinite(corner), np.floor(corner), 0.0)
    return {
        "id": after[0].id,
        "before": pack_side(*before, origin),
        "after": pack_side(*after, origin),
    }


def pack_side(model: BuildingModel, points: np.ndarray, origin: np.ndarray) -> dict[str, str]:
    """Return a model's triangles and edges, and points (n, 3), about the origin."""
    corners, edges = np.empty((0, 3, 3)), np.empty((0, 2, 3))
    if model.solid is not None:
        mesh = solid_mesh(model.solid.move(-origin))
        corners, edges = mesh.corners, mesh.edges
    drawn = points[:: max(1, -(-len(points) // MOST_CHANGE_POINTS))] - origin
    values = {"corners": corners, "edges": edges, "points": drawn}
    return {name: pack_values(array, "<f4") for name, array in values.items()}


MOST_DRAWN_CHANGES = 20  # buildings shown with pictures: as many as are read to the end
SHOWN = ("changed", "gone")  # classes of buildings that have a model before


def evaluate_earlier(record: dict[str, Any], damaged: Damaged = refuse) -> EvaluatedRun | None:
    """Return the run that an update began with, None where there is none to be found.

    `record` is run.json of the update.
    """
    named, inputs = (record.get("update") or {}).get("run"), record.get("inputs") or {}
    found = locate_input(named, inputs.get("started_in"), None) if isinstance(named, str) else None
    return None if found is None else evaluate_run(Path(found), damaged=damaged)


def find_changes(run: EvaluatedRun, earlier: EvaluatedRun | None) -> list[tuple[int, int]]:
    """Return the buildings that changed most.

    They are numbers in the update and in the earlier run. There are none where that is unknown.
    """
    if earlier is None:
        return []
    before = {model.id: number for number, model in enumerate(earlier.models)}
    changed = [
        number
        for number, model in enumerate(run.models)
        if model.attributes.get(f"{OWN}change") in SHOWN and model.id in before
    ]
    changed.sort(key=lambda number: (-measure_change(run.models[number]), number))
    return [(number, before[run.models[number].id]) for number in changed[:MOST_DRAWN_CHANGES]]


def draw_changes(
    run: EvaluatedRun, earlier: EvaluatedRun | None
) -> tuple[str, list[dict[str, Any]]]:
    """Return the report's section on changed buildings, and their scenes in 3D.

    It has those that changed most, and is empty where there are none.
    """
    pairs = find_changes(run, earlier)
    if earlier is None or not pairs:
        return "", []
    ids = [run.models[after].id for after, _ in pairs]
    options = [
        f'<option value="{number}">{escape(escape_unseen(id))}</option>'
        for number, id in enumerate(ids)
    ]
    cards = [
        draw_card(run, after, earlier, before, number)
        for number, (after, before) in enumerate(pairs)
    ]
    content = {"options": "".join(options), "cards": "".join(cards)}
    scenes = [
        make_scene(
            (earlier.models[before], earlier.points[before]), (run.models[after], run.points[after])
        )
        for after, before in pairs
    ]
    return fill_page(read_asset(f"{ASSETS}/changes.html"), content), scenes


def measure_change(model: BuildingModel) -> float:
    """Return how much (m) a building changed at its largest place."""
    value = model.attributes.get(f"{OWN}change_m")
    return abs(value) if isinstance(value, (int, float)) else 0.0


def draw_card(
    run: EvaluatedRun, after: int, earlier: EvaluatedRun, before: int, number: int
) -> str:
    """Return the card of a building with its pictures before and after.

    Its button shows the building of that number in 3D.
    """
    model = run.models[after]
    words = [model.attributes.get(f"{OWN}{name}") for name in ("change", "change_kind")]
    text = ", ".join(str(word).replace("_", " ") for word in words if word)
    change = model.attributes.get(f"{OWN}change_m")
    text += f", {change:+.2f} m" if isinstance(change, (int, float)) else ""
    rows = "".join(
        f"<div><p>{label}</p>{draw_model(*side)}</div>"
        for label, side in (
            ("before", (earlier.models[before], earlier.points[before])),
            ("after", (model, run.points[after])),
        )
    )
    button = (
        f'<button type="button" data-change="{number}">{escape(escape_unseen(model.id))}</button>'
    )
    caption = f"<figcaption>{button} {escape(text)}</figcaption>"
    return f'<figure class="change">{rows}{caption}</figure>'


def draw_model(model: BuildingModel, points: np.ndarray) -> str:
    """Return the pictures of a model with its points, or that there is none."""
    if model.solid is None:
        return "<p>no model</p>"
    origin = model.solid.vertices.min(axis=0)
    distances = psd(model.solid, points)
    solid = model.solid.move(-origin)
    return building_pictures(solid, points - origin, distances, model.part_types)
