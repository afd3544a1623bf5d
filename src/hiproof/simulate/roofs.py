"""Buildings with known truth: one primitive with realistic dimensions, its parts in plan."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from ..errors import InputError
from ..frames import LocalFrame, turn_points
from ..model import Part, Piece, Roof
from ..primitives import CATALOGUE, get

NOT_ROOF = -1  # label of what is no roof, as in segment
# The types of whole roofs: what a building made up at random has where none is named, and what the
# network tells apart.
ROOF_TYPES = (
    *("flat", "monopitch", "gable", "hip", "half_hip"),
    *("pyramid", "mansard", "shed", "asymmetric_gable", "gambrel"),
)


def find_label(type: str | None) -> int:
    """Return the label of a roof type's points, its catalogue place, or NOT_ROOF."""
    return list(CATALOGUE).index(type) if type in CATALOGUE else NOT_ROOF


def make_part(
    type: str, parameters: dict[str, float], kappa: float, translation: np.ndarray
) -> Part:
    """Return one primitive, turned by `kappa` about Z and moved.

    It has theta_p `parameters`, its eave at the height of `translation` (3,); the parameters it
    carries are the canonical ones of its surface.
    """
    primitive = CATALOGUE[type].variant(parameters)
    return primitive.part(
        primitive.canonical_theta(primitive.to_theta(parameters, kappa, translation))
    )


def box(
    xy: np.ndarray, size: tuple[float, float], z_top: float, kappa: float, rise: float = 0.0
) -> Piece:
    """Return a block about `xy` turned by `kappa`, flat, or a gable with `rise`, at `z_top`."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (size[0] / 2, size[1] / 2)
    outline = shapely.Polygon(turn_points(corners, kappa) + xy)
    across, slope = np.array([-math.sin(kappa), math.cos(kappa)]), 2 * rise / size[1]
    signs = np.array([1.0, -1.0]) if rise else np.array([0.0])
    gradient = signs[:, None] * slope * across
    return Piece(outline, np.column_stack([gradient, z_top - gradient @ xy]))


@dataclass(frozen=True)
class SimBuilding:
    """A building made up, with its truth.

    `type` is the roof type of its largest part, `kind` "single" or the compound's kind. `roof` is
    in its own frame, whose origin (world) lies on the ground at the building: local heights are
    heights above that ground. `z_ground` (world).
    """

    type: str
    kind: str
    roof: Roof
    z_ground: float

    @property
    def outline(self) -> shapely.Polygon:
        """Plan outline in the roof's local frame."""
        return self.roof.outline

    @property
    def largest(self) -> Part:
        """The part of the largest outline."""
        return find_largest_part(self.roof)

    @property
    def parameters(self) -> dict[str, float]:
        """theta_p of the largest part, metres."""
        return self.largest.parameters

    @property
    def kappa(self) -> float:
        return self.largest.kappa

    @property
    def footprint(self) -> shapely.Polygon:
        """Plan outline in world coordinates."""
        return shapely.transform(self.outline, self.roof.frame.to_world)

    def truth(self) -> dict:
        """Return type, kind, ground height, origin and parameters, for JSON."""
        return {
            "type": self.type,
            "kind": self.kind,
            "z_ground": float(self.z_ground),
            "origin": [float(c) for c in self.roof.frame.origin],
            "parts": [
                {
                    "type": part.type,
                    "parameters": {name: float(value) for name, value in part.parameters.items()},
                    "kappa": float(part.kappa),
                    "translation": [float(c) for c in part.translation],
                }
                for part in self.roof.parts
            ],
        }


def random_building(
    rng: np.random.Generator,
    type: str | None = None,
    origin: np.ndarray | tuple[float, float, float] = (0.0, 0.0, 0.0),
    kappa: float | None = None,
) -> SimBuilding:
    """Draw a building of one primitive.

    Its ground is at `origin` (world), and it is turned by `kappa` (rad; drawn when None). Raises
    InputError for a type that is not in the catalogue.

    >>> random_building(np.random.default_rng(0), "hip").type
    'hip'
    """
    if type is None:
        type = ROOF_TYPES[rng.integers(len(ROOF_TYPES))]
    if type not in CATALOGUE:
        raise InputError(f"expected a roof type ({', '.join(CATALOGUE)}), got {type!r}")
    kappa = rng.uniform(-math.pi, math.pi) if kappa is None else kappa
    part = make_part(
        type, random_parameters(rng, type), kappa, np.array([0.0, 0.0, random_eave(rng)])
    )
    return assemble((part,), "single", origin)


def assemble(
    parts: tuple[Part, ...], kind: str, origin: np.ndarray | tuple[float, float, float]
) -> SimBuilding:
    """Return `parts` as a building at `origin`; its outline is the union of their pieces."""
    roof = Roof(parts, united_outline(parts), LocalFrame(np.asarray(origin, float)))
    return SimBuilding(find_largest_part(roof).type, kind, roof, float(origin[2]))


def find_largest_part(roof: Roof) -> Part:
    """Return the part of the largest outline, with what others hide of it."""
    return max(roof.parts, key=lambda part: part.area)


def united_outline(parts: tuple[Part, ...]) -> shapely.Polygon:
    """Return the union of all pieces, joined in the first part's axes, on common lines."""
    outlines = [piece.outline for part in parts for piece in part.pieces]
    if len(outlines) == 1:
        return outlines[0]
    aligned = [
        shapely.transform(outline, lambda xy: turn_points(xy, -parts[0].kappa))
        for outline in outlines
    ]
    union = shapely.union_all(aligned, grid_size=1e-6).normalize().reverse()
    return shapely.transform(union.simplify(0.0), lambda xy: turn_points(xy, parts[0].kappa))


def random_eave(rng: np.random.Generator) -> float:
    """Draw the lowest eave's height over the ground: one to four storeys, or a shed."""
    return float(rng.choice((2.4, 3.0, 5.5, 5.8, 8.5, 11.5)) + rng.uniform(-0.3, 0.5))


def random_parameters(rng: np.random.Generator, type: str) -> dict[str, float]:
    """Draw theta_p of one roof of `type`.

    The shapes' own draws keep each type apart from its neighbours in the catalogue: a hip has a
    ridge, a half-hip a gable wall worth the name, an asymmetric gable a visible difference of
    slopes or eaves.
    """
    return get(type).draw_parameters(rng, float(rng.uniform(5.0, 13.0)))
