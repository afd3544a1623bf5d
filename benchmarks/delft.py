"""Compound roofs on a real town: solids for every footprint at four densities, measured against all points.

usage: python -m benchmarks.delft [--data ../shared/data/delft] [--tools ../shared/tools] [--shares 1 0.5 0.25 0.125]

Fits and composes every footprint of the folder's `footprints.gpkg` from its `*.laz` (class 6), thinned as
`thin_cloud.py` does, writes the solids as CityJSONSeq and lets `roof_residuals.py` measure them on the full cloud.
Prints one row a density: the measured figures, faces in the mean, milliseconds a building on one core for fitting and for
composing, how far roofs leave the range of their points, and how many solids the check refused.
"""

from __future__ import annotations

import argparse
import importlib.util
import tempfile
import time
from pathlib import Path

import numpy as np
import shapely

from hiproof.compose import check_solid, compose
from hiproof.errors import HiproofError
from hiproof.fit.compound import fit_building
from hiproof.frames import LocalFrame
from hiproof.model import ROOF, Building, Footprint, Roof
from hiproof.read import read_footprints, read_points
from hiproof.read.assign import points_of_footprints
from hiproof.settings import Settings
from hiproof.status import Status
from hiproof.write import write_cityjson

BUILDING_CLASS = 6
WALL_M = 3.0


def thinned(paths: list[Path], share: float) -> np.ndarray:
    """Building points (n, 3) of the files after the draw that `thin_cloud.py` makes."""
    rng = np.random.default_rng(0)
    kept = []
    for path in paths:
        cloud = read_points(path)
        draw = rng.random(len(cloud)) < share
        kept.append(cloud.xyz[draw & (cloud.classification == BUILDING_CLASS)])
    return np.concatenate(kept)


def model(points: np.ndarray, footprint: Footprint, settings: Settings) -> tuple[Building | None, dict[str, float]]:
    """One building and its figures: seconds of fitting and composing, faces, metres beyond its points."""
    frame = LocalFrame.around(points)
    local, outline = frame.to_local(points), shapely.transform(footprint.polygon, frame.to_local)
    started = time.process_time()
    fit = fit_building(local, outline, settings)
    fitted = time.process_time()
    roof = Roof(fit.roof_parts, fit.outline, frame)
    figures = {"fit": fitted - started}
    try:
        solid = compose(roof, float(local[:, 2].min()) - WALL_M, settings)
    except HiproofError as error:
        print(f"{footprint.id}: {error}")
        return None, figures | {"compose": time.process_time() - fitted, "faces": 0, "beyond": 0.0, "bad": 1.0}
    figures["compose"] = time.process_time() - fitted
    top = np.unique(np.concatenate([np.concatenate(face.rings) for face in solid.of_kind(ROOF)]).astype(int))
    z = solid.vertices[top, 2]
    figures["faces"] = len(solid.of_kind(ROOF))
    figures["beyond"] = max(z.max() - local[:, 2].max(), local[:, 2].min() - z.min())
    figures["bad"] = float(len(check_solid(solid)) > 0)
    return Building(footprint.id, Status.MODELLED, roof=roof, solid=solid.moved(frame.origin)), figures


def measure(tools: Path, models: Path, data: Path, clouds: list[Path]) -> dict:
    spec = importlib.util.spec_from_file_location("roof_residuals", tools / "roof_residuals.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    return tool.measure(models, data / "footprints.gpkg", clouds)


def row(share: float, data: Path, tools: Path, settings: Settings) -> str:
    clouds = sorted(data.glob("*.laz"))
    footprints = list(read_footprints(data / "footprints.gpkg"))
    cloud = thinned(clouds, share)
    own_points = [cloud[index] for index in points_of_footprints(cloud, footprints)]
    asked = [(p, f) for p, f in zip(own_points, footprints, strict=True) if len(p)]
    model(*asked[0], settings)  # compiles or loads what is compiled
    outcomes = [model(p, f, settings) for p, f in asked]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "models.city.jsonl"
        write_cityjson(path, [building for building, _ in outcomes if building is not None])
        figures = measure(tools, path, data, clouds)
    columns = {name: np.array([f[name] for _, f in outcomes]) for name in outcomes[0][1]}
    both = 1e3 * (columns["fit"] + columns["compose"])
    return (
        f"{share:<6g} share {figures['share_within_20cm']:.4f}  modelled {figures['modelled']}"
        f"  faces median {figures['median_roof_faces']:.0f} ({np.median(columns['faces']):.0f}) mean {columns['faces'].mean():.2f}"
        f"  rmse {figures['median_rmse_m']:.3f}  ms median {np.median(both):.1f} mean {both.mean():.1f} max {both.max():.0f}"
        f" (fit {1e3 * np.median(columns['fit']):.1f})  beyond {columns['beyond'].max():.2f}  bad {columns['bad'].sum():.0f}"
    )


def main() -> None:
    shared = Path(__file__).resolve().parents[1].parent / "shared"
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=shared / "data/delft")
    parser.add_argument("--tools", type=Path, default=shared / "tools")
    parser.add_argument("--shares", type=float, nargs="+", default=[1.0, 0.5, 0.25, 0.125])
    arguments = parser.parse_args()
    for share in arguments.shares:
        print(row(share, arguments.data, arguments.tools, Settings()), flush=True)


if __name__ == "__main__":
    main()
