"""Load the judges in ../shared/tools, and measure parts."""

from __future__ import annotations

import importlib.util
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

import numpy as np
import shapely
from scipy.spatial import cKDTree

from hiproof.model import Building, Roof
from hiproof.status import Status

SHARED = Path(__file__).resolve().parents[1].parent / "shared"
DELFT = SHARED / "data" / "delft"
RASTER_M = 0.2
# m: nobody draws a part that is narrower; a step by which one stands out
NARROW_M, STANDING_M = 1.0, 2.0


def list_files(data: Path) -> tuple[tuple[str, ...], str]:
    """Return the clouds and the footprints of Delft in a folder."""
    if not data.is_dir():
        raise SystemExit(f"expected Delft's files in {data}, got no such folder; name it by --data")
    return tuple(sorted(map(str, data.glob("*.laz")))), str(data / "footprints.gpkg")


def load_tool(name: str, tools: Path = SHARED / "tools") -> ModuleType:
    """Load the judge `name` (roof_residuals, wireframe, hand_drawn) as a module."""
    if str(tools) not in sys.path:
        sys.path.append(str(tools))  # judges import each other
    spec = importlib.util.spec_from_file_location(name, tools / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def make_raster(outline: shapely.Polygon, step_m: float = RASTER_M) -> np.ndarray:
    """Return plan points (n, 2) inside `outline` on a square grid, one at least."""
    x0, y0, x1, y1 = outline.bounds
    axes = (np.arange(lower + 0.5 * step_m, upper, step_m) for lower, upper in ((x0, x1), (y0, y1)))
    xy = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    xy = xy[shapely.contains_xy(outline, xy[:, 0], xy[:, 1])]
    return xy if len(xy) else shapely.get_coordinates(outline.representative_point())


def measure_visible_areas(roof: Roof) -> np.ndarray:
    """Return the plan area (m2) where each part is the highest."""
    xy = make_raster(roof.outline)
    top = np.argmax([part.height_at(xy) for part in roof.parts], axis=0)
    return roof.outline.area * np.bincount(top, minlength=len(roof.parts)) / len(top)


def count_narrow_parts(roof: Roof) -> tuple[int, int]:
    """Count parts narrower than NARROW_M, and those STANDING_M above all around."""
    xy = make_raster(roof.outline)
    heights = np.array([np.nan_to_num(part.height_at(xy), nan=-np.inf) for part in roof.parts])
    top, z = heights.argmax(axis=0), heights.max(axis=0)
    tree = cKDTree(xy)
    narrow = standing = 0
    for number, part in enumerate(roof.parts):
        outline = shapely.union_all([piece.outline for piece in part.pieces]).intersection(
            roof.outline
        )
        sides = np.hypot(
            *np.diff(shapely.get_coordinates(shapely.minimum_rotated_rectangle(outline)), axis=0).T
        )
        if len(sides) < 4 or sides.min() >= NARROW_M:
            continue
        narrow += 1
        indices = np.flatnonzero(top == number)
        neighbourhoods = {
            i
            for nearby in tree.query_ball_point(xy[indices], 2.1 * RASTER_M)
            for i in nearby
            if top[i] != number
        }
        standing += (
            bool(neighbourhoods) and z[indices].min() > z[list(neighbourhoods)].max() + STANDING_M
        )
    return narrow, standing


def sum_area_by_type(buildings: Iterable[Building]) -> Counter[str]:
    """Sum the roof area in plan (m2) of all buildings by type of part, the largest first."""
    areas: Counter[str] = Counter()
    for roof in (building.roof for building in buildings if building.built is not None):
        for part, area in zip(roof.parts, measure_visible_areas(roof), strict=True):
            areas[part.type] += float(area)
    return Counter(dict(areas.most_common()))


def measure_named_share(buildings: Iterable[Building]) -> float:
    """Return the share of the roof area in plan whose type has parameters, all but "free"."""
    areas = sum_area_by_type(buildings)
    return 1.0 - areas["free"] / max(areas.total(), 1e-9)


def describe_parts(buildings: list[Building]) -> str:
    """Describe how many parts and which types buildings have, by area in plan."""
    areas, parts = sum_area_by_type(buildings), [len(building.parts) for building in buildings]
    types = ", ".join(f"{name} {area / areas.total():.1%}" for name, area in areas.items())
    modelled = sum(building.status is Status.MODELLED for building in buildings)
    return (
        f"  {np.mean(parts):.2f} parts a building, {modelled} of {len(buildings)} modelled without "
        f"reserve, named share {measure_named_share(buildings):.3f}: {types}"
    )
