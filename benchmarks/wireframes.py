"""Score drawn roofs against true ones, by building and by size.

The size is that of the footprint.

A score holds the counts that ../shared/tools/wireframe.py makes: edges and corners that are right,
drawn and true. Pooled figures sum these counts over buildings, so that they hang on the largest
ones. Means give every building the same weight.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import numpy as np
from scipy.optimize import linear_sum_assignment

from .judging import load_tool

SIZES_M2 = (0.0, 200.0, 400.0, 800.0, np.inf)
COLUMNS = (
    "n",
    "edge F1, %: pooled; mean",
    "precision; recall, %",
    "wrong edges on true lines, %",
    "corner F1, %",
    "corners; faces, times the truth's",
    "share in 0.2 m",
    "parts",
    "ms per 100 m2",
)
NAN = float("nan")
ON_LINE_M = 0.3  # Farthest (m) of an edge's ends from the line of a true one.


@dataclass(frozen=True)
class WireframeCounts:
    """Counts of one building; `found_corners` are true ones near a right corner.

    `wrong_on_lines` are the wrong edges that overlap a true one on its line, with other ends.
    """

    right_edges: int
    edges: int
    true_edges: int
    right_corners: int
    corners: int
    true_corners: int
    found_corners: int
    faces: int = 0
    true_faces: int = 0
    wrong_on_lines: int = 0
    offset_m: float = 0.0  # summed over right corners
    height_rmse_m: float = NAN

    @property
    def edge_f1(self) -> float:
        """F1 (%) of the edges."""
        return compute_f1(self.right_edges, self.edges, self.true_edges)

    @property
    def corner_f1(self) -> float:
        """F1 (%) of the corners."""
        return compute_f1(self.right_corners, self.corners, self.true_corners, self.found_corners)


@dataclass(frozen=True)
class Score:
    """Counts, footprint area, CPU time, parts and share within 0.2 m of one building."""

    id: str
    counts: WireframeCounts
    area_m2: float
    seconds: float = NAN
    parts: int = 0
    share: float = 0.0


def compute_f1(right: int, n_drawn: int, true: int, n_found: int | None = None) -> float:
    """Return F1 (%) of `right` among drawn ones, and of found among true ones."""
    precision = right / max(n_drawn, 1)
    recall = (right if n_found is None else n_found) / max(true, 1)
    return 200.0 * precision * recall / (precision + recall) if precision + recall else 0.0


def count_wireframes(models: Path, truth: Path) -> dict[str, WireframeCounts]:
    """Compare each building of `truth` with its model. A missing one counts as all missed."""
    judge = load_tool("wireframe")
    solids, counts = judge.solids(models), {}
    for name, parts in judge.solids(truth).items():
        reference, model = judge.wireframe(parts), solids.get(name, [])
        if len(reference[1]):
            drawn = judge.wireframe(model)
            comparison = judge.compare(drawn, reference)
            rmse = judge.height_rmse(model, parts) if model else NAN
            numbers = (
                *comparison["edges"],
                *comparison["corners"],
                comparison["found"],
                *comparison["faces"],
                count_wrong_on_lines(judge, drawn, reference, find_tolerance(judge, reference[0])),
            )
            counts[name] = WireframeCounts(*numbers, comparison["offset"], rmse)
    return counts


def find_tolerance(judge: ModuleType, points: np.ndarray) -> float:
    """Return how far (m) a right edge may lie off, for the points (n, 3) of a roof."""
    return judge.NEAR * float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())


def count_wrong_on_lines(judge: ModuleType, drawn: tuple, true: tuple, near: float) -> int:
    """Count the wrong edges, further than `near` (m), that overlap a true one on its line.

    A wireframe is corners (n, 3), edges (k, 2) and more.
    """
    (p, edges, *_), (t, true_edges, *_) = drawn, true
    if not len(edges):
        return 0
    gaps = judge.edge_distances(p[edges], t[true_edges])
    rows, columns = linear_sum_assignment(gaps)
    wrong = np.delete(p[edges], rows[gaps[rows, columns] <= near], axis=0)[:, None]
    start, end = np.swapaxes(t[true_edges], 0, 1)
    length = np.linalg.norm(end - start, axis=1)
    way = ((end - start) / length[:, None])[:, None]
    gone = wrong - start[:, None]
    along = (gone * way).sum(axis=3)
    off = np.linalg.norm(gone - along[..., None] * way, axis=3).max(axis=2)
    overlap = np.minimum(along.max(axis=2), length) - np.maximum(along.min(axis=2), 0.0)
    return int(((off <= ON_LINE_M) & (overlap > 0.0)).any(axis=1).sum())


def sum_counts(counts: Iterable[WireframeCounts]) -> WireframeCounts:
    """Sum the counts of all buildings. The result has the mean of the known height errors."""
    rows = np.array([list(vars(counts_of_one).values()) for counts_of_one in counts], float)
    *numbers, offset, _ = rows.sum(axis=0)
    rmse = measure_finite(np.mean, rows[:, -1])
    return WireframeCounts(*(int(number) for number in numbers), offset, rmse)


def measure_finite(figure, values: np.ndarray) -> float:
    """Return `figure` of the values that are no NaN, or NaN where all are."""
    values = values[np.isfinite(values)]
    return float(figure(values)) if len(values) else NAN


def summarise(scores: list[Score]) -> list[str]:
    """Return the offset of right corners, heights and the share of right numbers of faces."""
    total, counts = sum_counts(score.counts for score in scores), [score.counts for score in scores]
    rmse = measure_finite(np.median, np.array([item.height_rmse_m for item in counts]))
    same = np.mean([item.faces == item.true_faces for item in counts])
    offset = total.offset_m / max(total.right_corners, 1)
    return [
        f"  corners {offset:.3f} m off; height RMSE {total.height_rmse_m:.3f} m in the mean, "
        f"{rmse:.3f} in the median; as many faces as the truth {same:.3f}"
    ]


def make_size_rows(scores: list[Score]) -> list[str]:
    """Return a row for each class of footprint area that has any."""
    rows = []
    for lower, upper in pairwise(SIZES_M2):
        group = [score for score in scores if lower <= score.area_m2 < upper]
        if group:
            rows.append(f"  {lower:.0f} to {upper:.0f} m2: " + " | ".join(make_cells(group)))
    return rows


def make_cells(scores: list[Score]) -> list[str]:
    """Return the cells of COLUMNS: pairs are the pooled figure and the mean over buildings."""
    total = sum_counts(score.counts for score in scores)
    edges = np.mean([score.counts.edge_f1 for score in scores])
    right = total.right_edges
    precision, recall = right / max(total.edges, 1), right / max(total.true_edges, 1)
    areas, ms = np.array([s.area_m2 for s in scores]), 1e3 * np.array([s.seconds for s in scores])
    faces = f"{total.faces / total.true_faces:.2f}" if total.true_faces else "-"
    return [
        f"{len(scores)}",
        f"{total.edge_f1:.1f}; {edges:.1f}",
        f"{100 * precision:.1f}; {100 * recall:.1f}",
        f"{100 * total.wrong_on_lines / max(total.edges - right, 1):.0f}",
        f"{total.corner_f1:.1f}",
        f"{total.corners / total.true_corners:.2f}; {faces}",
        f"{np.mean([s.share for s in scores]):.4f}",
        f"{np.mean([s.parts for s in scores]):.2f}",
        f"{100 * ms.sum() / areas.sum():.1f}",
    ]


def list_worst(scores: list[Score], limit: int) -> list[str]:
    """Return a line for each of so many buildings with the worst edges."""
    worst = sorted(scores, key=lambda score: score.counts.edge_f1)[:limit]
    return [
        f"{s.id}: edge F1 {s.counts.edge_f1:.0f}, {s.counts.right_edges} of {s.counts.edges} edges"
        f" right, {s.counts.true_edges} true, {s.parts} parts, {s.area_m2:.0f} m2"
        for s in worst
    ]
