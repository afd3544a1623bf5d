"""One family of roof shapes: a rectangle with at most five planes.

The planes rise along the rectangle's two axes.

A member has a plane rising from its eave on some of the four sides of its rectangle, and perhaps a
level top:

    front (from -v), back (from +v), left (from -u), right (from +u), top

Which it has is its name; heights of the eaves, pitches and the top are its parameters. Where these
are as regular as a shape of the catalogue (level eaves, equal pitches) its parameters are that
shape's, else they are given side by side:

    width, length   the rectangle across and along (m)
    height          of a level top above T_L (m)
    pitch_SIDE      the slope of the side's plane (degrees)
    eave_SIDE       the height of that side's eave in its middle above T_L (m), which is the lowest
                    eave
    skew_SIDE       how far the side's plane faces off its axis (degrees), where it does

Where walls cut a corner of the rectangle off it may have planes over these, too (`cants`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import shapely

from ..data_files import Values
from ..errors import FitError
from ..model import Part, Piece
from .cants import compute_cant_planes, name_cant_values, no_cants, read_cants, turn_cants
from .catalogue import CATALOGUE, get
from .contract import (
    BACK,
    FRONT,
    HALF_LENGTH,
    HALF_WIDTH,
    KAPPA,
    LEFT,
    LEVEL,
    Q0,
    RIGHT,
    SIDES,
    Parameters,
    Placed,
    Primitive,
)

AXIS = np.array([0, 0, 1, 1])
# the plane from the left rises to +u, from the right to -u, ...
SIGN = np.array([1.0, -1.0, 1.0, -1.0])
# which side becomes left, right, front, back when the axes turn by 90, 180, 270 degrees, and the
# sign that their leans take then
QUARTER_TURN = [FRONT, BACK, RIGHT, LEFT]
HALF_TURN = [RIGHT, LEFT, BACK, FRONT]
OTHER_TURN = [BACK, FRONT, LEFT, RIGHT]
LEANS_TURN = np.array([-1.0, -1.0, 1.0, 1.0])
TURNS = {1: (QUARTER_TURN, LEANS_TURN), 2: (HALF_TURN, -np.ones(4)), 3: (OTHER_TURN, -LEANS_TURN)}
SAME = 1e-9  # m; numerically equal
ALONG_COSINE = 0.7  # cosine of the angle within which a member is seen from the same side
NEGLIGIBLE = 1e-18  # m2 or square degrees; numerically no variance
# of the sides' rise: an end's eave so far above theirs makes the hip a half hip
HALF_HIP_SHARE = 0.15


def describe_sides(shape: Primitive) -> tuple[bool, int, int]:
    """Return whether a shape has a top, and its rising planes along u and across v."""
    along = sum(side in (LEFT, RIGHT) for side in shape.sides)
    return LEVEL in shape.sides, along, sum(side in (FRONT, BACK) for side in shape.sides)


def list_eaves(shape: Primitive) -> tuple[int, ...]:
    """Return the sides from which a shape has planes."""
    return tuple(sorted(side for side in shape.sides if side != LEVEL))


# shapes of the family with planes on as many sides
ALIKE: dict[tuple[bool, int, int], list[Primitive]] = {}
for member in CATALOGUE.values():
    if member.is_of_family:
        ALIKE.setdefault(describe_sides(member), []).append(member)
# The general one of each, by (has a top, planes along u, planes across v), and which sides have
# planes in its own direction.
GENERAL_SHAPES = {has: (shapes[0].name, list_eaves(shapes[0])) for has, shapes in ALIKE.items()}
# Names told apart by eaves and pitches alone: one may be described as the other.
KIN = tuple(tuple(shape.name for shape in shapes) for shapes in ALIKE.values() if len(shapes) > 1)
COMPONENTS = {
    "gambrel": ("gable", "truncated_gable"),
    "shed": ("monopitch",),
}  # what the larger shapes are put together from


@dataclass(frozen=True)
class Member:
    """A shape of the family: a rectangle, eaves, slopes and a level top.

    `kappa` (rad) is its direction, `centre` (2,) its middle, `half` (2,) its extents along u and v.
    `eaves` (4,) are heights at their own sides, infinite where a side has no plane. `slopes` is
    (4,), and the height of the level `top` is infinite without one. `leans` (4,) are what the
    planes rise along their sides, as shares of their slopes, and `cants` (4, c) further planes.
    Several of one `kappa` that have planes on the same sides may be one `Member`: its arrays then
    have a further axis, and its `top` is an array, with one place for each.

    >>> gable = Member(0.0, np.zeros(2), np.array([6.0, 4.0]), np.array([np.inf, np.inf, 5.0,
    ...     5.0]), np.array([0, 0, 0.5, 0.5]))
    >>> gable.name, gable.describe()[0]
    ('gable', {'width': 8.0, 'length': 12.0, 'height': 2.0})
    """

    kappa: float
    centre: np.ndarray
    half: np.ndarray
    eaves: np.ndarray
    slopes: np.ndarray
    top: Any = math.inf
    leans: np.ndarray = field(default_factory=lambda: np.zeros(4))
    cants: np.ndarray = field(default_factory=no_cants)

    @cached_property
    def has(self) -> tuple[bool, ...]:
        """Which sides have a plane."""
        eaves = self.eaves if self.eaves.ndim == 1 else self.eaves[:, 0]
        return tuple(map(math.isfinite, eaves.tolist()))

    @cached_property
    def sides(self) -> tuple[int, ...]:
        """The sides that have a plane."""
        return tuple(side for side in range(4) if self.has[side])

    @cached_property
    def has_top(self) -> bool:
        """Whether there is a level top."""
        return math.isfinite(self.top if self.eaves.ndim == 1 else self.top[0])

    @property
    def general_shape(self) -> tuple[str, tuple[int, ...]]:
        """Of SHAPES the one with planes on as many sides."""
        along, across = sorted((sum(self.has[:2]), sum(self.has[2:])))
        return GENERAL_SHAPES[self.has_top, along, across]

    @property
    def base(self) -> Any:
        """Height of the lowest eave, of the top where there is none: z of T_L."""
        eaves = [eaves.min(axis=0) for eaves in (self.eaves, self.cants[2]) if len(eaves)]
        return np.minimum.reduce(eaves) if any(self.has) else self.top

    def those(self, which: int | list[int]) -> Member:
        """Select one or some of several."""
        names = ("centre", "half", "eaves", "slopes", "top", "leans")
        selected = {name: getattr(self, name)[..., which] for name in names}
        cants = self.cants[..., which] if self.cants.shape[1] else no_cants()
        return replace(self, **selected, cants=cants)

    def compute_local_planes(self) -> list[tuple[float, float, float]]:
        """Return planes a, b, c over u, v about the centre: sides in order, cants, the top."""
        planes: list[tuple[float, float, float]] = []
        for side in self.sides:
            rise, along = SIGN[side] * self.slopes[side], self.leans[side] * self.slopes[side]
            middle = self.eaves[side] + self.slopes[side] * self.half[side // 2]
            planes.append((rise, along, middle) if side < FRONT else (along, rise, middle))
        planes += compute_cant_planes(self.cants)
        return [*planes, (0.0, 0.0, self.top)] if self.has_top else planes

    def planes(self) -> np.ndarray:
        """Return planes (k, 3) over x, y in the frame of `kappa` and `centre`."""
        c, s = math.cos(self.kappa), math.sin(self.kappa)
        planes = np.array(self.compute_local_planes()) @ np.array(
            [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
        )
        planes[:, 2] -= planes[:, :2] @ self.centre
        return planes

    def apex(self, axis: int) -> Any:
        """Return the height where the two sides across `axis` meet, infinite without one."""
        side = 2 * axis
        if not (self.has[side] and self.has[side + 1]):
            return math.inf
        (lower, upper), (item, other) = (of[side : side + 2] for of in (self.eaves, self.slopes))
        # from the low side's eave to the ridge
        run = (upper - lower + 2.0 * self.half[axis] * other) / (item + other)
        return lower + item * run

    def turn(self, quarters: int = 1) -> Member:
        """Return the same surface with axes turned by `quarters` (0 to 3) times 90 degrees."""
        if quarters == 0:
            return self
        kappa = math.remainder(self.kappa + 0.5 * math.pi * quarters, 2.0 * math.pi)
        sides, leans_turn = TURNS[quarters]
        return Member(
            kappa,
            self.centre,
            self.half[::-1].copy() if quarters % 2 else self.half,
            self.eaves[sides],
            self.slopes[sides],
            self.top,
            (self.leans[sides].T * leans_turn).T,
            turn_cants(self.cants, quarters),
        )

    def canonical(self) -> Member:
        """Return the same surface turned so that planes lie on the sides that SHAPES says."""
        return self.turn(self.quarter_turns)

    @cached_property
    def quarter_turns(self) -> int:
        """How many turns lead to the canonical direction."""
        _, sides = self.general_shape
        targets = [side in sides for side in range(4)]
        names = []
        places = [LEFT, RIGHT, FRONT, BACK]
        lies = self.lies_along(0), self.lies_along(1)
        for turns in range(4):
            if lies[turns % 2] and [self.has[place] for place in places] == targets:
                names.append((self.order(turns, places), turns))
            places = [places[place] for place in QUARTER_TURN]
        return min(names, default=((), 0))[1]

    def order(self, turns: int, places: list[int]) -> tuple[float, ...]:
        """Return a key that orders members of the same surface.

        The least comes first: steeper, then lower, in front and on the left. The key is that of
        this member after so many `turns`, which bring its sides `places` to the left, right, front
        and back.
        """
        slopes = [float(self.slopes[place]) for place in places]
        eaves = [float(self.eaves[place]) if self.has[place] else 0.0 for place in places]
        gap = (
            slopes[BACK] - slopes[FRONT],
            eaves[FRONT] - eaves[BACK],
            slopes[RIGHT] - slopes[LEFT],
            eaves[LEFT] - eaves[RIGHT],
        )
        ahead = (
            -0.5 * math.pi
            < math.remainder(self.kappa + 0.5 * math.pi * turns, 2.0 * math.pi)
            <= 0.5 * math.pi
        )
        return (*(round(x, 6) for x in gap), not ahead)

    def lies_along(self, axis: int) -> bool:
        """Return whether `axis` is the longer way: the ridge of lower sides, else the side."""
        lower, upper = self.apex(1 - axis), self.apex(axis)
        if math.isfinite(lower) and math.isfinite(upper) and abs(lower - upper) > SAME:
            return lower < upper
        square_like = all(self.has) or not any(self.has)
        return not square_like or bool(self.half[axis] >= self.half[1 - axis] - SAME)

    @cached_property
    def name(self) -> str:
        """The roof type: a name of the catalogue or of the family."""
        name, _ = self.general_shape
        if name not in ("gable", "hip", "side_hip"):
            return name
        member = self.canonical()
        if name == "gable":
            is_even = abs(member.slopes[FRONT] - member.slopes[BACK]) < SAME
            return "gable" if is_even else "asymmetric_gable"
        ends = [side for side in (LEFT, RIGHT) if member.has[side]]
        sides = member.eaves[2:].max()
        drop = min(member.eaves[side] for side in ends) - sides
        if drop > HALF_HIP_SHARE * (member.apex(1) - sides):
            return name.replace("hip", "half_hip")
        if name == "hip" and abs(member.apex(0) - member.apex(1)) < SAME:
            return "pyramid"
        return name

    @cached_property
    def in_catalogue(self) -> tuple[Primitive, np.ndarray] | None:
        """The catalogue's shape, and its canonical theta (9,), of a member in that direction."""
        if self.leans.any() or self.cants.shape[1]:
            return None
        local_planes = self.compute_local_planes()
        for shape in get(self.name).variants:
            theta = self.theta(shape)
            gaps = np.abs(shape.plane_values(theta)[np.argsort(shape.sides)] - local_planes)
            if gaps.max() < SAME * 10.0 and shape.is_proper(theta):
                return shape, shape.canonical_theta(theta)
        return None

    def theta(self, shape: Primitive) -> np.ndarray:
        """Return theta (9,) or (9, m) of `shape`, whose front and right side stand for all."""
        if shape.read_member is None:
            raise FitError(
                f"expected a shape of at most one plane a side, got {shape.name}; name its "
                "parameters"
            )
        theta = np.zeros((9, *self.eaves.shape[1:]))
        theta[:KAPPA], theta[KAPPA] = self.centre, self.kappa
        theta[HALF_WIDTH], theta[HALF_LENGTH] = self.half[1], self.half[0]
        for k, q in enumerate(shape.read_member(self)):
            theta[Q0 + k] = q
        return theta

    def describe(self, as_catalogue: bool = True) -> Placed:
        """Return named parameters, kappa and T_L (3,), in the canonical direction."""
        return self.canonical().in_words(as_catalogue)

    def in_words(self, as_catalogue: bool) -> Placed:
        """Describe a member that is in its canonical direction."""
        if not as_catalogue or self.in_catalogue is None:
            return self.side_by_side()
        shape, theta = self.in_catalogue
        return shape.from_theta(theta)

    def side_by_side(self) -> Placed:
        """Return each side's own named parameters, kappa and T_L (3,)."""
        parameters = {name: float(value) for name, value in self.list_side_measures().items()}
        return parameters, self.kappa, np.array([*self.centre, self.base])

    def list_side_measures(self) -> Values:
        """Return each side's own parameters by name."""
        parameters, base = {"width": 2.0 * self.half[1], "length": 2.0 * self.half[0]}, self.base
        if self.has_top:
            parameters["height"] = self.top - base
        for side in self.sides:
            parameters[f"pitch_{SIDES[side]}"] = degrees(self.slopes[side])
            parameters[f"eave_{SIDES[side]}"] = self.eaves[side] - base
            if self.leans[side].any():
                parameters[f"skew_{SIDES[side]}"] = degrees(self.leans[side])
        return parameters | name_cant_values(self.cants, base)

    def measure_as(self, shape: Primitive | None, kappa: float) -> Values:
        """Return the parameters and t_z that this member has as `shape`, by name.

        Each of several has its own. Without a shape they are side by side. They are seen from
        `kappa` or its opposite, so that a small change does not turn the member round.
        """
        if shape is None:
            return {**self.list_side_measures(), "t_z": self.base}
        aligned = self.turn(2) if math.cos(self.kappa - kappa) < 0.0 else self
        theta = aligned.theta(shape)
        if math.cos(aligned.kappa - kappa) <= ALONG_COSINE:
            theta = np.apply_along_axis(shape.canonical_theta, 0, theta)
        values = shape.measures_at(list(theta[HALF_WIDTH:]))
        return dict(zip([*shape.measures, "t_z"], values, strict=True))

    def part(
        self,
        outlines: list[shapely.Polygon],
        name: str | None = None,
        changes: Member | None = None,
        untold: int = 0,
    ) -> Part:
        """Return a part of this shape that roofs `outlines`.

        It is in the frame of `kappa` and `centre`, and called `name` if that is its kin. This
        member must be its canonical one; `changes` are, in the same direction, several: this one
        after independent changes of one standard deviation each. The last of them, `untold`, are
        changes that nothing tells: parameters that these change have no deviation.
        """
        as_catalogue = name in (None, self.name)
        words = self.in_words(as_catalogue)
        sigma = {} if changes is None else self.sigma(changes, untold, as_catalogue, words)
        name = name or self.name
        planes = compute_planes(name, *words)
        return Part(name, tuple(Piece(o, planes) for o in outlines), *words, sigma)

    def sigma(
        self,
        changes: Member,
        untold: int,
        as_catalogue: bool,
        words: Placed,
    ) -> dict[str, float]:
        """Return deviations of a part's parameters (`words`) and t_z by name."""
        parameters, kappa, translation = words
        shape = self.in_catalogue[0] if as_catalogue and self.in_catalogue is not None else None
        informed = changes.eaves.shape[1] - untold
        straight = {f"skew_{side}": np.zeros(informed + untold) for side in SIDES}
        changed = straight | changes.measure_as(shape, kappa)
        deviations = {}
        for name, value in {**parameters, "t_z": float(translation[2])}.items():
            squares = (changed[name] - value) ** 2
            variance = squares[:informed].sum()
            if variance > NEGLIGIBLE and not squares[informed:].sum() > NEGLIGIBLE:
                deviations[name] = math.sqrt(variance)
        return deviations


def degrees(rise: Any) -> Any:
    """Return the angle (degrees) of a `rise` over run, of one or several (m,)."""
    return np.degrees(np.arctan(rise)) if np.ndim(rise) else math.degrees(math.atan(rise))


def name_among(name: str, allowed: tuple[str, ...]) -> str | None:
    """Return `name` if it is allowed, else the allowed name of its kin, or None.

    All names are allowed where `allowed` is empty.

    >>> name_among("pyramid", ("gable", "hip")), name_among("corner", ("gable",))
    ('hip', None)
    """
    if not allowed or name in allowed:
        return name
    return next((kin for kins in KIN if name in kins for kin in kins if kin in allowed), None)


def compute_planes(
    name: str, parameters: Parameters, kappa: float, translation: np.ndarray
) -> np.ndarray:
    """Return the planes (k, 3) over x, y of a roof type with its parameters.

    This is the inverse of `Member.describe`. Raises FitError for a name that is no type or
    parameters that are not its own.

    >>> compute_planes("monopitch", {"width": 4.0, "length": 9.0, "height": 2.0}, 0.0,
    ...     np.array([0.0,
    ...     0.0, 5.0])).tolist()
    [[0.0, 0.5, 6.0]]
    """
    if name in CATALOGUE and not any(key.startswith("pitch_") for key in parameters):
        shape = get(name).variant(parameters)
        return shape.planes_at(shape.to_theta(parameters, kappa, translation))
    return read_member(name, parameters, kappa, translation).planes()


def read_member(name: str, parameters: Parameters, kappa: float, translation: np.ndarray) -> Member:
    """Read a member of its parameters, the catalogue's or each side's; FitError without one."""
    if name not in CATALOGUE:
        raise FitError(
            f"expected a roof type ({', '.join(CATALOGUE)}), got {name!r}; choose one of these"
        )
    if not any(key.startswith("pitch_") for key in parameters):
        return convert_to_member(get(name).variant(parameters), parameters, kappa, translation)
    *sides, top = (side in get(name).sides for side in range(5))
    eaves, slopes, leans = np.full(4, np.inf), np.zeros(4), np.zeros(4)
    try:
        for side in np.flatnonzero(sides):
            eaves[side] = translation[2] + parameters[f"eave_{SIDES[side]}"]
            slopes[side] = math.tan(math.radians(parameters[f"pitch_{SIDES[side]}"]))
            leans[side] = math.tan(math.radians(parameters.get(f"skew_{SIDES[side]}", 0.0)))
        cants = read_cants(parameters, translation[2])
        height = translation[2] + parameters["height"] if top else math.inf
        half = 0.5 * np.array([parameters["length"], parameters["width"]])
    except KeyError as missing:
        raise FitError(
            f"expected the parameter {missing.args[0]} of the roof type {name}, got "
            f"{', '.join(parameters)}; give every one"
        ) from missing
    return Member(
        kappa, np.asarray(translation[:2], float), half, eaves, slopes, height, leans, cants
    )


def convert_to_member(
    shape: Primitive, parameters: Parameters, kappa: float, translation: np.ndarray
) -> Member:
    """Return the member of the same surface as the catalogue's `shape`."""
    theta = shape.to_theta(parameters, kappa, translation)
    half = theta[[HALF_LENGTH, HALF_WIDTH]]
    eaves, slopes, top = np.full(4, np.inf), np.zeros(4), math.inf
    for side, plane in zip(shape.sides, shape.plane_values(theta), strict=True):
        if side == LEVEL:
            top = float(plane[2])
        else:
            slopes[side] = abs(plane[AXIS[side]])
            eaves[side] = plane[2] - slopes[side] * half[AXIS[side]]
    return Member(kappa, theta[:2].copy(), half, eaves, slopes, top)
