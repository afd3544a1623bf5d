"""The surfaces of a solid, numbered by first face: a face, or all facets of a curve."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..compose.settle import round_number
from ..data_files import Values
from ..model import ROOF, Face, Part
from ..model.roof_figures import FLAT_SLOPE_DEG, RoofFigures
from ..primitives.catalogue import SMOOTH

SUMMED = ("_kwh", "_area_m2")  # Ends of the names of values that add up; others are means by area.


def number_surfaces(faces: Sequence[Face], parts: Sequence[Part]) -> list[int]:
    """Return the number of each face's surface, one for all facets of a curved roof part.

    >>> facets = [Face(((0, 1, 2),), ROOF, part) for part in (0, 1, 0, 1)]
    >>> number_surfaces(facets, [Part("gable", ()), Part("cone", ())])
    [0, 1, 2, 1]
    """
    first: dict[int, int] = {}
    numbers = []
    for index, face in enumerate(faces):
        is_facet = (
            face.kind == ROOF and 0 <= face.part < len(parts) and parts[face.part].type in SMOOTH
        )
        numbers.append(first.setdefault(face.part, index) if is_facet else index)
    return numbers


def group_faces(numbers: Sequence[int]) -> dict[int, list[int]]:
    """Return the faces of each surface by its number, in order."""
    groups: dict[int, list[int]] = {}
    for face, number in enumerate(numbers):
        groups.setdefault(number, []).append(face)
    return groups


def measure_angles(figures: RoofFigures, faces: Sequence[int]) -> tuple[float, float]:
    """Return slope and azimuth (degrees) of a roof surface with these faces.

    The slope of several is their mean by area. Their azimuth is that in which they fall together,
    NaN where they fall to all sides alike.
    """
    slope, azimuth = figures.face_slope_deg[faces], figures.face_azimuth_deg[faces]
    if len(faces) == 1:
        return float(slope[0]), float(azimuth[0])
    area, tilt, turn = figures.face_area_m2[faces], np.radians(slope), np.radians(azimuth)
    flat = area * np.sin(tilt)
    x, y = np.nansum(flat * np.sin(turn)), np.nansum(flat * np.cos(turn))
    falls = math.degrees(math.atan2(math.hypot(x, y), float(area @ np.cos(tilt))))
    mean = float(slope @ area / area.sum())
    return mean, math.degrees(math.atan2(x, y)) % 360.0 if falls >= FLAT_SLOPE_DEG else math.nan


def join_values(
    values: Mapping[int, Values], numbers: Sequence[int], figures: RoofFigures
) -> dict[int, Values]:
    """Return further values by surface, those of several faces summed or averaged by area."""
    groups = group_faces(numbers)
    joined: dict[int, Values] = {}
    for face, of_face in values.items():
        faces = [member for member in groups[numbers[face]] if member in values]
        if len(faces) == 1:
            joined[face] = dict(of_face)
        elif face == faces[0]:
            shares = figures.face_area_m2[faces] / figures.face_area_m2[faces].sum()
            joined[numbers[face]] = {
                name: round_number(
                    sum(
                        values[member][name] * (1.0 if name.endswith(SUMMED) else share)
                        for member, share in zip(faces, shares.tolist(), strict=True)
                    ),
                    3,
                )
                for name in of_face
            }
    return joined
