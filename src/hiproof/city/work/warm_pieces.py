"""The compiled code of a run, in pieces that share next to nothing.

So several processes can compile at the same time.

    echo solid | python -m hiproof.city.work.warm_pieces # prints the names of ready functions

Each piece calls what the main job calls, on next to no data: compiling asks for the types of the
arguments alone.
"""

from __future__ import annotations

import gc
import sys
import traceback
from collections.abc import Callable

import numpy as np
import shapely

from ...compiled import news
from ...garbage import RARELY

# m; a house small enough to be fitted while code compiles
OUTLINE = shapely.box(0.0, 0.0, 9.0, 7.0)
# m; and one with a corner that points inwards
L_OUTLINE = shapely.box(0.0, 0.0, 6.0, 7.0) | shapely.box(6.0, 2.0, 9.0, 7.0)


def house() -> np.ndarray:
    """Return points (n, 3) of a gable and a flat annex over OUTLINE."""
    x, y = (
        axis.ravel() for axis in np.meshgrid(np.arange(0.3, 9.0, 0.6), np.arange(0.3, 7.0, 0.6))
    )
    return np.column_stack([x, y, np.where(x < 6.0, 8.0 - 0.7 * np.abs(y - 3.5), 3.0)])


def moves() -> None:
    """Compile the search for volumes.

    Moves come first, so that `planes` is ready elsewhere when it is needed.
    """
    from ...fit.roof import fit_building, start_roof
    from ...fit.roof.copies import add_copy, list_copies
    from ...fit.roof.site import make_site
    from ...fit.shapes.rounds import find_disc, measure_round_gaps
    from ...fit.union.add import UNEXPLAINED
    from ...fit.union.improve import improve
    from ...fit.union.objective import compute_objective
    from ...fit.union.volumes import make_base

    (plan, scene), base = make_house_scene(), make_base(-3.0)
    value = compute_objective(base, scene)
    improve(base, scene, value, np.array([0.7]), 1)
    fit_building(house(), L_OUTLINE)
    centre, _ = find_disc(house(), np.zeros(2), 1.0)  # a house so simple asks for none
    measure_round_gaps(house(), centre)
    site = make_site(scene, OUTLINE, 1.0, plan.border)
    roof = start_roof(base, scene, site)
    list_copies(roof, site, site.bounds, UNEXPLAINED)
    add_copy(roof, 0, 1.0, 0.0)


def planes() -> None:
    """Compile the planes and gables with which the search begins."""
    from ...fit.union.candidates import MOST_PLANES, list_candidates

    _, scene = make_house_scene()
    list_candidates(scene, np.arange(scene.n), MOST_PLANES)


def make_house_scene() -> tuple:
    """Return the plan of the house, and the search's scene."""
    from ...fit.union.allowed import list_allowed_shapes
    from ...fit.union.plan import lay_out_plan
    from ...fit.union.scene import find_directions, make_scene

    plan = lay_out_plan(house(), OUTLINE)
    return plan, make_scene(
        plan, OUTLINE, find_directions(OUTLINE, plan), 1.5, 0.25, list_allowed_shapes(())
    )


def solid() -> None:
    """Compile plan cells, the closed shell, its quality and its texts.

    A building of three points is composed without a fit.
    """
    from ...compose import compose
    from ...frames import LocalFrame
    from ...method import reconstruct
    from ...model import Part, Piece, Roof
    from ...write.head import FileHead
    from ...write.run_files import fragments

    gable = Piece(shapely.box(0.0, 0.0, 6.0, 7.0), np.array([[0.0, 0.7, 5.55], [0.0, -0.7, 10.45]]))
    annex = Piece(shapely.box(5.0, 1.0, 9.0, 7.0), np.array([[0.5, 0.0, 3.0]]))
    compose(Roof((Part("free", (gable, annex)),), OUTLINE, LocalFrame(np.zeros(3))), 0.0)
    fragments(reconstruct(house()[:3], OUTLINE), ("a", "a"), FileHead(offset=np.zeros(3)))


def single() -> None:
    """Compile the fit of one primitive by itself.

    A roof without a footprint, or `--parts one`, begins with it, and vaults are fitted so.
    """
    from ...fit import fit_roof

    fit_roof(house())


def outlines() -> None:
    """Compile what runs without footprints draw: an outline for each house."""
    from ...fit.outline import estimate_outline

    estimate_outline(house(), 0.3)


def points() -> None:
    """Compile which points a building gets, and whether its footprint lies off."""
    from ...fit.align import find_shift
    from ...geometry.point_grid import PointGrid

    xyz = house()
    PointGrid(xyz).inside(OUTLINE)
    find_shift(xyz[:, :2], shapely.box(1.0, 0.5, 10.0, 7.5))


PIECES: dict[str, Callable[[], None]] = {
    piece.__name__: piece for piece in (moves, planes, outlines, solid, points, single)
}


def main() -> None:
    """Compile the pieces whose names come in, a line each.

    Prints the names of functions as they become ready; after each piece its own.
    """
    reported: set[str] = set()

    def tell(finished: int, total: int) -> None:
        for new in sorted(news.ready - reported):
            print(new, flush=True)
        reported.update(news.ready)

    news.listener = tell
    gc.set_threshold(RARELY)
    for name in map(str.strip, sys.stdin):
        try:
            PIECES[name]()
        except Exception:
            traceback.print_exc()
            name = news.FAILED
        tell(0, 0)
        print(name, flush=True)


if __name__ == "__main__":
    main()
