"""A fitted roof becomes a closed solid: `compose`, the line on the terrain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely

from ..errors import CompositionError
from ..model import Roof, Solid
from ..primitives.ribs import draw_facets
from ..settings import ComposeSettings, Settings
from .arrangement import GRID_M
from .cells import PlanProblem, arrange, plan_problem
from .check import check_solid
from .shell import Saddles, raise_shell


def draw_all_facets(roof: Roof, chord_m: float) -> Roof:
    """Return the roof with facets of its curved parts within a tolerance (m)."""
    parts = tuple(draw_facets(part, roof.outline, chord_m) for part in roof.parts)
    return replace(roof, parts=parts)


CROSSING_MOVE_M = 2e-4  # rounding to the grid moves a crossing by less
MAX_ROUNDS = 10  # in which crosswise corners are mended in one attempt
# Factors on the snap distance, and whether walls in line are one: in turn until the solid is
# valid. Of 6,900 roofs of towns two need more than the first.
ATTEMPTS = ((1.0, True), *((factor, False) for factor in (1.0, 3.0, 10.0, 20.0, 30.0, 60.0)))


def compose(roof: Roof, z_ground_local: float, settings: Settings | None = None) -> Solid:
    """Compose the valid solid (ISO 19107) under `roof`.

    It stands on `z_ground_local` [m], in the roof's local frame.

    Over the roof's outline the top is max over covering pieces of min over their planes. Parts of
    the outline no piece covers are roofed by the piece they border most. Faces under the smallest
    area are merged away, vertices closer than the snap distance are one. Where the roof would come
    closer to the ground than the clearance, the ground gives way.

    RoofSurface faces carry the index of their roof part. Coordinates are multiples of 0.1 mm.
    Raises CompositionError when no valid solid comes out, even with coarser snapping.

    >>> import numpy as np, shapely
    >>> from hiproof.frames import LocalFrame
    >>> from hiproof.model import Part, Piece, Roof
    >>> house = shapely.box(0, 0, 10, 8)
    >>> gable = Piece(house, np.array([[0.0, 0.5, 5.0], [0.0, -0.5, 9.0]]))
    >>> solid = compose(Roof((Part("gable", (gable,)),), house, LocalFrame(np.zeros(3))), 0.0)
    >>> [len(solid.select_faces(kind)) for kind in ("RoofSurface", "WallSurface",
    ...     "GroundSurface")], solid.volume
    ([2, 4, 1], 480.0)
    """
    options = (settings or Settings()).compose
    if not np.isfinite(z_ground_local):
        raise CompositionError(
            f"expected a finite ground height, got {z_ground_local}; take the lowest terrain under "
            "the outline"
        )
    problem = plan_problem(draw_all_facets(roof, options.chord_tolerance_m))
    failure = ""
    parts: tuple[int, ...] = ()
    for coarseness, merges_walls in ATTEMPTS:
        reach = (coarseness * options.snap_m + CROSSING_MOVE_M) / GRID_M
        try:
            solid = compose_at(problem, z_ground_local, options, reach, merges_walls)
        except CompositionError as error:
            failure = str(error)
            continue
        findings = check_solid(solid, planarity_m=options.planarity_m)
        if not findings:
            return solid
        codes = sorted({str(finding.code) for finding in findings})
        failure = f"one that is none by ISO 19107 (code {', '.join(codes)})"
        at_fault = {solid.faces[finding.face].part for finding in findings if finding.face >= 0}
        parts = parts or tuple(sorted(at_fault - {-1}))
    refusal = CompositionError(
        f"expected the roof to become a valid solid, got: {failure}; fall back to a simpler roof"
    )
    refusal.parts = parts
    raise refusal


def compose_at(
    problem: PlanProblem,
    z_ground: float,
    options: ComposeSettings,
    reach: float,
    merges_walls: bool,
) -> Solid:
    """Compose with vertices apart by the `reach`, setting back corners of crossing levels."""
    for number in range(MAX_ROUNDS):
        cells = arrange(problem, reach, options.min_face_area_m2, options.min_face_width_m)
        widening = 1 + 0.25 * number  # a cure may need room
        clearance_m = options.ground_clearance_m
        try:
            return raise_shell(cells, problem, z_ground, clearance_m, merges_walls, reach, widening)
        except Saddles as saddles:
            problem = replace(problem, patches=(*problem.patches, *saddles.patches))
    raise CompositionError(
        "expected corners where roof levels meet crosswise to be mended in ten rounds, "
        "got some after them"
    )


def terrain_intersection(
    outline: shapely.Polygon,
    terrain_height_at: Callable[[np.ndarray], np.ndarray],
    z_floor: float = float("nan"),
    spacing_m: float = 1.0,
) -> tuple[np.ndarray, ...]:
    """Return closed lines (m, 3) where the outline's walls meet the terrain.

    There is one a ring, with a vertex at least every `spacing_m`. `terrain_height_at` takes (n, 2)
    and returns (n,) in the outline's frame; where it knows nothing (NaN) the height is that of the
    ring's other points on average, and `z_floor` if it knows nothing along the whole ring.

    >>> line, = terrain_intersection(shapely.box(0, 0, 2, 1), lambda xy: xy[:, 0] * 0.1, 0.0)
    >>> line.shape, line[0].tolist() == line[-1].tolist()
    ((7, 3), True)
    """
    lines = []
    for ring in [outline.exterior, *outline.interiors]:
        xy = shapely.get_coordinates(shapely.segmentize(ring, spacing_m))
        z = np.asarray(terrain_height_at(xy), float)
        mask = np.isfinite(z)
        z = np.where(mask, z, z[mask].mean() if mask.any() else z_floor)
        lines.append(np.column_stack((xy, z)))
    return tuple(lines)
