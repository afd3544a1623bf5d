"""The frozen values handed from stage to stage. Arrays are float64; plan geometry is shapely; frames are in the names.

A roof is a max of mins of planes: over the plan,

    z(x, y) = max over pieces whose outline holds (x, y)  of  min over that piece's planes of  a x + b y + c
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from .errors import InputError, NoModelError
from .frames import METRES, LocalFrame, Units
from .status import Grade, Status

if TYPE_CHECKING:
    from .settings import ComposeSettings

ROOF, WALL, GROUND = "RoofSurface", "WallSurface", "GroundSurface"


@dataclass(frozen=True)
class PointCloud:
    """Points of some files: `xyz` (n, 3) world metres, `classification` (n,) or None, `crs` a pyproj CRS or None.

    World metres are the files' coordinates times their units, `units`: of a CRS in feet they are not its coordinates.
    """

    xyz: np.ndarray
    classification: np.ndarray | None = None
    crs: Any = None
    sources: tuple[str, ...] = ()
    units: Units = METRES

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def classes(self) -> np.ndarray:
        """The classification (n,), 0 ("created, never classified") where the files have none."""
        return np.zeros(len(self), np.uint8) if self.classification is None else self.classification


def as_xyz(points: Any) -> np.ndarray:
    """Points as float64 (n, 3), none as (0, 3). Raises InputError for another shape: columns taken for rows make a roof of anything."""
    try:
        xyz = np.asarray(points, float)
    except (TypeError, ValueError):
        raise InputError(
            f"expected points of shape (n, 3), got {type(points).__name__}; pass x, y, z as columns of one array"
        ) from None
    if xyz.size == 0:
        return np.zeros((0, 3))
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise InputError(f"expected points of shape (n, 3), got {xyz.shape}; pass x, y, z as columns")
    return xyz


@dataclass(frozen=True)
class Footprint:
    """One building asked for: a plan polygon in world coordinates (empty if unusable) and what the user knew of it.

    `shift` (x, y in m) is how far it lies beside its roof where that is known; (0, 0) where it is not.
    """

    id: str
    polygon: shapely.Polygon
    attributes: dict[str, Any] = field(default_factory=dict)
    shift: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Piece:
    """Where `outline` covers, the lower envelope of `planes` (k, 3): z = a x + b y + c, in the outline's frame."""

    outline: shapely.Polygon
    planes: np.ndarray

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Height (n,) of the lower envelope at `xy` (n, 2), the outline not asked."""
        return (np.asarray(xy, float) @ self.planes[:, :2].T + self.planes[:, 2]).min(axis=1)

    def moved(self, shift: np.ndarray) -> Piece:
        """The piece moved by `shift` (3,): its outline, and its planes with it."""
        planes = self.planes.copy()
        planes[:, 2] += shift[2] - planes[:, :2] @ shift[:2]
        return Piece(shapely.transform(self.outline, lambda xy: xy + shift[:2]), planes)


@dataclass(frozen=True)
class Part:
    """One primitive of a roof: its type (a name of the catalogue, or "free"), parameters and the pieces it covers.

    `parameters` are theta_p by name (metres), `kappa` the rotation about Z (rad), `translation` T_L (3,) in the roof's
    local frame, `sigma` the standard deviation by parameter name. A saw-tooth has a piece a tooth; all others have one.
    """

    type: str
    pieces: tuple[Piece, ...]
    parameters: dict[str, float] = field(default_factory=dict)
    kappa: float = 0.0
    translation: np.ndarray = field(default_factory=lambda: np.zeros(3))
    sigma: dict[str, float] = field(default_factory=dict)

    @property
    def area(self) -> float:
        return float(sum(piece.outline.area for piece in self.pieces))

    def height_at(self, xy_local: np.ndarray) -> np.ndarray:
        """Height (n,) at `xy_local` (n, 2) in the roof's frame; minus infinity beside the part, for roofs are the max of these."""
        z = np.full(len(xy_local), -np.inf)
        for piece in self.pieces:
            inside = shapely.intersects_xy(piece.outline, xy_local[:, 0], xy_local[:, 1])
            if inside.any():
                z[inside] = np.maximum(z[inside], piece.height_at(xy_local[inside]))
        return z


@dataclass(frozen=True)
class Roof:
    """All parts of one building's roof in the local `frame`, over the plan `outline` (may have holes)."""

    parts: tuple[Part, ...]
    outline: shapely.Polygon
    frame: LocalFrame

    @property
    def pieces(self) -> tuple[Piece, ...]:
        return tuple(piece for part in self.parts for piece in part.pieces)

    def height_at(self, xy_local: np.ndarray) -> np.ndarray:
        """Roof height (n,) at `xy_local` (n, 2) in the local frame; NaN where no piece covers."""
        xy_local = np.asarray(xy_local, float)
        z = np.max([part.height_at(xy_local) for part in self.parts], axis=0)
        return np.where(np.isfinite(z), z, np.nan)


@dataclass(frozen=True)
class Face:
    """A planar polygon of a solid: `rings` of vertex indices (outer ring first, counter-clockwise seen from outside).

    `kind` is RoofSurface, WallSurface or GroundSurface; `part` the index of the roof part of a RoofSurface, else -1.
    """

    rings: tuple[tuple[int, ...], ...]
    kind: str
    part: int = -1


@dataclass(frozen=True)
class Solid:
    """A closed shell: `vertices` (n, 3), in world coordinates within a Building, `faces` oriented outwards.

    `defects` are (ISO 19107 code, face) of a shell read from a file that its vertices cannot show, such as an open ring.
    """

    vertices: np.ndarray
    faces: tuple[Face, ...]
    defects: tuple[tuple[int, int], ...] = ()

    def moved(self, shift: np.ndarray) -> Solid:
        return Solid(self.vertices + shift, self.faces, self.defects)

    def of_kind(self, kind: str) -> tuple[Face, ...]:
        return tuple(face for face in self.faces if face.kind == kind)

    def plan_of(self, face: Face) -> shapely.Polygon:
        """A face of the solid in plan, its holes left out."""
        outer, *holes = (self.vertices[list(ring), :2] for ring in face.rings)
        return shapely.Polygon(outer, holes)


@dataclass(frozen=True)
class Quality:
    """How well a model stands for its points; metres unless named otherwise, NaN where it cannot be told."""

    points: int = 0
    density: float = float("nan")
    psd_mean: float = float("nan")
    psd_std: float = float("nan")
    rmse: float = float("nan")
    p95: float = float("nan")
    share_within_20cm: float = float("nan")
    outline_iou: float = float("nan")
    nodata_share: float = float("nan")
    unexplained_area_m2: float = float("nan")


@dataclass(frozen=True)
class Fit:
    """One primitive fitted to points: the outcome of `fit_roof`.

    `parameters` theta_p by name in metres, `kappa` rad, `translation` T_L (3,) relative to `global_translation`
    T_G (3,), `sigma` standard deviations by name (parameters, "kappa", "t_x", "t_y", "t_z") where points tell them, `bic`
    of the chosen type and `bics` of every type tried (lower is better), `value` the objective at the optimum. `vertices` (n, 3) and
    `faces` (vertex indices, counter-clockwise from above) are the roof surfaces in the frame of the points given.
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
        """Roof height (n,) at `xy` (n, 2), both in the frame of the points given; NaN outside the outline."""
        frame = LocalFrame(self.global_translation)
        roof = Roof((self.part,), self.part.pieces[0].outline, frame)
        return roof.height_at(frame.to_local(np.asarray(xy, float))) + self.global_translation[2]


@dataclass(frozen=True)
class Model:
    """What was built of a building: its `roof` in a local frame and the `solid` that it closes, in world coordinates.

    `compose` says how, None for the defaults: a changed building is composed as it was.
    """

    roof: Roof
    solid: Solid
    compose: ComposeSettings | None = None

    @cached_property
    def shown_m2(self) -> tuple[float, ...]:
        """Plan area that each part of the roof shows from above, 0 of one that others hide."""
        from .write.shown import shown_m2

        return shown_m2(self)

    @property
    def main(self) -> int:
        """Index of the main part: the one that shows the largest area. Its type is the building's."""
        return self.shown_m2.index(max(self.shown_m2))


@dataclass(frozen=True)
class Building:
    """Everything known of one building after reconstruction; `solid` and `terrain_intersection` in world coordinates.

    `built` is its model, None when `status.is_model` is false; `model`, `roof` and `solid` are there without asking, or raise
    NoModelError. `detail` is the sentence that explains the status for this building. `grade` says how good the model
    is by its points, None where it was not measured. `ground_source` names where `z_ground` (world) came from; `terrain_intersection` holds (m, 3) closed
    lines. `recognised` are the network's probabilities by roof type, `types` those after the fits, where a choice was made. `footprint` (world) and `attributes`
    are the input's own; `shift` (m) is how far the footprint was moved onto its roof.
    """

    id: str
    status: Status
    detail: str = ""
    built: Model | None = None
    quality: Quality = field(default_factory=Quality)
    z_ground: float = float("nan")
    ground_source: str = ""
    terrain_intersection: tuple[np.ndarray, ...] = ()
    objective: float = float("nan")
    recognised: dict[str, float] = field(default_factory=dict)
    types: dict[str, float] = field(default_factory=dict)
    footprint: shapely.Polygon | None = None
    attributes: dict[str, Any] = field(default_factory=dict)
    shift: tuple[float, float] = (0.0, 0.0)
    grade: Grade | None = None

    @property
    def model(self) -> Model:
        """Roof and solid. Raises NoModelError, which says why, for a building that has none.

        >>> from hiproof.status import Status
        >>> Building("shed", Status.NO_POINTS).model
        Traceback (most recent call last):
        hiproof.errors.NoModelError: expected a building with a model, got shed without one (no model: no usable points inside \
the footprint; add a cloud that covers it); `built` is None there
        """
        if self.built is None:
            raise NoModelError(
                f"expected a building with a model, got {self.id} without one ({self.detail or self.status.value}); "
                "`built` is None there"
            )
        return self.built

    @property
    def roof(self) -> Roof:
        """The model's roof, in its local frame. Raises NoModelError without a model."""
        return self.model.roof

    @property
    def solid(self) -> Solid:
        """The model's solid, in world coordinates. Raises NoModelError without a model."""
        return self.model.solid

    @property
    def type(self) -> str | None:
        """Roof type of the part that shows the largest area, None without a model."""
        return None if self.built is None else self.parts[self.built.main].type

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts of the roof, none without a model."""
        return () if self.built is None else self.built.roof.parts

    @property
    def volume(self) -> float:
        """Volume of the solid [m3]. Raises NoModelError without a model.

        >>> import hiproof
        >>> x, y = np.meshgrid(np.arange(0.25, 10, 0.5), np.arange(0.25, 6, 0.5))
        >>> box = shapely.box(0, 0, 10, 6)
        >>> level = hiproof.reconstruct(np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 5.0)]), box)
        >>> round(level.volume / (5.0 - level.z_ground))
        60
        """
        from .compose.solid import volume

        return volume(self.solid)

    def with_part(self, index: int, **change: Any) -> Building:
        """The building with part `index` changed, or with one more part where `index` is the number of parts.

        A change names any of `type`, `ridge_height` and `eave_height` (world metres), `position` (x, y of the rectangle's
        centre and z of the lowest eave, about `roof.frame.origin`), `rotation` (degrees, of the length from the x axis),
        `outlines` (rings of the polygons that it roofs) and parameters of the type by name (metres, degrees). Another type
        keeps rectangle, eave and rise; a part that is moved or resized roofs what its rectangle covers. Solids are composed as the
        building's was; figures of the earlier model do not stay. Raises InputError for what makes no roof, CompositionError for what makes no solid.

        >>> import hiproof
        >>> x, y = np.meshgrid(np.arange(0, 10, 0.5), np.arange(0, 6, 0.5))
        >>> house = hiproof.reconstruct(np.column_stack([x.ravel(), y.ravel(), 5 - 0.5 * abs(y.ravel() - 2.75)]))
        >>> house.with_part(0, type="hip", ridge_height=6.0).type
        'hip'
        """
        from .parametric.edit import with_part

        return with_part(self, index, **change)

    def without_part(self, index: int) -> Building:
        """The building without part `index`; what it roofed alone is roofed by the part beside it. Raises as `with_part`."""
        from .parametric.edit import without_part

        return without_part(self, index)

    def refit(self, points: np.ndarray, fixed: dict[int, tuple[str, ...]] | None = None) -> Building:
        """The building with all heights, pitches and inner lengths of its parts fitted to `points` (n, 3) world metres.

        Types, rectangles and what `fixed` names (parameters by part, "z" the position's height) stay as they are. The
        quality and grade are measured on the points. Raises FitError for fewer than three points inside the outline.
        """
        from .parametric.refit import refit

        return refit(self, points, fixed)

    def _repr_html_(self) -> str:
        """A small view in a notebook, turned by dragging; it asks nothing of the network."""
        from .draw.html import html_of

        return html_of(self)
