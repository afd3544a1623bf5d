"""parameters.jsonl: the parametric models themselves, one JSON object a line for each building asked for."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..errors import InputError
from ..model import Building, Part, Piece
from .building_attributes import plain_text
from .json_text import dump
from .roof_figures import RoofFigures
from .writer import BuildingWriter

LENGTH_DIGITS = 6  # micrometres and microradians
PLANE_DIGITS = 9  # a slope's last digit stays below a micrometre a kilometre away


def write_parameters(path: str | os.PathLike, buildings: Iterable[Building]) -> None:
    """Write one JSON object a building to `path`; raises OutputError when it cannot be written.

    Keys: id, status, detail, type, theta_p (metres, by name), kappa (rad), T_L, T_G (metres), sigma (standard
    deviations by name), objective, points, residuals, recognised and types (probability by roof type from the network,
    and after the fits), z_ground, ground_source, parts. theta_p, kappa, T_L and sigma on top are those of the largest part. A part has type, theta_p, kappa, T_L,
    sigma and pieces, a piece `outline` (rings, outer first) and `planes` (a, b, c of z = a x + b y + c), both
    relative to T_G. All lengths are metres, T_G too, also where the files' CRS counts in feet. What cannot be told is null.
    """
    with ParametersWriter(path) as writer:
        for building in buildings:
            writer.add(building)


def read_parameters(path: str | os.PathLike) -> list[dict[str, Any]]:
    """The objects of a parameters.jsonl, in its order. Raises InputError when it cannot be read or is no such file."""
    records = []
    try:
        with Path(path).open(encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                if line.strip():
                    records.append(parsed(line, path, number))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"expected a parameters.jsonl that hiproof wrote at {os.fspath(path)}, got: {error}; check the path"
        ) from error
    return records


def parsed(line: str, path: str | os.PathLike, number: int) -> dict[str, Any]:
    try:
        record = json.loads(line)
    except json.JSONDecodeError as error:
        record = error
    if not isinstance(record, dict) or "id" not in record or "status" not in record:
        raise InputError(
            f"expected a JSON object with an id and a status in line {number} of {os.fspath(path)}, "
            f"got {line.strip()[:40]!r}; is it a parameters.jsonl that hiproof wrote?"
        )
    return record


class ParametersWriter(BuildingWriter):
    """Incremental form of `write_parameters`."""

    def add(self, building: Building, figures: RoofFigures | None = None) -> None:
        self.put(parameters_line(building))

    def put(self, line: bytes) -> None:
        """Write a building that `parameters_line` made, here or in another process."""
        self.file.write(line)


def parameters_line(building: Building) -> bytes:
    return dump(building_record(building)) + b"\n"


def building_record(building: Building) -> dict[str, Any]:
    """The JSON object of one building; see `write_parameters`."""
    quality = building.quality
    largest = max(building.parts, key=lambda part: part.area, default=None)
    primitive = primitive_record(largest) if largest else dict.fromkeys(("type", "theta_p", "kappa", "T_L", "sigma"))
    return {
        "id": plain_text(building.id),
        "status": building.status.code,
        "detail": building.detail or building.status.value,
        **primitive,
        "T_G": numbers(building.roof.frame.origin) if building.roof is not None else None,
        "objective": number(building.objective),
        "points": int(quality.points),
        "residuals": {
            name: number(getattr(quality, name))
            for name in ("psd_mean", "psd_std", "rmse", "p95", "share_within_20cm", "outline_iou")
        },
        "density": number(quality.density),
        "nodata_share": number(quality.nodata_share),
        "unexplained_area_m2": number(quality.unexplained_area_m2),
        "recognised": by_name(building.recognised),
        "types": by_name(building.types),
        "z_ground": number(building.z_ground),
        "ground_source": building.ground_source or None,
        "parts": [
            {**primitive_record(part), "pieces": [piece_record(piece) for piece in part.pieces]}
            for part in building.parts
        ],
    }


def primitive_record(part: Part) -> dict[str, Any]:
    return {
        "type": part.type,
        "theta_p": by_name(part.parameters),
        "kappa": number(part.kappa),
        "T_L": numbers(part.translation),
        "sigma": by_name(part.sigma),
    }


def piece_record(piece: Piece) -> dict[str, Any]:
    rings = (piece.outline.exterior, *piece.outline.interiors)
    return {
        "outline": [[numbers(xy) for xy in shapely.get_coordinates(ring)] for ring in rings],
        "planes": [numbers(plane, PLANE_DIGITS) for plane in piece.planes],
    }


def by_name(values: dict[str, float]) -> dict[str, float | None]:
    """Numbers by name, in the order the primitive declares them."""
    return {str(name): number(value) for name, value in values.items()}


def number(value: float, digits: int = LENGTH_DIGITS) -> float | None:
    """A rounded number; None for NaN and infinities, which JSON does not know."""
    return round(float(value), digits) + 0.0 if math.isfinite(value) else None  # + 0.0: minus zero is zero


def numbers(values: Iterable[float], digits: int = LENGTH_DIGITS) -> list[float | None]:
    return [round(v, digits) + 0.0 if math.isfinite(v) else None for v in np.asarray(values, float).tolist()]
