"""Are roofs that were cut out of a cloud told from scenes with ground?

No class says so.

usage: python -m benchmarks.cut_out [--every K]

Buildings of three towns scanned by simulation at 2, 5 and 19 points/m2, as `benchmarks.towns` does:
their points with walls, their roofs alone, and with 3 m of ground around them. Then the points of
Delft's footprints of 25 m2 or more, all of them and a tenth: inside, half a metre around, and in
boxes 3 m and 8 m around, in which rows of houses are cut off. Printed is how many of each are taken
for roofs cut out: all but those with 3 m of ground or more should be. `--every` takes each k-th
building.
"""

from __future__ import annotations

import argparse
import zlib

import numpy as np
import shapely

from hiproof.classify.cut_out import is_cut_out
from hiproof.classify.split import is_single
from hiproof.geometry.point_grid import PointGrid
from hiproof.read import read_footprints, read_points
from hiproof.simulate import SOURCES, Defects, ScanSettings, scan_solids

from .judging import SHARED
from .towns import TOWNS, TrueBuilding, read_town

DENSITIES, GROUND_M, LEAST_M2, LEAST_POINTS = (2.0, 5.0, 19.0), 3.0, 25.0, 10
AROUND = {  # an area around a footprint
    "inside": lambda footprint: footprint,
    "0.5 m around": lambda footprint: footprint.buffer(0.5),
    "box, 3 m": lambda footprint: shapely.box(*footprint.bounds).buffer(3.0, join_style="mitre"),
    "box, 8 m": lambda footprint: shapely.box(*footprint.bounds).buffer(8.0, join_style="mitre"),
}


def cut_clouds(building: TrueBuilding, density: float) -> dict[str, np.ndarray]:
    """Return points (n, 3) of one building by what was cut out."""
    rng = np.random.default_rng(zlib.crc32(building.id.encode()))
    settings = ScanSettings(density=density, defects=Defects.none(), margin_m=GROUND_M)
    cloud = scan_solids(list(building.solids.values()), rng, settings)
    source = np.array(SOURCES)[cloud.source]
    return {
        "with walls": cloud.points[source != "ground"],
        "roofs": cloud.points[source == "roof"],
        "with ground": cloud.points,
    }


def count_cut_out(clouds: list[np.ndarray]) -> str:
    """Count the clouds that are taken for roofs cut out.

    Only those count that may be one building.
    """
    results = [
        is_cut_out(xyz) is not False
        for xyz in clouds
        if len(xyz) >= LEAST_POINTS and is_single(xyz[:, :2])
    ]
    return f"{sum(results)} of {len(results)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--every", type=int, default=1)
    total = parser.parse_args().every
    for town, path in TOWNS.items():
        buildings = read_town(path)[::total]
        for density in DENSITIES:
            clouds = [cut_clouds(building, density) for building in buildings]
            print(
                f"{town}, {density:g} points/m2:",
                *(f"{kind} {count_cut_out([c[kind] for c in clouds])}" for kind in clouds[0]),
                sep="  ",
            )
    folder = SHARED / "data/delft"
    xyz = read_points(*sorted(map(str, folder.glob("*.laz")))).xyz
    footprints = [
        f.polygon
        for f in read_footprints(str(folder / "footprints.gpkg"))
        if f.polygon.area >= LEAST_M2
    ]
    for selection in 1.0, 0.1:
        street = xyz[np.random.default_rng(0).random(len(xyz)) < selection]
        grid = PointGrid(street)
        for kind, context_lines in AROUND.items():
            areas = [context_lines(footprint) for footprint in footprints[::total]]
            print(
                f"delft, {selection:g} of the points, {kind}: "
                f"{count_cut_out([street[grid.inside(area)] for area in areas])}"
            )


if __name__ == "__main__":
    main()
