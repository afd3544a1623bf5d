"""The beams of an airborne scanner: swaths of scan lines over a disc.

Swaths have heading, scan angle and spacing.

Within a swath, points lie at regular steps along each scan line and lines at regular steps along
the flight; an oscillating mirror pushes lines together in pairs, away from the middle of its swath.
Overlapping swaths differ in heading, angle and spacing, and a swath may end over the building.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Beams:
    """Beams p(z) = xy0 + slope z, both (n, 2); `shift` (n, 3) is the swath's error."""

    xy0: np.ndarray
    slope: np.ndarray
    shift: np.ndarray

    def __len__(self) -> int:
        return len(self.xy0)

    def select(self, keep: np.ndarray) -> Beams:
        return Beams(self.xy0[keep], self.slope[keep], self.shift[keep])


@dataclass(frozen=True)
class Swath:
    """One pass over a disc.

    Flight `heading` (rad); spacings (m) of lines and of points on a line; tangent of the scan angle
    over the disc's centre and its growth a metre across track (1 / flying height); `pairing` 0-1 of
    an oscillating mirror; `edges` (m across track, relative to the centre) between which the swath
    lies; `shift` (3,) registration error. `anchor` is the centre's place (along, across) in the
    flight's own axes, so that discs side by side continue each other's lines; without it the lines'
    phases are drawn.
    """

    heading: float
    line_spacing: float
    point_spacing: float
    tan_angle: float
    tan_growth: float = 0.0
    pairing: float = 0.0
    edges: tuple[float, float] = (-math.inf, math.inf)
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    anchor: tuple[float, float] | None = None


def random_swaths(
    rng: np.random.Generator,
    density: float,
    tan_max: float,
    registration_m: float,
    edge_probability: float,
    reach: float,
) -> list[Swath]:
    """Draw one to three swaths of `density` (points/m2); two may end within `reach` (m)."""
    count = 1 + int(rng.random() < 0.5) + int(rng.random() < 0.15)
    share = rng.uniform(0.6, 1.4, count)
    share *= density / share.sum()
    heading = rng.uniform(-math.pi, math.pi)
    swaths = []
    for k in range(count):
        ratio, turn, angle, pairing, ends, edge = rng.random(6)
        spacing = 1.0 / math.sqrt(share[k])
        stretch = 2.0 ** (1.6 * ratio - 0.8)
        swaths.append(
            Swath(
                heading=heading + (math.pi if turn < 0.6 else math.pi * turn) * k,
                line_spacing=spacing * stretch,
                point_spacing=spacing / stretch,
                tan_angle=tan_max * (2 * angle - 1),
                pairing=max(0.0, 1.6 * pairing - 0.8),
                edges=(
                    -math.inf,
                    (2 * edge - 1) * reach if k and ends < edge_probability else math.inf,
                ),
                shift=tuple(rng.normal(0.0, registration_m, 3) * (1.0, 1.0, 0.5))
                if count > 1
                else (0.0, 0.0, 0.0),
            )
        )
    return swaths


def make_beams(
    rng: np.random.Generator, swath: Swath, centre: np.ndarray, radius: float, z_ref: float
) -> Beams:
    """Return beams of `swath` that cross a disc about `centre` (2,) at height `z_ref`."""
    cosine, sine = math.cos(swath.heading), math.sin(swath.heading)
    along_lines, phase, across_steps = lattice(rng, swath, radius)
    jitter = rng.normal(0.0, 0.07, (2, len(along_lines), len(across_steps)))
    along = (along_lines[:, None] + swath.line_spacing * jitter[0]).ravel()
    across = (across_steps + swath.point_spacing * (phase[:, None] + jitter[1])).ravel()
    keep = (
        (along**2 + across**2 < radius**2) & (across >= swath.edges[0]) & (across < swath.edges[1])
    )
    along, across = along[keep], across[keep]
    xy_ref = (
        np.column_stack([cosine * along - sine * across, sine * along + cosine * across]) + centre
    )
    tan = swath.tan_angle + swath.tan_growth * across
    slope = tan[:, None] * (sine, -cosine)
    return Beams(xy_ref - slope * z_ref, slope, np.broadcast_to(swath.shift, (len(tan), 3)))


def lattice(
    rng: np.random.Generator, swath: Swath, radius: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw scan lines along, phases (0-1), and steps across track, in m from the centre."""
    lines = np.arange(int(2 * radius / swath.line_spacing) + 2)
    steps = np.arange(int(2 * radius / swath.point_spacing) + 2)
    if swath.anchor is None:
        start, across = rng.random() * swath.line_spacing - radius, -radius
        phase = rng.random(len(lines))
    else:
        along_centre, across_centre = swath.anchor
        lines = lines + math.floor((along_centre - radius) / swath.line_spacing)
        steps = steps + math.floor((across_centre - radius) / swath.point_spacing)
        # Successive multiples of the golden ratio spread phases evenly, and each line finds its own
        # again.
        start, across = -along_centre, -across_centre
        phase = np.asarray(lines * 0.6180339887498949 % 1.0)
    along = (lines + 0.5 * swath.pairing * (lines % 2)) * swath.line_spacing + start
    return along, phase, steps * swath.point_spacing + across


def join_beams(beams: list[Beams]) -> Beams:
    if len(beams) == 1:
        return beams[0]
    return Beams(
        *(np.concatenate([getattr(b, name) for b in beams]) for name in ("xy0", "slope", "shift"))
    )
