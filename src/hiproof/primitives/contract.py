"""The contract of a roof shape, and all that follows from it.

Two descriptions of the same surface meet here:

* The paper's is S = f(theta_p), with theta_p in metres (width, length, height and others). Vertices
  and faces are in the primitive frame: the plan's centre is the origin, u runs along the ridge
  (length), v across (width), and the lowest eave lies at z = 0.
* The fit's is theta = [cx, cy, kappa, V, U, q0, q1, q2, q3]. V and U are the half extents across
  and along, and q the heights, slopes and fractions of the planes z = a u + b v + c. Their a, b, c
  are formulas (algebra.py) of V, U and q. Every bound is a plain interval. The roof is the minimum
  of its planes over the rectangle |u| <= U, |v| <= V.

x = cx + u cos(kappa) - v sin(kappa), y = cy + u sin(kappa) + v cos(kappa), and T_L = (cx, cy, the
eave's height).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from ..errors import FitError
from ..frames import turn_points
from ..model import Part, Piece
from .algebra import Formula, formula

# places in theta (9,): centre, rotation, half sizes, and four numbers of the shape
CX, CY, KAPPA, HALF_WIDTH, HALF_LENGTH, Q0, Q1, Q2, Q3 = range(9)
SLOPE_MIN, SLOPE_MAX = 0.04, 2.75  # 2 and 70 degrees: steeper planes swallow facade points
SPIRE_SLOPE_MAX = 5.7  # 80 degrees, of spires alone
SHORTEST_LENGTH_M = 1e-3  # Shortest length (m) of a parameter. Shorter ones are numerical noise.
WRITTEN_DIGITS = 6  # Digits of a length (m) in files of parameters: micrometres.
SLOPE_SHARE = 1e-3  # Largest error of a slope or a share that rounded parameters may cause.
SIDES = ("left", "right", "front", "back")
LEFT, RIGHT, FRONT, BACK, LEVEL = range(5)  # the side that a plane rises from: -u, +u, -v, +v, none

Plane = tuple[Formula | float, Formula | float, Formula | float]
Parameters = Mapping[str, float]  # theta_p by name
Placed = tuple[dict[str, float], float, np.ndarray]  # theta_p, kappa and T_L (3,)
Shape = tuple[float, ...]  # V, U, q0..q3
# The corners of a plan as shares of its half extents.
RECTANGLE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
Corners = Sequence[tuple[float, float, float]] | np.ndarray  # (n, 3)
Pieces = tuple[Piece, ...]


@dataclass(frozen=True)
class DerivedStart:
    """Start values from the fit of a simpler type.

    `q` are formulas of the `source`'s V, U and q, in axes that are turned by so many quarters from
    its own, and by `turn` (rad) besides.
    """

    source: str
    q: tuple[Formula | float, ...]
    quarters: int = 0
    turn: float = 0.0

    def theta(self, source_theta: np.ndarray) -> np.ndarray:
        """Return theta (9,) with the plan of `source_theta` (9,) and q by formulas."""
        theta, shape = source_theta.copy(), source_theta[HALF_WIDTH:].tolist()
        for _ in range(self.quarters):
            theta[[HALF_WIDTH, HALF_LENGTH]] = theta[[HALF_LENGTH, HALF_WIDTH]]
            theta[KAPPA] += math.pi / 2
        theta[KAPPA] += self.turn
        theta[Q0 : Q0 + len(self.q)] = [
            q.at(shape) if isinstance(q, Formula) else q for q in self.q
        ]
        return theta


@dataclass(frozen=True)
class Vote:
    """Start values from a vote on quarter turns, slopes and shifts of the ridge (shares of V)."""

    turns: int = 2
    slopes: tuple[float, ...] = (0.08, 0.2, 0.32, 0.45, 0.58, 0.72, 0.86, 1.0, 1.2)
    shifts: tuple[float, ...] = (0.0,)


@dataclass(frozen=True)
class Primitive:
    """One roof shape.

    planes       formulas (a, b, c) in the order of `faces`; the roof is their minimum
    measures     theta_p by name in metres as formulas of V, U, q; all are positive but those in
                 `signed`
    eave         formula of the lowest eave's height
    shape        theta_p -> (V, U, q0, q1, q2, q3) with the lowest eave at 0: the inverse of
                 `measures`
    corners      theta_p -> vertices (n, 3) in the primitive frame: the paper's S = f(theta_p)
    faces        vertex indices (from 0) of each roof surface, counter-clockwise from above
    typical      (width, length, height) -> theta_p of an ordinary roof of that size
    draw         (generator, width) -> theta_p of one of the roofs that are built so, for
                 simulations; typical ones without
    bounds       (low, high) of q1, q2, q3 as far as used
    vote         how the points vote for start values, or None for a type whose
    starts       derive from the fits of simpler types
    canonical    theta -> the one theta chosen among those of the same surface
    strips       number of teeth: planes are then chosen by equal strips across instead of by the
                 minimum
    minima       numbers of planes of each of several minima, of which the roof is the highest;
                 without it, all planes make one
    more         the same roof type with other strips, other parameters or more facets
    choose       theta_p -> the place in `variants` of that with as many facets as its size asks
                 for
    refine       theta_p, tolerance (m) -> the shape with as many facets as keep within it
    rim          corners (n, 2) of the plan, counter-clockwise, as shares of U and V
    read_member  a member of the family with planes on the same sides -> q of the shape with its
                 front's and right's slopes
    osm_shape    the nearest value of OpenStreetMap's roof:shape
    legend       entry of legends that lists the type; its colour stands in write/colours.py
    """

    name: str
    citygml_code: str
    adv_code: str
    measures: Mapping[str, Formula]
    eave: Formula
    planes: tuple[Plane, ...]
    shape: Callable[[Parameters], Shape]
    corners: Callable[[Parameters], Corners]
    faces: tuple[tuple[int, ...], ...]
    typical: Callable[[float, float, float], dict[str, float]]
    bounds: tuple[tuple[float, float], ...] = ()
    vote: Vote | None = None
    starts: tuple[DerivedStart, ...] = ()
    canonical: Callable[[np.ndarray], np.ndarray] = field(default=lambda theta: theta)
    signed: tuple[str, ...] = ()
    half_turn_symmetric: bool = True
    strips: int = 1
    minima: tuple[int, ...] = ()
    more: tuple[Primitive, ...] = ()
    choose: Callable[[Parameters], int] | None = None
    refine: Callable[[Parameters, float], Primitive] | None = None
    rim: tuple[tuple[float, float], ...] = RECTANGLE
    draw: Callable[[np.random.Generator, float], dict[str, float]] | None = None
    read_member: Callable[[Any], tuple[float, ...]] | None = None
    osm_shape: str | None = None
    legend: str = "other"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of theta_p, all in metres (a saw-tooth's `teeth` is a count)."""
        return tuple(self.measures)

    @property
    def variants(self) -> tuple[Primitive, ...]:
        """This shape, and those with other counts or parameters."""
        return (self, *self.more)

    @property
    def theta_size(self) -> int:
        """Used entries of theta: five for the plan, q0 and one for each bound."""
        return 6 + len(self.bounds)

    @cached_property
    def sides(self) -> tuple[int, ...]:
        """The side that each of `planes` rises from, LEVEL for a level one."""
        return tuple(
            LEVEL
            if not (a.terms or b.terms)
            else (RIGHT, LEFT)[a.rises]
            if a.terms
            else (BACK, FRONT)[b.rises]
            for a, b, _ in self.plane_formulas
        )

    @cached_property
    def is_of_family(self) -> bool:
        """Whether a volume can have its shape: one plane a side, and one level plane, at most."""
        is_rectangular = self.strips == 1 and self.rim == RECTANGLE
        return is_rectangular and len(set(self.sides)) == len(self.sides)

    def variant(self, theta_p: Parameters) -> Primitive:
        """Return the variant with the teeth, facets or parameters of `theta_p`, else itself."""
        if self.choose is not None:
            return self.variants[self.choose(theta_p)]
        matching = [variant for variant in self.variants if set(variant.parameters) <= set(theta_p)]
        return max(matching, key=lambda variant: len(variant.parameters), default=self)

    def vertices(self, theta_p: Parameters) -> np.ndarray:
        """Return vertices (n, 3), S = f(theta_p); raises FitError where a parameter is missing."""
        shape = self.variant(theta_p)
        missing = [name for name in shape.parameters if name not in theta_p]
        if missing:
            raise FitError(
                f"expected the parameters {', '.join(shape.parameters)} of the roof type "
                f"{self.name}, got none for {', '.join(missing)}; give every parameter in metres"
            )
        return np.asarray(shape.corners(theta_p), float)

    def draw_parameters(self, rng: np.random.Generator, width: float) -> dict[str, float]:
        """Draw theta_p of a random roof that is `width` metres wide."""
        if self.draw is not None:
            return self.draw(rng, width)
        length, angle = width * rng.uniform(1.05, 2.2), rng.uniform(20.0, 45.0)
        return self.typical(width, length, 0.5 * width * math.tan(math.radians(angle)))

    def to_theta(
        self,
        theta_p: Parameters,
        kappa: float = 0.0,
        translation: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    ) -> np.ndarray:
        """Return theta (9,) of named parameters, turned by `kappa` and moved by T_L (3,)."""
        theta = np.zeros(9)
        theta[[CX, CY, KAPPA]] = translation[0], translation[1], kappa
        theta[HALF_WIDTH:] = self.variant(theta_p).shape(theta_p)
        theta[Q0] += translation[2]
        return theta

    def from_theta(self, theta: np.ndarray) -> Placed:
        """Return the named theta_p, kappa and T_L (3,) of `theta` (9,)."""
        *measures, eave = self.measures_at(np.asarray(theta, float)[HALF_WIDTH:].tolist())
        theta_p = dict(zip(self.measures, measures, strict=True))
        return theta_p, float(theta[KAPPA]), np.array([theta[CX], theta[CY], eave])

    def measures_at(self, shape: Sequence[Any]) -> list[Any]:
        """Return theta_p and the lowest eave's height at V, U, q0..q3, or at arrays (m,)."""
        return [measure.at(shape) for measure in (*self.measures.values(), self.eave)]

    def is_proper(self, theta: np.ndarray) -> bool:
        """Return whether all lengths are positive and survive rounding.

        Rounded parameters have to make the same slopes.
        Slopes over a run of less than a millimetre do not follow from lengths in micrometres.
        """
        theta_p, _, _ = self.from_theta(theta)
        if any(
            value < SHORTEST_LENGTH_M for name, value in theta_p.items() if name not in self.signed
        ):
            return False
        try:
            repeat = self.shape(
                {name: round(value, WRITTEN_DIGITS) for name, value in theta_p.items()}
            )
        except ZeroDivisionError:
            return False
        slopes = zip(repeat[Q1 - HALF_WIDTH :], theta[Q1 : self.theta_size].tolist(), strict=False)
        return all(
            abs(updated - previous) <= SLOPE_SHARE * (1.0 + abs(previous))
            for updated, previous in slopes
        )

    def canonical_theta(self, theta: np.ndarray) -> np.ndarray:
        """Return the theta of the same surface with kappa in (-pi/2, pi/2] or (-pi, pi]."""
        theta = self.canonical(np.array(theta, float))
        period = math.pi if self.half_turn_symmetric else 2 * math.pi
        theta[KAPPA] -= period * math.ceil(theta[KAPPA] / period - 0.5)
        return theta

    def plane_values(self, theta: np.ndarray) -> np.ndarray:
        """Return planes (k, 3), z = a u + b v + c, at `theta` (9,), or (m, k, 3) at (m, 9)."""
        theta = np.asarray(theta, float)
        shape = theta[HALF_WIDTH:].tolist() if theta.ndim == 1 else list(theta.T[HALF_WIDTH:])
        zero = 0.0 * theta[..., HALF_WIDTH]
        planes = [[zero + number.at(shape) for number in plane] for plane in self.plane_formulas]
        return np.moveaxis(np.array(planes), (0, 1), (-2, -1))

    @cached_property
    def plane_formulas(self) -> tuple[tuple[Formula, ...], ...]:
        """`planes` with every number a Formula."""
        return tuple(tuple(formula(coefficient) for coefficient in plane) for plane in self.planes)

    def height_at(
        self, theta: np.ndarray, xy: np.ndarray, planes: np.ndarray | None = None
    ) -> np.ndarray:
        """Return heights (n,) of `theta`, or its `planes`, at `xy` (n, 2), also beyond its plan."""
        planes = self.plane_values(theta) if planes is None else planes
        c, s = math.cos(theta[KAPPA]), math.sin(theta[KAPPA])
        xy_centred = np.asarray(xy, float) - theta[:2]
        u, v = xy_centred @ (c, s), xy_centred @ (-s, c)
        heights = np.stack([u, v, np.ones_like(u)], axis=1) @ planes.T
        if self.strips == 1:
            return np.max([z.min(axis=0) for z in self.split_planes(heights.T)], axis=0)
        half_width = theta[HALF_WIDTH]
        strip = np.clip(
            np.floor((v + half_width) * self.strips / (2 * half_width)), 0, self.strips - 1
        )
        return heights[np.arange(len(u)), strip.astype(int)]

    def planes_at(self, theta: np.ndarray) -> np.ndarray:
        """Return planes (k, 3) over x, y in theta's frame, in the order of `faces`."""
        c, s = math.cos(theta[KAPPA]), math.sin(theta[KAPPA])
        planes = np.array(
            [(a * c - b * s, a * s + b * c, z) for a, b, z in self.plane_values(theta).tolist()]
        )
        planes[:, 2] -= planes[:, :2] @ theta[[CX, CY]]
        return planes

    def part(self, theta: np.ndarray, sigma: Parameters | None = None) -> Part:
        """Return the part of `theta` (9,) in its frame, a rectangle a tooth, or its own plan."""
        theta_p, kappa, translation = self.from_theta(theta)
        planes = self.planes_at(theta)
        outlines = [
            shapely.polygons(translation[:2] + turn_points(ring, kappa))
            for ring in self.plan_rings(theta)
        ]
        if self.strips == 1:
            pieces = self.make_pieces(outlines, planes)
        else:
            pieces = tuple(Piece(o, plane[None]) for o, plane in zip(outlines, planes, strict=True))
        return Part(self.name, pieces, theta_p, kappa, translation, dict(sigma or {}))

    def split_planes(self, planes: np.ndarray) -> list[np.ndarray]:
        """Return the planes (k, ...) of each minimum."""
        return np.split(planes, np.cumsum(self.minima)[:-1]) if self.minima else [planes]

    def make_pieces(self, outlines: Sequence[shapely.Polygon], planes: np.ndarray) -> Pieces:
        """Return a piece for each minimum of `planes` (k, 3) over each of the outlines."""
        groups = self.split_planes(planes)
        return tuple(Piece(outline, group) for outline in outlines for group in groups)

    def plan_rings(self, theta: np.ndarray) -> list[np.ndarray]:
        """Return the corners (n, 2) over u, v of the plan, one rectangle a tooth."""
        half_width, half_length = theta[HALF_WIDTH], theta[HALF_LENGTH]
        ring = np.array(self.rim) * (half_length, half_width)
        breaks = np.linspace(-half_width, half_width, self.strips + 1)
        if self.strips == 1:
            return [ring]
        return [
            np.column_stack([ring[:, 0], [lower, lower, upper, upper]])
            for lower, upper in pairwise(breaks)
        ]


def place_vertices(vertices: np.ndarray, kappa: float, translation: np.ndarray) -> np.ndarray:
    """Turn vertices (n, 3) by `kappa` about Z, and move by T_L (3,): R V + T_L, eq. 9."""
    c, s = math.cos(kappa), math.sin(kappa)
    return vertices @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + translation
