"""One self-contained HTML page about a run: map, 3D view, distributions, worst buildings.

The page opens from the file system and asks nothing of the network: styles, scripts and data are in
it.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..data_files import fill_page, read_asset, read_data_file
from ..errors import escape_unseen
from ..log import count_things
from ..masking import masked_values
from ..primitives.catalogue import describe_type
from ..status import Grade, Status
from .evaluation import summarise
from .metrics import psd
from .overview import BuildingOutcome, Overview, show_command
from .report_data import places_on_map, report_data
from .report_pictures import building_pictures, histogram
from .run import EvaluatedRun

ASSETS = "evaluate/assets"  # the folder of what the page is made of

WORST = 20  # buildings shown with pictures: as many as are read to the end
# Buildings on the map and in the 3D view, about 10 kB each: beyond this, browsers grow slow.
MOST_SHOWN = 10_000

TEXTS = read_data_file("run")


def write_report(
    path: Path,
    run: EvaluatedRun,
    title: str = "hiproof",
    changes: tuple[str, list[dict[str, Any]]] = ("", []),
) -> None:
    """Write the page to `path`. Raises OutputError when the file cannot be written.

    `changes` are the section on changed buildings, and their scenes in 3D.
    """
    from ..write.files import atomic_file

    page = report_html(run, title, changes=changes)
    with atomic_file(path) as file:
        file.write(page.encode())


def report_html(
    run: EvaluatedRun,
    title: str = "hiproof",
    most_shown: int = MOST_SHOWN,
    changes: tuple[str, list[dict[str, Any]]] = ("", []),
) -> str:
    """Return the page as text, its map of `most_shown` buildings, all of them in tables."""
    worst = worst_indices(run)
    buildings = choose_buildings(run, worst, most_shown)
    places = run.only(buildings)
    section, scenes = changes
    record = json.dumps(masked_values(run.record), indent=1, ensure_ascii=False)
    scripts = ["viewer.js", "report.js", *(["changes.js"] if scenes else [])]
    sections = {
        "title": escape(title),
        "style": read_asset(f"{ASSETS}/page.css") + read_asset(f"{ASSETS}/report.css"),
        "lead": lead(run, len(buildings)),
        "next": list_next_steps(run),
        "attention": attention_list(run),
        "statuses": status_table(run),
        "qualities": grade_table(run),
        "figures": figure_table(run),
        "distributions": distributions(run),
        "changes": section,
        "worst": worst_buildings(run, worst, buildings),
        "record": f'<pre tabindex="0" role="region" aria-label="run.json">{escape(record)}</pre>',
        "data": embed_json(report_data(places, places_on_map(places)) | {"changes": scenes}),
        "script": "".join(read_asset(f"{ASSETS}/{name}") for name in scripts),
    }
    return fill_page(read_asset(f"{ASSETS}/report.html"), sections)


def embed_json(data: Any) -> str:
    """Return JSON that may stand inside a script element."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def lead(run: EvaluatedRun, visible: int) -> str:
    """Return the sentences at the top."""
    version = run.record.get("hiproof") or run.record.get("version") or __version__
    overview = find_overview(run)
    fit = f" {overview.fit.capitalize()}." if overview.fit else ""
    points = sum(map(len, run.points))
    measured = (
        f"Measured against {count_things(points, 'point')}"
        if points
        else "No points are given, so residuals are those of the run"
    )
    part = f" Map and 3D view show {visible:,} of them." if visible < len(run.models) else ""
    text = f"Made by hiproof {escape(str(version))}."
    return f"<strong>{overview.headline}.</strong>{fit} {measured}.{part} {text}"


def list_next_steps(run: EvaluatedRun) -> str:
    """Return the section of what to do after an update; empty for other runs."""
    update = run.record.get("update") or {}
    counts = {**(update.get("by_change") or {}), **(update.get("roofs_outside") or {})}
    rows = "".join(
        f"<li><strong>{count_things(counts[name], thing)}</strong> {text}</li>"
        for name, (thing, text) in TEXTS["next_steps"].items()
        if counts.get(name)
    )
    rows = rows or "<li>Nothing: no building changed.</li>"
    title = "What to do next (RUN is the output folder)"
    return f"<section><h2>{title}</h2><ol>{rows}</ol></section>" if update else ""


def attention_list(run: EvaluatedRun) -> str:
    """Return the buildings that need attention by kind, with the command that shows them."""
    rows = "".join(
        f"<li>{count:,} {kind.code}: {escape(kind.value)}. "
        f"<code>{escape(show_command('RUN', kind))}</code></li>"
        for kind, count in find_overview(run).attention.items()
    )
    return f"<p>Needs attention (RUN is the output folder):</p><ul>{rows}</ul>" if rows else ""


def find_overview(run: EvaluatedRun) -> Overview:
    """Return the overview that the run wrote, else one of its models."""
    if record := run.record.get("summary"):
        return Overview.from_dict(record)
    return Overview.of(
        BuildingOutcome(
            model.status,
            model.grade,
            model.text("hiproof_detail"),
            figures.quality.share_within_20cm if figures.quality.points else None,
        )
        for model, figures in zip(run.models, run.figures, strict=True)
    )


def status_table(run: EvaluatedRun) -> str:
    counts = Counter(model.status for model in run.models)
    known = Status.__members__
    rows = [
        (count, escape(known[code.upper()].value if code.upper() in known else code))
        for code, count in counts.most_common()
    ]
    return make_table(("buildings", "outcome"), rows)


def grade_table(run: EvaluatedRun) -> str:
    """Return how many models are good, fair and poor; empty without verdicts."""
    counts = Counter(model.grade for model in run.models)
    rows = [
        (counts[grade.code], f"{grade.code}: {escape(grade.value)}")
        for grade in Grade
        if counts[grade.code]
    ]
    return make_table(("models", "quality"), rows) if rows else ""


def make_table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return a table of rows of cells, a cell in a `th` as it is."""
    names = "".join(f'<th scope="col">{name}</th>' for name in head)
    body = "".join(
        f"<tr>{''.join(c if str(c)[:3] == '<th' else f'<td>{c}</td>' for c in row)}</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{names}</tr></thead>{body}</table>"


def figure_table(run: EvaluatedRun) -> str:
    """Return the table of mean figures by roof type."""
    rows = [
        (
            f'<th scope="row">{escape(describe_type(kind))}</th>',
            figures["buildings"],
            *(f"{figures[k]['mean']:.3f}" if k in figures else "" for k in TEXTS["means"]),
        )
        for kind, figures in summarise(run.figures).items()
    ]
    return make_table(("type", "buildings", *TEXTS["means"].values()), rows)


def distributions(run: EvaluatedRun) -> str:
    rows = [figures.row() for figures in run.figures]
    return "".join(
        histogram(np.array([row[name] for row in rows]), title, unit)
        for name, (title, unit) in TEXTS["distributions"].items()
    )


def worst_indices(run: EvaluatedRun) -> list[int]:
    """Return the indices of the twenty worst models: poor ones, then those of worst shares."""
    worst_first = [grade.code for grade in reversed(Grade)]
    grades = np.array(
        [
            worst_first.index(m.grade) if m.grade in worst_first else len(worst_first)
            for m in run.models
        ]
    )
    rmse = np.array([figures.quality.rmse for figures in run.figures], float)
    share = np.array([figures.quality.share_within_20cm for figures in run.figures], float)
    return [int(i) for i in np.lexsort((-rmse, share, grades)) if np.isfinite(rmse[i])][:WORST]


def choose_buildings(run: EvaluatedRun, worst: list[int], limit: int) -> list[int]:
    """Choose all buildings, or the worst and an even selection, in order."""
    count = len(run.models)
    if count <= limit:
        return list(range(count))
    even = np.linspace(0, count - 1, max(limit - len(worst), 0)).astype(int)
    return sorted({*even.tolist(), *worst})


def worst_buildings(run: EvaluatedRun, worst: list[int], visible: list[int]) -> str:
    """Return a card for each of the worst buildings; a click selects it by its place."""
    place = {index: position for position, index in enumerate(visible)}
    cards = "".join(worst_card(run, index, place[index]) for index in worst)
    return cards or "<p>No points were given, so there are no residuals.</p>"


def worst_card(run: EvaluatedRun, index: int, place: int) -> str:
    model, points, quality = run.models[index], run.points[index], run.figures[index].quality
    if model.solid is None:
        return ""
    origin = model.solid.vertices.min(axis=0)
    pictures = building_pictures(
        model.solid.move(-origin), points - origin, psd(model.solid, points), model.part_types
    )
    text = (
        f"{escape(model.grade)} {escape(describe_type(model.roof_type))}, "
        f"{100 * quality.share_within_20cm:.0f} % of the points inside the outline within 0.2 m of "
        f"the roof; RMSE of all, facades included, {quality.rmse:.2f} m"
    )
    button = (
        f'<button type="button" data-select="{place}">{escape(escape_unseen(model.id))}</button>'
    )
    return f'<figure class="worst">{pictures}<figcaption>{button} {text}</figcaption></figure>'
