"""What several benchmarks share: one door to the fit of a building, the judges in ../shared/tools, figures of parts."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

import numpy as np
import shapely

from hiproof.fit.compound import CompoundFit, fit_building
from hiproof.model import ROOF, Building
from hiproof.settings import Settings

SHARED = Path(__file__).resolve().parents[1].parent / "shared"


def fitted(points_local: np.ndarray, outline: shapely.Polygon | None, settings: Settings | None = None) -> CompoundFit:
    """The roof of one building: the only place where benchmarks name the search they measure."""
    return fit_building(points_local, outline, settings or Settings())


def tool(name: str, tools: Path = SHARED / "tools") -> ModuleType:
    """The judge `name` (roof_residuals, wireframe) as a module."""
    spec = importlib.util.spec_from_file_location(name, tools / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def wireframe_figures(models: Path, truth: Path, worst: int = 0) -> tuple[dict[str, float], list[str]]:
    """What wireframe.py says of `models` against `truth`: its figures, and a line for each of the `worst` buildings."""
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        tool("wireframe").main(models, truth, True, worst)
    figures, *lines = printed.getvalue().splitlines()
    return json.loads(figures), lines


def visible_areas(building: Building) -> np.ndarray:
    """Plan area (m2) of each part's faces in the building's solid: what is hidden under another part does not count."""
    areas = np.zeros(len(building.parts))
    if building.solid is not None:
        for face in building.solid.of_kind(ROOF):
            outer, *holes = (building.solid.vertices[list(ring), :2] for ring in face.rings)
            areas[face.part] += shapely.Polygon(outer).area - sum(shapely.Polygon(hole).area for hole in holes)
    return areas


def area_by_type(buildings: Iterable[Building]) -> Counter[str]:
    """Roof area in plan (m2) that each type of part has in all `buildings`, the largest first."""
    areas: Counter[str] = Counter()
    for building in buildings:
        for part, area in zip(building.parts, visible_areas(building), strict=True):
            areas[part.type] += float(area)
    return Counter(dict(areas.most_common()))


def named_share(buildings: Iterable[Building]) -> float:
    """Share of the roof area in plan whose part has a type with parameters, "free" being none."""
    areas = area_by_type(buildings)
    return 1.0 - areas["free"] / max(areas.total(), 1e-9)
