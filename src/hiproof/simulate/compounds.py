"""Compound buildings: wings, annexes, steps, rows and dormers.

A roof is the maximum of its parts' roofs.

Parts are laid out in the building's own (u, v) axes, u along the main ridge; a wing reaches under
the main roof as far as its ridge, so that the maximum of both makes the valley, and a dormer until
its top is under the slope.
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import InputError
from ..frames import turn_points
from ..model import Part
from .roofs import SimBuilding, assemble, make_part, random_eave, random_parameters

COMPOUND_KINDS = (
    "L",
    "T",
    "U",
    "cross",
    "extension",
    "two_level",
    "saw_tooth_hall",
    "row",
    "dormered",
    "winged_hip",
    "L_of_hips",
)
# m between dormers, and how far their roofs run into the slope, so that no gap opens
DORMER_GAP_M, DORMER_BACK_M = 0.8, 0.3


class CompoundLayout:
    """The building's axes, in which parts stand by centre (u, v) and quarter turns."""

    def __init__(self, kappa: float):
        self.kappa = kappa

    def part(
        self,
        type: str,
        parameters: dict[str, float],
        u: float,
        v: float,
        z: float,
        quarters: int = 0,
    ) -> Part:
        translation = np.append(turn_points(np.array([u, v]), self.kappa), z)
        return make_part(type, parameters, self.kappa + quarters * math.pi / 2, translation)


def random_compound(
    rng: np.random.Generator,
    kind: str | None = None,
    origin: np.ndarray | tuple[float, float, float] = (0.0, 0.0, 0.0),
    kappa: float | None = None,
) -> SimBuilding:
    """Draw a compound of `kind` on the ground at `origin` (world).

    `kind` is one of COMPOUND_KINDS; it is drawn when None. L, L_of_hips, T, cross, extension,
    two_level and saw_tooth_hall have two parts, U and winged_hip three, a dormered house two to
    five, a row three to six. Raises InputError for an unknown kind.

    >>> len(random_compound(np.random.default_rng(0), "U").roof.parts)
    3
    """
    kind = COMPOUND_KINDS[rng.integers(len(COMPOUND_KINDS))] if kind is None else kind
    if kind not in COMPOUND_KINDS:
        raise InputError(f"expected a kind of compound ({', '.join(COMPOUND_KINDS)}), got {kind!r}")
    layout = CompoundLayout(rng.uniform(-math.pi, math.pi) if kappa is None else kappa)
    if kind in ("L", "T", "U", "cross"):
        parts = make_winged(rng, layout, kind)
    else:
        parts = OTHERS[kind](rng, layout)
    return assemble(tuple(parts), kind, origin)


def make_winged(rng: np.random.Generator, layout: CompoundLayout, kind: str) -> list[Part]:
    """Make a main body with one or two wings at right angles, all gables, hips or flat."""
    type = str(rng.choice(("gable", "hip", "flat"), p=(0.6, 0.2, 0.2)))
    width, eave = rng.uniform(6.5, 11.0), random_eave(rng)
    slope = math.tan(math.radians(rng.uniform(20, 50)))
    wing_width = width * rng.uniform(0.6, 0.95)
    room = (2.3 if kind == "U" else 1.0) * wing_width
    length = room + width * rng.uniform(0.5, 1.3)
    main = layout.part(type, regular(type, length, width, slope), 0.0, 0.0, eave)
    wings = {"L": (1,), "T": (0,), "U": (-1, 1), "cross": (0,)}[kind]
    reach = width * rng.uniform(0.4, 1.0)
    step = rng.uniform(0.8, 2.5) if type == "flat" or rng.random() < 0.3 else 0.0
    parts = [main]
    for side in wings:
        # A hip's inner end slopes down, so hipped wings cross the whole main body; gables stop
        # under its ridge.
        inner = (
            -width / 2 - (reach if kind == "cross" else 0.0)
            if kind == "cross" or type == "hip"
            else 0.0
        )
        outer = width / 2 + reach
        parameters = regular(type, outer - inner, wing_width, slope)
        u = side * (length - wing_width) / 2 + (
            rng.uniform(-0.15, 0.15) * (length - wing_width) if side == 0 else 0.0
        )
        parts.append(
            layout.part(type, parameters, u, (inner + outer) / 2, max(2.2, eave - step), quarters=1)
        )
    return parts


def regular(type: str, length: float, width: float, slope: float) -> dict[str, float]:
    """Return a gable, hip (four equal slopes, longer than wide) or flat roof."""
    parameters = name_sizes(length, width, 0.0 if type == "flat" else width / 2 * slope)
    if type == "hip":
        parameters["ridge_length"] = float(length - width)
    return parameters


def name_sizes(length: float, width: float, height: float) -> dict[str, float]:
    """Return the sizes of a roof by name, of a level one without a height."""
    sizes = {"length": length, "width": width} | ({"height": height} if height else {})
    return {name: float(size) for name, size in sizes.items()}


def make_extended(rng: np.random.Generator, layout: CompoundLayout) -> list[Part]:
    """Make a house with a lower annex along its eave, flat or rising towards the house."""
    type = str(rng.choice(("gable", "hip", "half_hip", "mansard", "asymmetric_gable", "gambrel")))
    house, eave = random_parameters(rng, type), random_eave(rng) + 2.0
    depth, span = rng.uniform(2.5, 5.0), house["length"] * rng.uniform(0.4, 1.0)
    lean_to = rng.random() < 0.5
    rise = depth * math.tan(math.radians(rng.uniform(8, 25))) if lean_to else 0.0
    z = max(2.0, eave - rise - rng.uniform(0.3, 1.5))
    annex = name_sizes(span, depth, rise)
    u = rng.uniform(-0.5, 0.5) * (house["length"] - span)
    v = -(house["width"] + depth) / 2
    return [
        layout.part(type, house, 0.0, 0.0, eave),
        layout.part("monopitch" if lean_to else "flat", annex, u, v, z),
    ]


def make_level_blocks(rng: np.random.Generator, layout: CompoundLayout) -> list[Part]:
    """Make two flat blocks side by side, a storey or more apart."""
    parameters, upper = random_parameters(rng, "flat"), random_parameters(rng, "flat")
    upper = upper | {"width": parameters["width"] * float(rng.uniform(0.6, 1.0))}
    eave = random_eave(rng)
    v = (parameters["width"] - upper["width"]) / 2
    return [
        layout.part("flat", parameters, 0.0, 0.0, eave),
        layout.part(
            "flat",
            upper,
            (parameters["length"] + upper["length"]) / 2,
            v,
            eave + rng.uniform(1.2, 6.0),
        ),
    ]


def saw_tooth_hall_and_office(rng: np.random.Generator, layout: CompoundLayout) -> list[Part]:
    """Make a saw-tooth hall with a flat office along its first tooth's foot."""
    hall, eave = random_parameters(rng, "shed"), rng.uniform(4.5, 7.0)
    office = {"length": hall["length"], "width": float(rng.uniform(5.0, 9.0))}
    v = -(hall["width"] + office["width"]) / 2
    return [
        layout.part("shed", hall, 0.0, 0.0, eave),
        layout.part("flat", office, 0.0, v, max(2.6, eave + rng.uniform(-1.8, -0.5))),
    ]


def houses_in_a_row(rng: np.random.Generator, layout: CompoundLayout) -> list[Part]:
    """Make terraced houses of one depth, ridges along the row, some stepped, a few flat."""
    count, depth = int(rng.integers(3, 7)), rng.uniform(7.5, 11.0)
    slope, eave, u = math.tan(math.radians(rng.uniform(28, 50))), random_eave(rng) + 1.0, 0.0
    parts = []
    for _ in range(count):
        span = rng.uniform(4.8, 7.0)
        type = "flat" if rng.random() < 0.12 else "gable"
        z = max(2.2, eave + (rng.normal(0.0, 0.8) if rng.random() < 0.5 else 0.0))
        parts.append(layout.part(type, regular(type, span, depth, slope), u + span / 2, 0.0, z))
        u += span
    return parts


def make_dormered(rng: np.random.Generator, layout: CompoundLayout) -> list[Part]:
    """Make a house with one to four equal dormers, on one slope or on both."""
    type = "gable" if rng.random() < 0.75 else "hip"
    width, slope = rng.uniform(8.0, 11.0), math.tan(math.radians(rng.uniform(38, 52)))
    ridge = width * rng.uniform(0.9, 1.4)
    length, eave = ridge + (width if type == "hip" else 0.0), random_eave(rng) + 1.0
    parts = [layout.part(type, regular(type, length, width, slope), 0.0, 0.0, eave)]
    span, both_sides = rng.uniform(2.2, 3.0), rng.random() < 0.4
    room = int((ridge + DORMER_GAP_M) / (span + 2 * DORMER_GAP_M))
    count = int(rng.integers(1, min(2 if both_sides else 3, room) + 1))
    shape, depth, front, top = dormer(rng, span, slope, width)
    centres = (np.arange(count) - (count - 1) / 2) * ridge / max(count, 2)
    for side in (-1, 1) if both_sides else (-1,):
        v = side * (width / 2 - front - depth / 2)
        quarters = {"gable": 1, "flat": 0, "monopitch": 0 if side < 0 else 2}[shape]
        length, across = (depth, span) if shape == "gable" else (span, depth)
        parameters = name_sizes(length, across, top[1])
        parts += [
            layout.part(shape, parameters, float(u), v, eave + top[0], quarters) for u in centres
        ]
    return parts


def dormer(
    rng: np.random.Generator, span: float, slope: float, width: float
) -> tuple[str, float, float, tuple[float, float]]:
    """Draw the type, depth, place and heights of a dormer of `span`.

    Heights are (eave over the house's eave, rise), the place is the distance of its front from the
    eave. It stands on a roof of `width` and `slope`; its back ends under the slope.
    """
    type = str(rng.choice(("gable", "flat", "monopitch"), p=(0.5, 0.25, 0.25)))
    front, own_slope = rng.uniform(0.6, 1.1), math.tan(math.radians(rng.uniform(6, 14)))
    rise = span / 2 * math.tan(math.radians(rng.uniform(25, 36))) if type == "gable" else 0.0
    # The top stays half a metre under the house's ridge; the house's least width and slope leave a
    # wall of 0.7 m.
    wall = min(rng.uniform(1.1, 1.7), (width / 2 - front) * slope - rise - 0.5)
    meets = (wall + rise) / (slope - (own_slope if type == "monopitch" else 0.0))
    depth = min(meets + DORMER_BACK_M, width / 2 - front)
    rise = float(depth * own_slope) if type == "monopitch" else float(rise)
    return type, float(depth), float(front), (float(front * slope + wall), rise)


def winged_hip_roof(rng: np.random.Generator, layout: CompoundLayout) -> list[Part]:
    """Make a hip with equal lower wings, gables or hips, on one side or on both."""
    type = str(rng.choice(("gable", "hip")))
    width, eave = rng.uniform(8.0, 12.0), random_eave(rng)
    slope = math.tan(math.radians(rng.uniform(22, 45)))
    wing_width = width * rng.uniform(0.45, 0.65)
    length = width * rng.uniform(1.0, 1.3) + 2 * wing_width
    step = rng.uniform(0.8, 2.0) if rng.random() < 0.3 else 0.0
    inner = -width / 2 if type == "hip" else 0.0
    outer = width / 2 + wing_width * rng.uniform(0.6, 1.2)
    wing = regular(type, outer - inner, wing_width, slope)
    place = (length - wing_width) / 2 - rng.uniform(0.8, 0.25 * wing_width + 0.8)
    sides = (1, 1) if rng.random() < 0.6 else (1, -1)
    return [layout.part("hip", regular("hip", length, width, slope), 0.0, 0.0, eave)] + [
        layout.part(type, wing, u, side * (inner + outer) / 2, max(2.2, eave - step), quarters=1)
        for u, side in zip((-place, place), sides, strict=True)
    ]


def make_corner_hips(rng: np.random.Generator, layout: CompoundLayout) -> list[Part]:
    """Make two equal hips that share a corner, where their ridges meet at one height."""
    width, eave = rng.uniform(6.5, 10.5), random_eave(rng)
    slope = math.tan(math.radians(rng.uniform(20, 48)))
    length, reach = width * rng.uniform(1.7, 2.6), width * rng.uniform(0.7, 1.4)
    return [
        layout.part("hip", regular("hip", length, width, slope), 0.0, 0.0, eave),
        layout.part(
            "hip",
            regular("hip", width + reach, width, slope),
            (length - width) / 2,
            reach / 2,
            eave,
            1,
        ),
    ]


OTHERS = {
    "extension": make_extended,
    "two_level": make_level_blocks,
    "saw_tooth_hall": saw_tooth_hall_and_office,
    "row": houses_in_a_row,
    "dormered": make_dormered,
    "winged_hip": winged_hip_roof,
    "L_of_hips": make_corner_hips,
}
