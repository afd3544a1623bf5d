"""Roof parts fitted to points: one primitive, several volumes, a flat block."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field

import numpy as np
import shapely

from ..errors import FitError
from ..geometry.rings import unite
from ..log import count_things
from ..model import Fit, Part, Piece
from ..settings import Settings
from ..status import Status
from .points import FEWEST_POINTS
from .recognise import Recognised, fits_one

LIKELY = 0.05  # a roof type less probable to the network is not fitted by the paper's objective


@dataclass(frozen=True)
class Fitted:
    """Parts over an outline in the local frame, and how the fit chose them."""

    parts: tuple[Part, ...]
    outline: shapely.Polygon
    objective: float = math.nan
    types: dict[str, float] = field(default_factory=dict)
    status: Status = Status.MODELLED
    detail: str = ""


def fit(
    points: np.ndarray, outline: shapely.Polygon | None, recognised: Recognised, settings: Settings
) -> Fitted:
    """Fit roof parts to the points: one primitive (the paper's), or as many as pay."""
    if len(points) < FEWEST_POINTS:
        return flat(points, outline, Status.FLAT_FALLBACK)
    road = fit_one if fits_one(settings) else fit_several
    try:
        return road(points, outline, recognised, settings)
    except FitError as error:
        if outline is None:
            return Fitted((), shapely.Polygon(), status=Status.NO_ROOF, detail=str(error))
        return flat(points, outline, Status.FLAT_FALLBACK, str(error))


def fit_several(
    points: np.ndarray, outline: shapely.Polygon | None, recognised: Recognised, settings: Settings
) -> Fitted:
    """Fit as many volumes as the evidence pays for, whatever the network says."""
    from ..fit.roof import fit_building

    building = fit_building(points, outline, settings)
    return Fitted(
        building.roof_parts,
        building.outline,
        building.objective,
        detail=last_resort(building.roof_parts, settings),
    )


def last_resort(parts: tuple[Part, ...], settings: Settings) -> str:
    """Return a sentence where parts became flat against the types requested, else ""."""
    types = settings.fit.types
    flat = sum(part.type == "flat" for part in parts)
    if not types or "flat" in types or not flat:
        return ""
    return (
        f"{flat} of {count_things(len(parts), 'part')} made flat: none of the types asked for "
        f"({', '.join(types)}) explains the points there"
    )


def fit_one(
    points: np.ndarray, outline: shapely.Polygon | None, recognised: Recognised, settings: Settings
) -> Fitted:
    """Fit one primitive to the whole building (paper section 3.2)."""
    from ..fit import fit_roof
    from ..segment import choose_most_probable

    def fit(types: tuple[str, ...]) -> Fit:
        allowed = settings.replace(
            {"fit": {"types": types or candidates(recognised.types, settings)}}
        )
        return fit_roof(points, outline, allowed, weights=recognised.weights)

    result, types = choose_most_probable(fit, recognised.types)
    shift = result.global_translation
    part = dataclasses.replace(
        result.part,
        translation=result.part.translation + shift,
        pieces=tuple(p.move(shift) for p in result.part.pieces),
    )
    outline = unite([piece.outline for piece in part.pieces]) if outline is None else outline
    return Fitted((part,), outline, result.value, types)


def candidates(recognised: dict[str, float], settings: Settings) -> tuple[str, ...]:
    """Return the types to fit by one primitive, empty for all.

    They are those requested, and by the paper's objective only what the network sees. So the paper
    has it (section 3.1), and a fit by its objective takes half a second a type.

    >>> paper = Settings.from_dict({"fit": {"objective": "paper"}})
    >>> candidates({"gable": 0.9, "hip": 0.08, "shed": 0.02}, paper)
    ('gable', 'hip')
    """
    types = tuple(settings.fit.types)
    if settings.fit.objective != "paper":
        return types
    likely = [
        name
        for name, share in recognised.items()
        if share >= LIKELY and name in (types or recognised)
    ]
    return tuple(likely) or types


def flat(points: np.ndarray, outline: shapely.Polygon, status: Status, detail: str = "") -> Fitted:
    """Return a flat roof at the median height, the last fallback."""
    # the upper median: what strays lies below a roof
    height = float(np.sort(points[:, 2])[len(points) // 2])
    part = Part(
        "flat",
        (Piece(outline, np.array([[0.0, 0.0, height]])),),
        {},
        0.0,
        np.array([0.0, 0.0, height]),
    )
    return Fitted((part,), outline, status=status, detail=detail or status.value)
