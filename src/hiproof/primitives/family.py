"""One family of roof shapes: a rectangle, its direction, and at most five planes along its two axes.

A member has a plane rising from its eave on some of the four sides of its rectangle, and perhaps a level top:

    front (from -v), back (from +v), left (from -u), right (from +u), top

Which it has is its name; heights of the eaves, pitches and the top are its parameters. Where these are as regular as a shape of the
catalogue (level eaves, equal pitches) its parameters are that shape's, else they are given side by side:

    width, length   the rectangle across and along (m)
    height          of a level top above T_L (m)
    pitch_SIDE      the slope of the side's plane (degrees)
    eave_SIDE       the height of that side's eave in its middle above T_L (m), which is the lowest eave
    skew_SIDE       how far the side's plane faces off its axis (degrees), where it does
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import shapely

from ..errors import FitError
from ..model import Part, Piece
from .catalogue import CATALOGUE, get
from .contract import BACK, FRONT, HALF_LENGTH, HALF_WIDTH, KAPPA, LEFT, LEVEL, RIGHT, Primitive

SIDES = ("left", "right", "front", "back")
AXIS = np.array([0, 0, 1, 1])
SIGN = np.array([1.0, -1.0, 1.0, -1.0])  # the plane from the left rises to +u, from the right to -u, ...
# which side becomes left, right, front, back when the axes turn by 90, 180, 270 degrees, and the sign that their leans take then
QUARTER_TURN, HALF_TURN, OTHER_TURN = [FRONT, BACK, RIGHT, LEFT], [RIGHT, LEFT, BACK, FRONT], [BACK, FRONT, LEFT, RIGHT]
LEANS_TURN = np.array([-1.0, -1.0, 1.0, 1.0])
TURNS = {1: (QUARTER_TURN, LEANS_TURN), 2: (HALF_TURN, -np.ones(4)), 3: (OTHER_TURN, -LEANS_TURN)}
SAME = 1e-9  # m; numerically equal
ALONG = 0.7  # cosine of the angle within which a member is seen from the same side
HALF_HIP_SHARE = 0.15  # of the sides' rise: an end's eave so far above theirs makes the hip a half hip


def has_of(shape: Primitive) -> tuple[bool, int, int]:
    """Whether a shape of the family has a top, and how many planes along u and across v."""
    along = sum(side in (LEFT, RIGHT) for side in shape.sides)
    return LEVEL in shape.sides, along, sum(side in (FRONT, BACK) for side in shape.sides)


def eaves_of(shape: Primitive) -> tuple[int, ...]:
    """The sides from which a shape has planes."""
    return tuple(sorted(side for side in shape.sides if side != LEVEL))


ALIKE: dict[tuple[bool, int, int], list[Primitive]] = {}  # shapes of the family with planes on as many sides
for member in CATALOGUE.values():
    if member.is_of_family:
        ALIKE.setdefault(has_of(member), []).append(member)
# The general one of each, by (has a top, planes along u, planes across v), and which sides have planes in its own direction.
SHAPES = {has: (shapes[0].name, eaves_of(shapes[0])) for has, shapes in ALIKE.items()}
# Names told apart by eaves and pitches alone: one may be described as the other.
KIN = tuple(tuple(shape.name for shape in shapes) for shapes in ALIKE.values() if len(shapes) > 1)
COMPONENTS = {
    "gambrel": ("gable", "truncated_gable"),
    "shed": ("monopitch",),
}  # what the larger shapes are put together from


@dataclass(frozen=True)
class Member:
    """A shape of the family: `kappa` (rad), `centre` (2,) and `half` (2,) extents along u and v, heights of the eaves (4,) at
    their own sides, infinite where a side has no plane, `slopes` (4,), and the height of the level `top`, infinite without one.
    `leans` (4,) are what the planes rise along their sides, as shares of their slopes.

    >>> gable = Member(0.0, np.zeros(2), np.array([6.0, 4.0]), np.array([np.inf, np.inf, 5.0, 5.0]), np.array([0, 0, 0.5, 0.5]))
    >>> gable.name, gable.describe()[0]
    ('gable', {'width': 8.0, 'length': 12.0, 'height': 2.0})
    """

    kappa: float
    centre: np.ndarray
    half: np.ndarray
    eaves: np.ndarray
    slopes: np.ndarray
    top: float = math.inf
    leans: np.ndarray = field(default_factory=lambda: np.zeros(4))

    @cached_property
    def has(self) -> np.ndarray:
        """Which sides (4,) have a plane."""
        return np.isfinite(self.eaves)

    @property
    def base(self) -> float:
        """Height of the lowest eave, of the top where there is none: z of T_L."""
        return float(min(self.eaves.min(), self.top)) if not self.has.any() else float(self.eaves.min())

    def own_planes(self) -> np.ndarray:
        """Planes (k, 3) over u, v about the centre: those of the sides in order, then the top."""
        planes = []
        for side in np.nonzero(self.has)[0]:
            plane = np.zeros(3)
            plane[AXIS[side]] = SIGN[side] * self.slopes[side]
            plane[1 - AXIS[side]] = self.leans[side] * self.slopes[side]
            plane[2] = self.eaves[side] + self.slopes[side] * self.half[AXIS[side]]
            planes.append(plane)
        if math.isfinite(self.top):
            planes.append(np.array([0.0, 0.0, self.top]))
        return np.array(planes)

    def planes(self) -> np.ndarray:
        """Planes (k, 3) over x, y of the frame that `kappa` and `centre` are given in."""
        c, s = math.cos(self.kappa), math.sin(self.kappa)
        planes = self.own_planes() @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        planes[:, 2] -= planes[:, :2] @ self.centre
        return planes

    def apex(self, axis: int) -> float:
        """Height at which the planes of the two sides across `axis` meet, infinite where one is missing."""
        (low, high), (one, other) = self.eaves[2 * axis : 2 * axis + 2], self.slopes[2 * axis : 2 * axis + 2]
        if not (math.isfinite(low) and math.isfinite(high)):
            return math.inf
        run = (high - low + 2.0 * self.half[axis] * other) / (one + other)  # from the low side's eave to the ridge
        return float(low + one * run)

    def over(self, half: np.ndarray) -> Member:
        """The member with its eaves and slopes over a rectangle of other half extents (2,)."""
        return replace(self, half=half)

    def turned(self, quarters: int = 1) -> Member:
        """The same surface with its axes turned by so many times 90 degrees, 0 to 3."""
        if quarters == 0:
            return self
        kappa = math.remainder(self.kappa + 0.5 * math.pi * quarters, 2.0 * math.pi)
        sides, leans_turn = TURNS[quarters]
        half = self.half[::-1].copy() if quarters % 2 else self.half
        eaves, slopes, leans = self.eaves[sides], self.slopes[sides], self.leans[sides] * leans_turn
        return Member(kappa, self.centre, half, eaves, slopes, self.top, leans)

    def canonical(self) -> Member:
        """The same surface in the direction in which it is named: the ridge along u, planes on the sides that SHAPES says."""
        return self.turned(self.quarter_turns)

    @cached_property
    def quarter_turns(self) -> int:
        """How many turns lead to the canonical direction."""
        has = self.has.tolist()
        along, across = sorted((sum(has[:2]), sum(has[2:])))
        _, sides = SHAPES[math.isfinite(self.top), along, across]
        wanted, named, places = [side in sides for side in range(4)], [], [LEFT, RIGHT, FRONT, BACK]
        for turns in range(4):
            if [has[place] for place in places] == wanted and self.lies_along(turns % 2):
                named.append((self.order(turns, places), turns))
            places = [places[place] for place in QUARTER_TURN]
        return min(named, default=((), 0))[1]

    def order(self, turns: int, places: list[int]) -> tuple[float, ...]:
        """Of members of the same surface the least comes first: steeper, then lower, in front and on the left. Of this one after so
        many `turns`, which bring its sides `places` to the left, right, front and back."""
        slopes = [float(self.slopes[place]) for place in places]
        eaves = [float(self.eaves[place]) if self.has[place] else 0.0 for place in places]
        apart = (
            slopes[BACK] - slopes[FRONT],
            eaves[FRONT] - eaves[BACK],
            slopes[RIGHT] - slopes[LEFT],
            eaves[LEFT] - eaves[RIGHT],
        )
        ahead = -0.5 * math.pi < math.remainder(self.kappa + 0.5 * math.pi * turns, 2.0 * math.pi) <= 0.5 * math.pi
        return (*(round(x, 6) for x in apart), not ahead)

    def lies_along(self, axis: int) -> bool:
        """Whether `axis` is the longer way: along the ridge of the sides that meet lower, else of the rectangle."""
        low, high = self.apex(1 - axis), self.apex(axis)
        if math.isfinite(low) and math.isfinite(high) and abs(low - high) > SAME:
            return low < high
        square_like = self.has.all() or not self.has.any()
        return not square_like or bool(self.half[axis] >= self.half[1 - axis] - SAME)

    @cached_property
    def name(self) -> str:
        """The roof type: a name of the catalogue or of the family."""
        along, across = sorted((int(self.has[:2].sum()), int(self.has[2:].sum())))
        name, _ = SHAPES[math.isfinite(self.top), along, across]
        member = self.canonical()
        if name == "gable":
            return "gable" if abs(member.slopes[FRONT] - member.slopes[BACK]) < SAME else "asymmetric_gable"
        if name in ("hip", "side_hip"):
            ends = [side for side in (LEFT, RIGHT) if member.has[side]]
            sides = member.eaves[2:].max()
            drop = min(member.eaves[side] for side in ends) - sides
            if drop > HALF_HIP_SHARE * (member.apex(1) - sides):
                return name.replace("hip", "half_hip")
            if name == "hip" and abs(member.apex(0) - member.apex(1)) < SAME:
                return "pyramid"
        return name

    @cached_property
    def in_catalogue(self) -> Primitive | None:
        """The catalogue's shape that is the same surface, of a member in its canonical direction."""
        if self.leans.any():
            return None
        for shape in get(self.name).variants:
            theta = self.theta(shape)
            planes = shape.plane_values(theta)[np.argsort(shape.sides)]
            if np.abs(planes - self.own_planes()).max() < SAME * 10.0 and shape.is_proper(theta):
                return shape
        return None

    def theta(self, shape: Primitive) -> np.ndarray:
        """theta (9,) of the catalogue's `shape`, by the front and the right side where the others are as these."""
        q = shape.from_member(self)
        return np.array([*self.centre, self.kappa, self.half[1], self.half[0], *q, *[0.0] * (4 - len(q))])

    def in_words_of(self, shape: Primitive, kappa: float | None = None) -> tuple[dict[str, float], float, np.ndarray]:
        """(parameters by name, kappa, T_L (3,)) of the catalogue's `shape` that this member is; seen from `kappa` or its opposite if
        that is told, so that a small change does not turn it round."""
        if kappa is not None:
            opposite = math.cos(self.kappa - kappa) < 0.0
            theta = (self.turned(2) if opposite else self).theta(shape)
            if math.cos(theta[KAPPA] - kappa) > ALONG:
                return shape.from_theta(theta)
        return shape.from_theta(shape.canonical_theta(self.theta(shape)))

    def describe(self, as_catalogue: bool = True) -> tuple[dict[str, float], float, np.ndarray]:
        """(parameters by name, kappa, T_L (3,)) of this member in its canonical direction."""
        return self.canonical().in_words(as_catalogue)

    def in_words(self, as_catalogue: bool) -> tuple[dict[str, float], float, np.ndarray]:
        """`describe` of a member in its canonical direction."""
        shape = self.in_catalogue if as_catalogue else None
        return self.side_by_side() if shape is None else self.in_words_of(shape)

    def side_by_side(self) -> tuple[dict[str, float], float, np.ndarray]:
        """(parameters by name, kappa, T_L (3,)) of this member, each side's own."""
        parameters = {"width": 2.0 * self.half[1], "length": 2.0 * self.half[0]}
        if math.isfinite(self.top):
            parameters["height"] = self.top - self.base
        for side in np.nonzero(self.has)[0]:
            parameters[f"pitch_{SIDES[side]}"] = math.degrees(math.atan(self.slopes[side]))
            parameters[f"eave_{SIDES[side]}"] = self.eaves[side] - self.base
            if self.leans[side]:
                parameters[f"skew_{SIDES[side]}"] = math.degrees(math.atan(self.leans[side]))
        parameters = {name: float(value) for name, value in parameters.items()}
        return parameters, self.kappa, np.array([*self.centre, self.base])

    def sigma(self, changes: list[Member], as_catalogue: bool = True) -> dict[str, float]:
        """Standard deviations by parameter (and t_z) where `changes` are this member after independent changes of one each."""
        shape = self.in_catalogue if as_catalogue else None
        kappa = None if shape is None else shape.canonical_theta(self.theta(shape))[KAPPA]

        def values(member: Member) -> dict[str, float]:
            parameters, _, translation = member.side_by_side() if shape is None else member.in_words_of(shape, kappa)
            return {**parameters, "t_z": float(translation[2])}

        own = values(self)
        moved = np.array([list(values(member).values()) for member in changes]).reshape(-1, len(own))
        variance = ((moved - list(own.values())) ** 2).sum(axis=0)
        return {name: math.sqrt(v) for name, v in zip(own, variance.tolist(), strict=True) if v > 1e-18}

    def part(
        self, outlines: list[shapely.Polygon], name: str | None = None, changes: list[Member] | None = None
    ) -> Part:
        """A part of this shape that roofs `outlines`, in the frame of `kappa` and `centre`; called `name` if that is its kin.

        `changes` are as in `sigma`, in the same direction as this member, which must be its canonical one.
        """
        as_catalogue = name in (None, self.name)
        parameters, kappa, translation = self.in_words(as_catalogue)
        name = name or self.name
        planes = planes_of(name, parameters, kappa, translation)
        sigma = self.sigma(changes or [], as_catalogue)
        return Part(name, tuple(Piece(o, planes) for o in outlines), parameters, kappa, translation, sigma)


def name_among(name: str, allowed: tuple[str, ...]) -> str | None:
    """`name` or, where it is not `allowed`, that of its kin which is; None where none is. All are where `allowed` is empty.

    >>> name_among("pyramid", ("gable", "hip")), name_among("corner", ("gable",))
    ('hip', None)
    """
    if not allowed or name in allowed:
        return name
    return next((kin for kins in KIN if name in kins for kin in kins if kin in allowed), None)


def planes_of(name: str, parameters: Mapping[str, float], kappa: float, translation: np.ndarray) -> np.ndarray:
    """Planes (k, 3) over x, y of the roof type `name` with its parameters: the inverse of `Member.describe`.

    Raises FitError for a name that is no type or parameters that are not its own.

    >>> planes_of("monopitch", {"width": 4.0, "length": 9.0, "height": 2.0}, 0.0, np.array([0.0, 0.0, 5.0])).tolist()
    [[0.0, 0.5, 6.0]]
    """
    if name in CATALOGUE and not any(key.startswith("pitch_") for key in parameters):
        shape = get(name).variant(parameters)
        return shape.planes_at(shape.to_theta(parameters, kappa, translation))
    return member_of(name, parameters, kappa, translation).planes()


def member_of(name: str, parameters: Mapping[str, float], kappa: float, translation: np.ndarray) -> Member:
    """The member with these parameters, the catalogue's or each side's own. Raises FitError where one is missing."""
    if name not in CATALOGUE:
        raise FitError(f"expected a roof type ({', '.join(CATALOGUE)}), got {name!r}; choose one of these")
    if not any(key.startswith("pitch_") for key in parameters):
        return member_like(get(name).variant(parameters), parameters, kappa, translation)
    *sides, top = (side in get(name).sides for side in range(5))
    eaves, slopes, leans = np.full(4, np.inf), np.zeros(4), np.zeros(4)
    try:
        for side in np.flatnonzero(sides):
            eaves[side] = translation[2] + parameters[f"eave_{SIDES[side]}"]
            slopes[side] = math.tan(math.radians(parameters[f"pitch_{SIDES[side]}"]))
            leans[side] = math.tan(math.radians(parameters.get(f"skew_{SIDES[side]}", 0.0)))
        height = translation[2] + parameters["height"] if top else math.inf
        half = 0.5 * np.array([parameters["length"], parameters["width"]])
    except KeyError as missing:
        raise FitError(
            f"expected the parameter {missing.args[0]} of a {name} roof, got {', '.join(parameters)}; give every one"
        ) from missing
    return Member(kappa, np.asarray(translation[:2], float), half, eaves, slopes, height, leans)


def member_like(shape: Primitive, parameters: Mapping[str, float], kappa: float, translation: np.ndarray) -> Member:
    """The member that is the same surface as the catalogue's `shape` with its own parameters."""
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
