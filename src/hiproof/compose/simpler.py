"""Give up as little of a roof as possible where it cannot become a valid solid."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..errors import CompositionError
from ..model import Part, Piece, Roof, Solid
from ..settings import Settings
from .readable import compose_readable

NEAR_M = 0.2  # m; points so near a roof are on it, as in a building's quality


def compose_simpler(
    roof: Roof,
    z_ground_local: float,
    points: np.ndarray,
    failure: CompositionError,
    settings: Settings,
) -> tuple[Roof, Solid, str]:
    """Compose the roof without the parts that fail, and say what was given up.

    A part that fails is left out or made level, whichever leaves more of `points` (n, 3) on the
    roof and makes a valid solid. Where that does not do, the next part follows. Raises
    CompositionError when only one part is left.
    """
    given_up: list[str] = []
    while True:
        options = sorted(simpler_roofs(roof, failure.parts, points), key=lambda option: -option[0])
        if not options:
            raise failure
        for _, simpler, sentence in options:
            try:
                return (
                    simpler,
                    compose_readable(simpler, z_ground_local, settings),
                    "; ".join([*given_up, sentence]),
                )
            except CompositionError as error:
                last = error
        _, roof, sentence = options[0]
        given_up, failure = [*given_up, sentence], last


def simpler_roofs(
    roof: Roof, failing: tuple[int, ...], points: np.ndarray
) -> Iterator[tuple[float, Roof, str]]:
    """Yield simpler roofs with points' shares and what was given up: by failing part, then all."""
    if len(roof.parts) < 2:
        return
    for k in failing or range(len(roof.parts)):
        part, neighbours = roof.parts[k], (roof.parts[:k], roof.parts[k + 1 :])
        name = f"part {k + 1} ({part.type})"
        for stand_in, subject in (((), "left out"), ((level_part(part, points),), "made level")):
            if not (stand_in and part.type == "flat"):
                simpler = replace(roof, parts=(*neighbours[0], *stand_in, *neighbours[1]))
                yield compute_share_near(simpler, points), simpler, f"{name} was {subject}"


def level_part(part: Part, points: np.ndarray) -> Part:
    """Return a flat part in place of `part`, at its points' median height or at its own."""
    z = part.height_at(points[:, :2])
    z = points[np.isfinite(z) & (np.abs(z - points[:, 2]) < NEAR_M), 2]
    height = round(float(np.median(z)) if len(z) else float(part.translation[2]), 6)
    level = np.array([[0.0, 0.0, height]])
    pieces = tuple(Piece(outline, level) for outline in part.outlines)
    size: dict[str, float] = {
        name: part.parameters[name]
        for name in ("width", "length")
        if part.parameters.get(name, 0.0) > 0.0
    }
    return Part("flat", pieces, size, part.kappa, np.array([*part.translation[:2], height]))


def compute_share_near(roof: Roof, points: np.ndarray) -> float:
    """Return the share of points (n, 3) that lie on the roof."""
    off = np.abs(roof.height_at(points[:, :2]) - points[:, 2])
    return float(np.mean(off < NEAR_M)) if len(points) else 0.0
