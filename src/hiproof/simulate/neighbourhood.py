"""The demo: a small neighbourhood on a slope, with trees, every roof type and compounds."""

from __future__ import annotations

import json
import math
from importlib import resources
from pathlib import Path

import numpy as np
import shapely

from ..frames import turn_points
from .relief import Relief
from .roofs import SimBuilding
from .scanner import ScanSettings
from .survey import (
    CRS,
    Flight,
    divide_into_patches,
    survey,
    write_footprints,
    write_laz,
    write_terrain,
)
from .town import TOWN, Lot, furnish_lot, street_side

DEMO_SEED = 5  # whose neighbourhood has every roof type
ORIGIN_XY = np.array([92000.0, 451000.0])
GROUND_M = 4.0  # m, heights of hills over valleys: a gentle slope
STREETS: list[list[str]] = TOWN["streets"]
STREET_WIDTH_M = 9.0  # m between the rows of houses
TERRAIN_BORDER_M = 8.0  # m of ground around the outermost houses, for their terrain
DEMO_FILES = ("cloud.laz", "footprints.gpkg", "terrain.tif", "truth.json")
SCAN = ScanSettings(density=8.0, range_noise_m=0.02, horizontal_noise_m=0.04, beam_radius_m=0.1)


def demo_files() -> dict[str, Path]:
    """Return the paths of the bundled neighbourhood.

    They are "cloud", "footprints", "terrain" and "truth".

    >>> sorted(demo_files())
    ['cloud', 'footprints', 'terrain', 'truth']
    """
    folder = resources.files("hiproof") / "data" / "demo"
    return {Path(name).stem: Path(str(folder / name)) for name in DEMO_FILES}


def neighbourhood(seed: int = DEMO_SEED) -> tuple[list[Lot], Relief]:
    """Return lots and terrain of the neighbourhood, each name of STREETS once."""
    rng = np.random.default_rng([seed, 1])
    terrain = Relief.random(rng, GROUND_M, ORIGIN_XY)
    heading, start = math.radians(14.0), ORIGIN_XY.copy()
    buildings: list[SimBuilding] = []
    for names in STREETS:
        side = street_side(rng, names, start, heading, math.inf, math.inf, terrain)
        corners = np.vstack([shapely.get_coordinates(building.footprint) for building in side])
        top = float(turn_points(corners - start, -heading)[:, 1].max())
        start = start + turn_points(np.array([[0.0, top + STREET_WIDTH_M]]), heading)[0]
        buildings += side
    return [
        furnish_lot(rng, f"house-{k:02d}", building) for k, building in enumerate(buildings, 1)
    ], terrain


def write_neighbourhood(folder: Path, seed: int = DEMO_SEED) -> dict[str, int]:
    """Write the neighbourhood's FILES to `folder`; counts of buildings and points.

    Made by `python -m hiproof.simulate neighbourhood FOLDER`. Raises InputError without rasterio
    (the extra `terrain`).
    """
    from ..read.terrain.raster import import_rasterio

    import_rasterio()
    lots, terrain = neighbourhood(seed)
    corners = np.array([lot.building.footprint.bounds for lot in lots])
    lower = np.floor(corners[:, :2].min(axis=0)) - TERRAIN_BORDER_M
    upper = np.ceil(corners[:, 2:].max(axis=0)) + TERRAIN_BORDER_M
    bounds = (*lower, *upper)
    flight = Flight(heading=math.radians(70.0), origin=ORIGIN_XY - 250.0)
    folder.mkdir(parents=True, exist_ok=True)
    clouds = survey(divide_into_patches(bounds), lots, terrain, flight, seed, SCAN)
    points = write_laz(folder / "cloud.laz", clouds, np.array([*lower, 0.0]))
    write_footprints(folder / "footprints.gpkg", lots)
    write_terrain(folder / "terrain.tif", bounds, terrain)
    truth = {
        "crs": CRS,
        "seed": seed,
        "buildings": [{"id": lot.id, **lot.building.truth()} for lot in lots],
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    return {"buildings": len(lots), "points": points}
