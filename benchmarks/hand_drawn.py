"""Edges and corners of roofs that people drew by hand over the same points.

usage: python -m benchmarks.hand_drawn [--mode points|footprints|both] [--parity even|odd]
           [--worst N]

Reconstructs the 23 clouds of ../shared/data/hand_drawn from points only and under the outline of
the drawn roof, and compares them by the rule of ../shared/tools/hand_drawn.py: an edge is right
within a tenth of the cloud's radius. `--parity` takes the roofs with an even or an odd number:
choose by the even ones, report the odd ones.
"""

from __future__ import annotations

import re
import time
from types import ModuleType

import numpy as np

from hiproof import reconstruct
from hiproof.model import Building

from .judging import load_tool
from .tables import FigureTable, make_parser
from .wireframes import (
    COLUMNS,
    Score,
    WireframeCounts,
    count_wrong_on_lines,
    find_tolerance,
    list_worst,
    make_cells,
    make_size_rows,
)

MODES = {"points": "points only", "footprints": "with footprints"}
SHORT_M = 1.0


def score_roofs(
    judge: ModuleType, with_footprint: bool, parity: str | None
) -> tuple[list[Score], list[int]]:
    """Return the score of every roof, and the numbers of short edges and right ones."""
    scores, short = [], np.zeros(2, int)
    for name, points, corners, edges, footprint in judge.reference():
        if parity is None or int(re.sub(r"\D", "", name)) % 2 == (parity == "odd"):
            outline = footprint if with_footprint else None
            if not scores:
                reconstruct(points, outline, id=name)  # loads what is compiled
            started = time.process_time()
            building = reconstruct(points, outline, id=name)
            seconds = time.process_time() - started
            counts, short_edges = compare_building(judge, building, points, corners, edges)
            share = building.quality.share_within_20cm if building.solid is not None else 0.0
            scores.append(Score(name, counts, footprint.area, seconds, len(building.parts), share))
            short += short_edges
    return scores, short.tolist()


def compare_building(
    judge: ModuleType,
    building: Building,
    points: np.ndarray,
    true_corners: np.ndarray,
    true_edges: np.ndarray,
) -> tuple[WireframeCounts, tuple[int, int]]:
    """Return a building's counts, and its numbers of short edges and right ones."""
    corners, edges = judge.model_wireframe(building)
    tolerance = find_tolerance(judge.judge, points)
    right, right_corners, height_errors = judge.matched(
        corners, edges, true_corners, true_edges, tolerance
    )
    ends = corners[edges.ravel()].reshape(-1, 2, 3)
    short = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) < SHORT_M
    right_edges = (int(right.sum()), len(edges), len(true_edges))
    true = true_corners, true_edges
    counts = WireframeCounts(
        *right_edges,
        right_corners,
        len(corners),
        len(true_corners),
        height_errors,
        wrong_on_lines=count_wrong_on_lines(judge.judge, (corners, edges), true, tolerance),
    )
    return counts, (int(short.sum()), int(right[short].sum()))


def main() -> None:
    parser = make_parser(__doc__, parity=None, worst=0)
    parser.add_argument("--mode", choices=(*MODES, "both"), default="both")
    a = parser.parse_args()
    judge = load_tool("hand_drawn")
    with FigureTable(a.record, "input", *COLUMNS, f"under {SHORT_M:g} m: edges; right") as table:
        for mode in MODES if a.mode == "both" else (a.mode,):
            scores, (short, right) = score_roofs(judge, mode == "footprints", a.parity)
            table.add(MODES[mode], *make_cells(scores), f"{short}; {right}")
            print("\n".join([*make_size_rows(scores), *list_worst(scores, a.worst)]))


if __name__ == "__main__":
    main()
