"""A building in a notebook: a small view that turns, and a table of parts, all in the page."""

from __future__ import annotations

import hashlib
import json
from html import escape

import numpy as np

from ..data_files import draw_rings, read_asset
from ..errors import escape_unseen
from ..model import Building, Part
from ..write.attribute_list import ANGLES
from .view import (
    TILT_DEG,
    bound_sphere,
    choose_turn,
    lightness,
    list_colours,
    select_seen_faces,
    shade_colour,
)

VIEW_SIZE = (360, 260)  # pixels, width and height: beside a notebook's table
VIEW_MARGIN = 12  # pixels left free on each side
SHOWN_PARTS = 12  # rows of the table; more would push the picture off the screen
MM = 3  # digits of coordinates sent to the page: millimetres


def render_building(building: Building) -> str:
    """Return a building as HTML: its view where it has a solid, status, and parameters."""
    text = building.detail or building.status.value
    head = f"<b>{escape(escape_unseen(building.id))}</b>: {escape(text)}"
    view = render_view(building) if building.built is not None else ""
    style = "font-family:sans-serif;font-size:12px"
    return f'<div style="{style}">{view}<div>{head}</div>{parts_table(building)}</div>'


def render_view(building: Building) -> str:
    """Return the solid as SVG, with the script that turns it."""
    solid, colours, turn = building.solid, list_colours(building), choose_turn(building)
    middle, radius = bound_sphere(solid)
    corners = np.round(solid.vertices - middle, MM)
    scale = (min(VIEW_SIZE) / 2 - VIEW_MARGIN) / max(
        radius, 1e-6
    )  # so that it fits whichever way it turns
    faces = [
        {
            "r": [list(ring) for ring in face.rings],
            "c": shade_colour(colour, lightness(solid, face)),
        }
        for face, colour in zip(solid.faces, colours, strict=True)
    ]
    data = json.dumps(
        {"v": corners.tolist(), "f": faces, "s": scale, "t": [turn, TILT_DEG]},
        separators=(",", ":"),
    )
    name = "hiproof-" + hashlib.sha256((building.id + data).encode()).hexdigest()[:12]
    polygons = "".join(
        render_path(face.rings, shade_colour(face.colour, face.light), scale)
        for face in select_seen_faces(solid, colours, turn)
    )
    box = f"{-VIEW_SIZE[0] / 2} {-VIEW_SIZE[1] / 2} {VIEW_SIZE[0]} {VIEW_SIZE[1]}"
    script = read_asset("draw/turn.js")
    return (
        f'<svg id="{name}" width="{VIEW_SIZE[0]}" height="{VIEW_SIZE[1]}" viewBox="{box}" '
        'style="cursor:grab;touch-action:none" tabindex="0" role="application" '
        f'aria-label="model of {escape(building.id, quote=True)}; arrow keys turn it">'
        f"{polygons}</svg>"
        f'<script>({script.strip()})("{name}",{data.replace("<", chr(92) + "u003c")})</script>'
    )


def render_path(rings: tuple[np.ndarray, ...], colour: str, scale: float) -> str:
    """Return a face as an SVG path."""
    d = draw_rings(ring * scale for ring in rings)
    return f'<path d="{d}" fill="{colour}" fill-rule="evenodd" stroke="#333" stroke-width="0.7"/>'


def parts_table(building: Building) -> str:
    """Return a table of parts: number, type, parameters and their deviations."""
    rows = "".join(
        table_row(str(number), escape(part.type), parameters_text(part))
        for number, part in enumerate(building.parts[:SHOWN_PARTS])
    )
    additions = len(building.parts) - SHOWN_PARTS
    row = table_row("", f"and {additions} more", "") if additions > 0 else ""
    return f'<table style="font-size:12px">{rows}{row}</table>' if rows else ""


def table_row(*cells: str) -> str:
    """Return a row of HTML, aligned to the left: notebooks align cells to the right."""
    return "<tr>" + "".join(f'<td style="text-align:left">{cell}</td>' for cell in cells) + "</tr>"


def parameters_text(part: Part) -> str:
    """Format parameters for people: degrees for angles, else metres."""
    entries = []
    for name, value in part.parameters.items():
        unit = "°" if name.startswith(ANGLES) else "" if name == "teeth" else " m"
        sigma = f" ± {part.sigma[name]:.2f}" if name in part.sigma else ""
        entries.append(f"{escape(name)} {value:.2f}{sigma}{unit}")
    return ", ".join(entries)
