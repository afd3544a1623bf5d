"""One figure a roof type, with its parameters.

Every parameter of an ordinary roof is drawn where it is measured.

Roofs come from the catalogue and the family, and a line's ends from the parameters, so a figure
cannot say what the code does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data_files import draw_rings
from ..model import Building
from ..parametric.building import build
from ..primitives.catalogue import CATALOGUE
from ..primitives.revolved import NECK
from ..primitives.table import PARAMETER_ROWS, evaluate
from .view import (
    bound_sphere,
    list_colours,
    project_points,
    select_seen_faces,
    shade_colour,
)

DRAWN_WIDTH, DRAWN_LENGTH, DRAWN_RISE, DRAWN_WALL = 8.0, 12.0, 3.6, 1.6  # m; an ordinary house
# degrees; a view from the front left in which no side hides a parameter
FIGURE_TURN_DEG, FIGURE_TILT_DEG = -38.0, 30.0
FIGURE_SCALE, FIGURE_MARGIN = (
    26.0,
    46.0,
)  # pixels a metre; pixels of margin, for the names beside the roof
ASIDE = 1.1  # m from the roof to a line outside it
LINE_COLOUR, TEXT_COLOUR = "#8c1c13", "#1a1a1a"


@dataclass(frozen=True)
class Measure:
    """A parameter in the figure from `start` to `end` (3,), without which it is a mark."""

    name: str
    start: np.ndarray
    end: np.ndarray | None = None

    @property
    def length(self) -> float:
        return 0.0 if self.end is None else float(np.linalg.norm(self.end - self.start))


def typical_parameters(kind: str) -> dict[str, float]:
    """Return the parameters of an ordinary roof of a type."""
    length = DRAWN_WIDTH / 2 if kind == "half_cone" else DRAWN_LENGTH
    return CATALOGUE[kind].typical(DRAWN_WIDTH, length, DRAWN_RISE)


def make_typical_building(kind: str) -> Building:
    """Make an ordinary roof of a type on low walls."""
    parameters = typical_parameters(kind)
    part = {"type": kind, "parameters": parameters, "position": [0.0, 0.0, 0.0]}
    half = 0.5 * parameters["length"], 0.5 * parameters["width"]
    rim = np.array(CATALOGUE[kind].variant(parameters).rim) * half
    ring = [*rim.tolist(), rim[0].tolist()]
    return build(
        {
            "id": kind,
            "origin": [0.0, 0.0, 0.0],
            "outline": [ring],
            "z_ground": -DRAWN_WALL,
            "parts": [part],
        }
    )


def measures(kind: str) -> list[Measure]:
    """Return where every parameter of a type is measured on its roof.

    >>> [(m.name, m.length) for m in measures("gable")]
    [('width', 8.0), ('length', 12.0), ('height', 3.6)]
    """
    parameters = typical_parameters(kind)
    vertices = CATALOGUE[kind].vertices(parameters)
    highest = vertices[vertices[:, 2] > vertices[:, 2].max() - 1e-9]
    return [place_measure(name, parameters, highest) for name in parameters]


def place_measure(name: str, p: dict[str, float], highest: np.ndarray) -> Measure:
    """Return the place of one parameter `name` among all, `p`.

    `highest` (k, 3) are the corners of the roof's ridge or top. A parameter that no line is known
    for is only named, beside the roof.
    """
    u, v, ends = p["length"] / 2, p["width"] / 2, PARAMETER_ROWS.get(name, {}).get("ends")
    if ends is None:
        return Measure(name, np.array([0.0, v + 0.5, p.get("height", 0.0)]))
    (x0, y0, _), (x1, y1, _) = highest.min(axis=0), highest.max(axis=0)
    names = {"u": u, "v": v, "x0": x0, "y0": y0, "x1": x1, "y1": y1}
    names |= {"aside": ASIDE, "wall": DRAWN_WALL, "neck": NECK}
    sizes = dict.fromkeys(PARAMETER_ROWS, 0.0) | p
    return Measure(name, *np.array(evaluate(ends, {**sizes, **names}), float))


def primitive_svg(kind: str) -> str:
    """Return the figure of a roof type."""
    building = make_typical_building(kind)
    colours = list_colours(building)
    centre, _ = bound_sphere(building.solid)

    def place(points: np.ndarray) -> np.ndarray:
        turned = project_points(points - centre, FIGURE_TURN_DEG, FIGURE_TILT_DEG)
        return FIGURE_SCALE * turned[:, :2]

    lines = [
        (m, place(np.array([end for end in (m.start, m.end) if end is not None])))
        for m in measures(kind)
    ]
    spots = np.concatenate([place(building.solid.vertices), *(page for _, page in lines)])
    (x0, y0), (x1, y1) = spots.min(axis=0) - FIGURE_MARGIN, spots.max(axis=0) + FIGURE_MARGIN
    text = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{x0:.0f} {y0:.0f} {x1 - x0:.0f} '
        f'{y1 - y0:.0f}" '
        f'width="{x1 - x0:.0f}" height="{y1 - y0:.0f}" font-family="sans-serif" font-size="13">',
        f"<title>{kind}</title>",
        '<rect x="-2000" y="-2000" width="4000" height="4000" fill="white"/>',
        *(
            f'<path d="{draw_rings(FIGURE_SCALE * ring for ring in face.rings)}" '
            f'fill="{shade_colour(face.colour, face.light)}" stroke="#333" stroke-width="1" '
            'fill-opacity="0.8"/>'
            for face in select_seen_faces(building.solid, colours, FIGURE_TURN_DEG, FIGURE_TILT_DEG)
        ),
        *(draw_measure(*line) for line in lines),
        "</svg>",
    ]
    return "\n".join(text) + "\n"


def draw_measure(measure: Measure, page: np.ndarray) -> str:
    """Draw a line with its name beside it, or the name alone of what has no length."""
    if len(page) < 2 or measure.length < 1e-9:
        x, y = page[0]
        text = f"{measure.name} = 0" if measure.end is not None else measure.name
        return label(x, y, text)
    (x0, y0), (x1, y1) = page
    across = np.array([y1 - y0, x0 - x1]) / max(math.hypot(x1 - x0, y1 - y0), 1e-9) * 4
    ends = "".join(
        f'<path d="M{x - across[0]:.1f} {y - across[1]:.1f}L{x + across[0]:.1f} '
        f'{y + across[1]:.1f}"/>'
        for x, y in page
    )
    line = (
        f'<g stroke="{LINE_COLOUR}" stroke-width="2" fill="none"><path d="M{x0:.1f} '
        f"{y0:.1f}L{x1:.1f} "
        f'{y1:.1f}"/>{ends}</g>'
    )
    # so that it stays clear of others at the same end
    share = 0.1 if measure.name == "height" else 0.5
    return line + label(x0 + share * (x1 - x0), y0 + share * (y1 - y0), measure.name)


def label(x: float, y: float, text: str) -> str:
    return (
        f'<text x="{x:.1f}" y="{y - 4:.1f}" text-anchor="middle" fill="{TEXT_COLOUR}" '
        'stroke="white" '
        'stroke-width="3" '
        f'paint-order="stroke">{text}</text>'
    )
