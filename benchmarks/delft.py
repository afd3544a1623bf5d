"""Roofs of a real town at four densities, against all its points.

usage: python -m benchmarks.delft [--set delft|amsterdam_west|two_epochs] [--shares 1 0.5 0.25
0.125] [--parity even|odd]
           [--data DIR] [--tools ../shared/tools]

Fits and composes every footprint of the folder from its `*.laz` (class 6), thinned as
`thin_cloud.py` does, writes the solids as CityJSONSeq and lets `roof_residuals.py` measure them on
the full cloud. `--parity` takes the footprints whose id is an even or an odd number: constants are
chosen on the even ones of Delft and reported on the odd. Amsterdam West is for reporting only.

A row is a density: milliseconds are those of fitting and composing, "beyond" is how far roofs leave
the range of their points, and narrow parts are under 1 m wide (standing ones rise 2 m or more above
all that they touch).
"""

from __future__ import annotations

import re
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyogrio
import shapely

from hiproof.compose import check_solid, compose
from hiproof.errors import HiproofError
from hiproof.fit.roof import fit_building
from hiproof.frames import LocalFrame
from hiproof.geometry.point_grid import PointGrid
from hiproof.model import ROOF, Building, Footprint, Model, Roof
from hiproof.read import read_footprints, read_points
from hiproof.settings import Settings
from hiproof.status import Status
from hiproof.write import write_cityjson

from .judging import SHARED, count_narrow_parts, describe_parts, load_tool
from .tables import FigureTable, make_parser

SETS = {"delft": "footprints.gpkg", "amsterdam_west": "footprints_bag.gpkg"}
EPOCHS = {"two_epochs": "footprints.gpkg"}  # sets whose clouds lie in folders by year
EPOCH = "2014"
BUILDING_CLASS = 6
WALL_M = 3.0


def thin_points(paths: list[Path], share: float) -> np.ndarray:
    """Return building points (n, 3) of the files after `thin_cloud.py`'s draw."""
    rng = np.random.default_rng(0)
    chunks = []
    for path in paths:
        cloud = read_points(path)
        draw = rng.random(len(cloud)) < share
        chunks.append(cloud.xyz[draw & (cloud.classification == BUILDING_CLASS)])
    return np.concatenate(chunks)


def model(
    points: np.ndarray, footprint: Footprint, settings: Settings
) -> tuple[Building | None, dict[str, float]]:
    """Model one building; return its CPU seconds, faces, and metres beyond its points."""
    frame = LocalFrame.around(points)
    local, outline = frame.to_local(points), shapely.transform(footprint.polygon, frame.to_local)
    started = time.process_time()
    fit = fit_building(local, outline, settings)
    result = time.process_time()
    roof = Roof(fit.roof_parts, fit.outline, frame)
    figures = {"fit": result - started, "parts": len(fit.roof_parts)}
    try:
        solid = compose(roof, float(local[:, 2].min()) - WALL_M, settings)
    except HiproofError as error:
        print(f"{footprint.id}: {error}")
        seconds = time.process_time() - result
        return None, figures | {"compose": seconds, "faces": 0, "beyond": 0.0, "bad": 1.0}
    figures["compose"] = time.process_time() - result
    rings = [ring for face in solid.select_faces(ROOF) for ring in face.rings]
    top = np.unique(np.concatenate(rings).astype(int))
    z = solid.vertices[top, 2]
    figures["faces"] = len(solid.select_faces(ROOF))
    figures["beyond"] = max(z.max() - local[:, 2].max(), local[:, 2].min() - z.min())
    figures["bad"] = float(len(check_solid(solid)) > 0)
    model = Model(roof, solid.move(frame.origin))
    return Building(footprint.id, Status.MODELLED, built=model), figures


def select_footprints(path: Path, parity: str | None) -> list[Footprint]:
    """Return footprints whose id ends in an even or an odd number, or all."""
    footprints = list(read_footprints(path))
    if parity is None:
        return footprints
    return [f for f in footprints if int(re.search(r"\d+$", f.id)[0]) % 2 == (parity == "odd")]


@dataclass(frozen=True)
class Asked:
    """Footprints of a set, files of its cloud, and points (n, 3) of those that have any."""

    footprints: list[Footprint]
    clouds: list[Path]
    own_points: list[tuple[np.ndarray, Footprint]]


def read_set(
    name: str, share: float = 1.0, parity: str | None = None, data: Path | None = None
) -> Asked:
    """Read the set `name`, its cloud thinned to `share`, from its folder or from `data`."""
    data = data or SHARED / "data" / name
    footprints = select_footprints(data / (SETS | EPOCHS)[name], parity)
    clouds = sorted((data / EPOCH if name in EPOCHS else data).glob("*.laz"))
    cloud = thin_points(clouds, share)
    grid = PointGrid(cloud)
    indices = [grid.inside(f.polygon) for f in footprints]
    return Asked(
        footprints,
        clouds,
        [(cloud[i], f) for i, f in zip(indices, footprints, strict=True) if len(i)],
    )


def model_buildings(
    data_set: Asked, settings: Settings
) -> tuple[list[Building], dict[str, np.ndarray]]:
    """Model all buildings; return those that could be composed, and figures of all."""
    model(*data_set.own_points[0], settings)  # compiles or loads what is compiled
    outcomes = [model(points, footprint, settings) for points, footprint in data_set.own_points]
    columns = {
        name: np.array([figures[name] for _, figures in outcomes]) for name in outcomes[0][1]
    }
    return [building for building, _ in outcomes if building is not None], columns


def measure(buildings: list[Building], data_set: Asked, tools: Path = SHARED / "tools") -> dict:
    """Return roof_residuals.py's figures of the written models on all points of the cloud."""
    with tempfile.TemporaryDirectory() as folder:
        models, footprints = Path(folder) / "models.city.jsonl", Path(folder) / "asked.gpkg"
        write_cityjson(models, buildings)
        outlines = shapely.to_wkb([footprint.polygon for footprint in data_set.footprints])
        pyogrio.raw.write(footprints, outlines, [], [], geometry_type="Polygon", crs="EPSG:28992")
        return load_tool("roof_residuals", tools).measure(models, footprints, data_set.clouds)


COLUMNS = (
    "share of points",
    "within 0.2 m",
    "modelled",
    "parts",
    "faces",
    "median RMSE, m",
    "ms a building: median; mean; most",
    "beyond its points, m",
    "invalid",
    "narrow parts; standing",
)


def make_cells(data_set: Asked, tools: Path, settings: Settings) -> tuple[list[str], str]:
    """Model a set; return the cells of COLUMNS but the first, and a line on its parts."""
    buildings, columns = model_buildings(data_set, settings)
    figures = measure(buildings, data_set, tools)
    narrow, standing = np.sum([count_narrow_parts(building.roof) for building in buildings], axis=0)
    ms = 1e3 * (columns["fit"] + columns["compose"])
    cells = [
        f"{figures['share_within_20cm']:.4f}",
        f"{figures['modelled']} of {len(data_set.footprints)}",
        f"{columns['parts'].mean():.2f}",
        f"{columns['faces'].mean():.2f}",
        f"{figures['median_rmse_m']:.3f}",
        f"{np.median(ms):.1f}; {ms.mean():.1f}; {ms.max():.0f}",
        f"{columns['beyond'].max():.2f}",
        f"{columns['bad'].sum():.0f}",
        f"{narrow}; {standing}",
    ]
    return cells, describe_parts(buildings)


def main() -> None:
    parser = make_parser(__doc__, parity=None)
    parser.add_argument("--set", choices=[*SETS, *EPOCHS], default="delft")
    parser.add_argument("--data", type=Path, help="folder of the set's files")
    parser.add_argument("--tools", type=Path, default=SHARED / "tools")
    parser.add_argument("--shares", type=float, nargs="+", default=[1.0, 0.5, 0.25, 0.125])
    a = parser.parse_args()
    with FigureTable(a.record, *COLUMNS) as table:
        for share in a.shares:
            data_set = read_set(a.set, share, a.parity, a.data)
            cells, parts = make_cells(data_set, a.tools, Settings())
            table.add(share, *cells)
            print(parts, flush=True)


if __name__ == "__main__":
    main()
