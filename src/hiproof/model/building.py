"""A building with its model, its quality and what became of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import shapely

from .. import METHODS
from ..errors import NoModelError
from ..log import count_things
from ..settings import ComposeSettings
from ..status import Grade, Status
from .installation import Installation
from .overhang import Eaves
from .roof import Part, Roof
from .shown import compute_visible_pieces, measure_visible_pieces, unite_visible_pieces
from .solid import Solid


@dataclass(frozen=True)
class Passage:
    """A passage below its `ceiling` over its `outline`, both in the roof's frame (m)."""

    outline: shapely.Polygon
    ceiling: float


@dataclass(frozen=True)
class Underside:
    """The lower end of a solid.

    `terrain` holds closed lines (m, 3) along the outline down to which walls reach, in the roof's
    frame; without lines the solid stands on one level. `passages` lead through below it.
    """

    terrain: tuple[np.ndarray, ...] = ()
    passages: tuple[Passage, ...] = ()

    @property
    def is_level(self) -> bool:
        return not (self.terrain or self.passages)


ONE_LEVEL = Underside()


@dataclass(frozen=True)
class Quality:
    """How well a model fits its points (m unless named), NaN where it cannot be computed."""

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
class Model:
    """The model of a building: its `roof` in a local frame, and its `solid`.

    The solid stands in world coordinates. `compose` says how, None for the defaults: a changed
    building is composed as it was. `underside` says how the solid ends below. Where that is not one
    level, `level_solid` is the solid that does stand on one. `installations` stand on the roof.
    `eaves` tells how far the roof reaches beyond the walls, None where nobody asked.
    """

    roof: Roof
    solid: Solid
    compose: ComposeSettings | None = None
    underside: Underside = ONE_LEVEL
    level_solid: Solid | None = None
    installations: tuple[Installation, ...] = ()
    eaves: Eaves | None = None

    @property
    def finest_solid(self) -> Solid:
        """The solid of LoD2.3: with its overhangs, where there are some."""
        return self.solid if self.eaves is None or self.eaves.solid is None else self.eaves.solid

    @property
    def on_one_level(self) -> Solid:
        """The solid as it stands on one level."""
        return self.solid if self.level_solid is None else self.level_solid

    @cached_property
    def visible_pieces(self) -> list[list[shapely.Geometry]]:
        """Plan pieces of each roof part as seen from above, in the roof's frame."""
        return compute_visible_pieces(self.roof, self.solid)

    @cached_property
    def visible_m2(self) -> tuple[float, ...]:
        """Plan area (m2) of each roof part as seen from above; 0 if it is hidden."""
        return measure_visible_pieces(self.visible_pieces)

    @property
    def main(self) -> int:
        """Index of the main part, which shows the largest area and gives the building its type."""
        return self.visible_m2.index(max(self.visible_m2))


@dataclass(frozen=True)
class Building:
    """All that is known of one building after its reconstruction.

    `solid` and `terrain_intersection` are in world coordinates.

    `built` is its model, None when `status.is_model` is false; `model`, `roof` and `solid` are
    there without asking, or raise NoModelError. `detail` is the sentence that explains the status
    for this building. `grade` says how good the model is by its points, None where it was not
    measured. `ground_source` names where `z_ground` (world) came from; `terrain_intersection` holds
    (m, 3) closed lines. `recognised` are the network's probabilities by roof type, `types` those
    after the fits, where a choice was made. `footprint` (world) and `attributes` are the input's
    own; `shift` (m) is how far the footprint was moved onto its roof.
    `change` is what the last update found of it, as in parameters.jsonl; None where it never was
    anything but unchanged. Of several surveys, `survey_date` is that which shows the building, and
    `epochs_used` are those of whose points it is made.
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
    change: dict[str, Any] | None = None
    survey_date: str = ""
    epochs_used: tuple[str, ...] = ()

    @property
    def model(self) -> Model:
        """Roof and solid; raises NoModelError with the reason if there is no model.

        >>> from hiproof.status import Status
        >>> try:
        ...     Building("shed", Status.NO_POINTS).model
        ... except NoModelError as error:
        ...     print(str(error)[:54])
        expected a building with a model, got shed without one
        """
        if self.built is None:
            raise NoModelError(
                f"expected a building with a model, got {self.id} without one "
                f"({self.detail or self.status.value}); `built` is None there"
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
        >>> level = hiproof.reconstruct(np.column_stack([x.ravel(), y.ravel(), np.full(x.size,
        ...     5.0)]), box)
        >>> round(level.volume / (5.0 - level.z_ground))
        60
        """
        return self.solid.volume

    def compute_visible_areas(self) -> list[shapely.Geometry]:
        """Return the visible area of each roof part, in world coordinates.

        The area of a hidden part is empty. Without a model the list is empty.

        >>> from hiproof import build
        >>> ring = [[0, 0], [10, 0], [10, 6], [0, 6]]
        >>> flat = {"type": "flat", "parameters": {"width": 6, "length": 10}, "position": [5, 3, 4]}
        >>> hut = {"type": "flat", "parameters": {"width": 4, "length": 4}, "position": [9, 3, 6]}
        >>> record = {"id": "a", "origin": [0, 0, 0], "z_ground": 0, "outline": [ring],
        ...     "parts": [flat, hut]}
        >>> [area.area for area in build(record).compute_visible_areas()]
        [48.0, 12.0]
        """
        if self.built is None:
            return []
        return unite_visible_pieces(self.roof, self.built.visible_pieces)

    def with_part(self, index: int, **change: Any) -> Building:
        """Return the building with part `index` changed or added.

        A part is added where `index` equals the number of parts.

        A change names any of `type`, `ridge_height` and `eave_height` (world metres), `position`
        (x, y of the rectangle's centre and z of the lowest eave, about `roof.frame.origin`),
        `rotation` (degrees, of the length from the x axis), `outlines` (rings of the polygons that
        it roofs) and parameters of the type by name (metres, degrees). Another type keeps
        rectangle, eave and rise; a part that is moved or resized roofs what its rectangle covers.
        Solids are composed as the building's was; figures of the earlier model do not stay. Raises
        InputError for what makes no roof, CompositionError for what makes no solid.

        >>> import hiproof
        >>> x, y = np.meshgrid(np.arange(0, 10, 0.5), np.arange(0, 6, 0.5))
        >>> house = hiproof.reconstruct(np.column_stack([x.ravel(), y.ravel(),
        ...     5 - 0.5 * abs(y.ravel() - 2.75)]))
        >>> house.with_part(0, type="hip", ridge_height=6.0).type
        'hip'
        """
        return METHODS["with_part"](self, index, **change)

    def without_part(self, index: int) -> Building:
        """Return the building without part `index`.

        The part beside it roofs what this part alone roofed. Raises as `with_part`.
        """
        return METHODS["without_part"](self, index)

    def refit(
        self, points: np.ndarray, fixed: dict[int, tuple[str, ...]] | None = None
    ) -> Building:
        """Fit the heights, pitches and inner lengths of all parts to `points` again.

        `points` (n, 3) are in world metres. Returns a new building. Types, rectangles and what
        `fixed` names (parameters by part, "z" the position's height) stay as they are. The quality
        and grade are measured on the points. Raises FitError for fewer than three points inside the
        outline.
        """
        return METHODS["refit"](self, points, fixed)

    def to_trimesh(self) -> Any:
        """Return the solid as a trimesh.Trimesh in world coordinates.

        Its faces are coloured by roof type.
        Raises NoModelError without a model, InputError where trimesh (extra `trimesh`) is missing.
        """
        return METHODS["to_trimesh"](self)

    def to_pyvista(self) -> Any:
        """Return the solid as a pyvista.PolyData in world coordinates.

        Its cells have a `kind` and a `part`.
        Raises NoModelError without a model, InputError where pyvista (extra `pyvista`) is missing.
        """
        return METHODS["to_pyvista"](self)

    def __repr__(self) -> str:
        """Return the building in one line.

        >>> from hiproof.status import Status
        >>> Building("shed", Status.NO_POINTS)
        <Building 'shed': no_points>
        """
        words = [self.status.code]
        if self.built is not None:
            words += [str(self.type), count_things(len(self.parts), "part")]
        if self.grade is not None:
            words.append(f"quality {self.grade.code}")
        return f"<Building {self.id!r}: {', '.join(words)}>"

    def _repr_html_(self) -> str:
        """Return a small 3D view for notebooks, which needs no network."""
        return METHODS["render_building"](self)
