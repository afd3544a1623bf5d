"""A roof is a max of mins of planes.

Over the plan,

z(x, y) = max over pieces whose outline holds (x, y) of min over that piece's planes of a x + b y +
c
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely

from ..frames import LocalFrame


@dataclass(frozen=True)
class Piece:
    """The lower envelope of `planes` (k, 3), z = a x + b y + c, over an `outline`."""

    outline: shapely.Polygon
    planes: np.ndarray

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the height (n,) of the lower envelope at `xy` (n, 2), whatever the outline."""
        return (np.asarray(xy, float) @ self.planes[:, :2].T + self.planes[:, 2]).min(axis=1)

    def move(self, shift: np.ndarray) -> Piece:
        """Return the piece moved by `shift` (3,), with its outline and planes."""
        planes = self.planes.copy()
        planes[:, 2] += shift[2] - planes[:, :2] @ shift[:2]
        return Piece(shapely.transform(self.outline, lambda xy: xy + shift[:2]), planes)


@dataclass(frozen=True)
class Part:
    """One primitive of a roof: its type, its parameters and its pieces.

    The type is a name of the catalogue, or "free". `parameters` are theta_p by name (metres),
    `kappa` the rotation about Z (rad), `translation` T_L (3,) in the roof's local frame, `sigma`
    the standard deviation by parameter name. A saw-tooth has a piece a tooth, and an onion several
    over one outline; all others have one.
    """

    type: str
    pieces: tuple[Piece, ...]
    parameters: dict[str, float] = field(default_factory=dict)
    kappa: float = 0.0
    translation: np.ndarray = field(default_factory=lambda: np.zeros(3))
    sigma: dict[str, float] = field(default_factory=dict)

    @property
    def area(self) -> float:
        return float(sum(outline.area for outline in self.outlines))

    @property
    def outlines(self) -> list[shapely.Polygon]:
        """The outlines of the pieces, each once."""
        return list(dict.fromkeys(piece.outline for piece in self.pieces))

    def height_at(self, xy_local: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy_local` (n, 2) in the roof's frame, -inf beside the part."""
        z = np.full(len(xy_local), -np.inf)
        for piece in self.pieces:
            inside = shapely.intersects_xy(piece.outline, xy_local[:, :2])
            if inside.any():
                z[inside] = np.maximum(z[inside], piece.height_at(xy_local[inside]))
        return z


@dataclass(frozen=True)
class Roof:
    """All parts of one building's roof in the local `frame`, over `outline` (may have holes)."""

    parts: tuple[Part, ...]
    outline: shapely.Polygon
    frame: LocalFrame

    @property
    def world_outline(self) -> shapely.Polygon:
        """The outline in world coordinates."""
        return shapely.transform(self.outline, self.frame.to_world)

    @property
    def pieces(self) -> tuple[Piece, ...]:
        return tuple(piece for part in self.parts for piece in part.pieces)

    def height_at(self, xy_local: np.ndarray) -> np.ndarray:
        """Return the roof height (n,) at `xy_local` (n, 2), NaN where no piece covers it."""
        xy_local = np.asarray(xy_local, float)
        z = np.max([part.height_at(xy_local) for part in self.parts], axis=0)
        return np.where(np.isfinite(z), z, np.nan)


@dataclass(frozen=True)
class Fit:
    """One primitive fitted to points: the outcome of `fit_roof`.

    `parameters` theta_p by name in metres, `kappa` rad, `translation` T_L (3,) relative to
    `global_translation` T_G (3,), `sigma` standard deviations by name (parameters, "kappa", "t_x",
    "t_y", "t_z") where points tell them, `bic` of the chosen type and `bics` of every type tried
    (lower is better), `value` the objective at the optimum. `vertices` (n, 3) and `faces` (vertex
    indices, counter-clockwise from above) are the roof surfaces in the frame of the points given.
    """

    type: str
    parameters: dict[str, float]
    kappa: float
    translation: np.ndarray
    global_translation: np.ndarray
    sigma: dict[str, float]
    objective: str
    value: float
    bic: float
    bics: dict[str, float]
    points_used: int
    noise_m: float
    outlier_share: float
    evaluations: int
    part: Part
    vertices: np.ndarray
    faces: tuple[tuple[int, ...], ...]

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the roof height (n,) at `xy` (n, 2) in the points' frame, NaN outside."""
        frame = LocalFrame(self.global_translation)
        roof = Roof((self.part,), self.part.pieces[0].outline, frame)
        return roof.height_at(frame.to_local(np.asarray(xy, float))) + self.global_translation[2]
