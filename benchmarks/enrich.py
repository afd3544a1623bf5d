"""What `hiproof enrich` answers: how right, and at what cost.

usage: python -m benchmarks.enrich [--run FOLDER] [--buildings 1000] [--roofs 50]

Prints how far the sun on unshaded planes is from pvlib's own transposition, how far the shaded
share of the direct light is from rays cast against every triangle of a simulated quarter, and the
CPU time a building with the sun, of towns of 100 and of 2,000 buildings per km2. With a finished
run, such as Delft's, it prints whether all pairs of neighbours have the same party wall, how many
solids with cut walls are valid, and the house types. Needs the extra `sun`.
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from hiproof.compose import check_solid
from hiproof.enrich.answer import answer
from hiproof.enrich.areas import area_vectors
from hiproof.enrich.cadastre import Cadastre
from hiproof.enrich.horizon import find_horizon, measure_share
from hiproof.enrich.records import Records, index_records
from hiproof.enrich.run import enrich_run
from hiproof.enrich.sky import make_sky
from hiproof.enrich.sun import irradiate, sample_face
from hiproof.enrich.town import Town
from hiproof.enrich.weather import HOURS, YEAR, import_pvlib
from hiproof.model import ROOF
from hiproof.settings import EnrichSettings
from hiproof.write.meshes.triangles import faces_triangles

DELFT = (52.0, 4.36)
HEAD = {
    "hiproof_parameters": 1,
    "crs": "EPSG:7415",
    "unit": "auto",
    "cityjson_offset": [85000.0, 446000.0, 0.0],
    "compose": {},
    "write": {},
}
EVERY_HOUR = 13  # every so many hours of the year are cast as rays
NEAR_M = 120.0  # distance (m) up to which triangles may stop rays: roofs are 15 m high at most


def simulate_town(folder: Path, count: int, per_km2: float, seed: int = 0) -> Path:
    """Write a town of gables and blocks in rows as a run.

    Returns its parameters.jsonl.
    """
    rng = np.random.default_rng(seed)
    pitch = 1000.0 / np.sqrt(per_km2 / 4.0)  # of rows of four houses
    side = int(np.ceil(np.sqrt(count / 4)))
    lines = [HEAD]
    for number in range(count):
        row, place = divmod(number, 4)
        i, k = divmod(row, side)
        x, y = k * pitch + 6.0 * place, i * pitch
        rise = 3.0 if rng.random() < 0.7 else 0.0
        shape = {"width": 10.0, "length": 6.0} | ({"height": rise} if rise else {})
        part = {"type": "gable" if rise else "flat", "parameters": shape, "rotation": 0.0}
        part["position"] = [x + 3.0, y + 5.0, round(float(rng.uniform(3, 12)), 3)]
        ring = [[x, y], [x + 6, y], [x + 6, y + 10], [x, y + 10]]
        place_of = {"origin": [85000.0, 446000.0, 0.0], "outline": [ring], "z_ground": 0.0}
        lines.append({"id": f"b{number}", "status": "modelled", "parts": [part], **place_of})
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "parameters.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    return path


def open_town(path: Path) -> Town:
    return Town(Records(path, index_records(path)))


def compare_with_pvlib() -> float:
    """Return the largest relative difference from pvlib, of unshaded planes."""
    import pandas

    pvlib = import_pvlib()
    place = pvlib.location.Location(*DELFT, altitude=0.0)
    times = pandas.date_range(f"{YEAR}-01-01 00:30", periods=HOURS, freq="h", tz="UTC")
    values, position = place.get_clearsky(times), place.get_solarposition(times)
    extra, worst = pvlib.irradiance.get_extra_radiation(times), 0.0
    for slope in (0, 15, 30, 45, 60, 80):
        for azimuth in range(0, 360, 45):
            total = pvlib.irradiance.get_total_irradiance(
                slope,
                azimuth,
                position["zenith"],
                position["azimuth"],
                values["dni"],
                values["ghi"],
                values["dhi"],
                dni_extra=extra,
                albedo=0.2,
                model="haydavies",
            )["poa_global"]
            b, a = np.radians(slope), np.radians(azimuth)
            normal = np.array([np.sin(b) * np.sin(a), np.sin(b) * np.cos(a), np.cos(b)])
            sky = make_sky(*DELFT, 0.0, 0.0)
            sun = irradiate(normal, np.zeros((1, 3)), np.empty((0, 2, 3)), sky, 0.2)
            expected = float(total.fillna(0.0).sum()) / 1000.0
            worst = max(worst, abs(float(sun.by_month.sum()) / expected - 1.0))
    return worst


def cast_rays(triangles: np.ndarray, places: np.ndarray, direction: np.ndarray) -> float:
    """Return the share of places (n, 3) that are free in a direction.

    No triangle (m, 3, 3) hides the sun from them.
    """
    corner, u = triangles[:, 0], triangles[:, 1] - triangles[:, 0]
    v = triangles[:, 2] - corner
    across = np.cross(direction, v)
    size = (u * across).sum(axis=1)
    size[np.abs(size) < 1e-12] = np.inf
    aside = places[:, None] - corner
    over = np.cross(aside, u)
    first, second = (aside * across).sum(axis=2) / size, over @ direction / size
    hit = (first >= 0) & (second >= 0) & (first + second <= 1)
    hit &= (over * v).sum(axis=2) / size > 1e-6
    return float(1.0 - hit.any(axis=1).mean())


def compare_with_rays(folder: Path, roofs: int) -> np.ndarray:
    """Return how far shaded shares are from those of rays.

    There is one of every face of so many roofs.
    """
    town = open_town(simulate_town(folder, 100, 4000.0, 3))
    cadastre = Cadastre(town, EnrichSettings())
    shift = -town.read(0).solid.vertices[0]
    solids = [town.read(k).solid.move(shift) for k in range(len(town.records))]
    triangles = np.concatenate(
        [s.vertices[np.concatenate(faces_triangles(s.vertices, s.faces))] for s in solids]
    )
    sky, differences = make_sky(*DELFT, 0.0, 0.0), []
    for number in range(25, 25 + roofs):
        solid = town.read(number).solid
        vectors = area_vectors(solid)
        for face in (k for k, f in enumerate(solid.faces) if f.kind == ROOF):
            normal = vectors[face] / np.linalg.norm(vectors[face])
            direct = np.maximum(sky.sun @ normal, 0.0) * sky.direct
            hours = np.flatnonzero(direct > 0)[::EVERY_HOUR]
            places = sample_face(solid, face, normal)[::2]
            edges = cadastre.edges.find_shading_edges(number, float(places[:, 2].min()))
            horizon = find_horizon(places + (0, 0, 0.01), edges)
            seen = measure_share(horizon, sky.sector[hours], sky.tangent[hours])
            points = places + shift + (0, 0, 0.01)
            near = np.linalg.norm(triangles[:, 0] - points.mean(axis=0), axis=1) < NEAR_M
            free = [cast_rays(triangles[near], points, d) for d in sky.sun[hours]]
            differences.append(direct[hours] @ (seen - free) / direct[hours].sum())
    return np.array(differences)


def measure_cost(folder: Path, count: int, per_km2: float) -> tuple[float, float]:
    """Return the CPU time (ms) a building with the sun, and the peak memory (MB)."""
    path = simulate_town(folder, count, per_km2)
    start = time.process_time()
    enrich_run(path, settings=EnrichSettings(sun=True), processes=1)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return 1000.0 * (time.process_time() - start) / count, peak


def judge_run(run: Path) -> None:
    """Print symmetry, validity and house types of a finished run."""
    town = open_town(run / "parameters.jsonl")
    answers = [answer(town, number) for number in range(len(town.records))]
    pairs = {
        (result.building.id, other): area
        for result in answers
        for other, area in json.loads(result.attributes.get("hiproof_party_walls", "{}")).items()
    }
    equal = sum(pairs.get((b, a)) == area for (a, b), area in pairs.items())
    solids = [result.building.solid for result in answers if result.building.built]
    valid = sum(not check_solid(solid) for solid in solids)
    print(f"party walls: {equal} of {len(pairs)} equal the neighbour's to the last digit")
    print(f"solids with cut walls: {valid} of {len(solids)} valid")
    types = Counter(result.attributes.get("hiproof_house_type") for result in answers)
    print("house types: " + ", ".join(f"{n} {name}" for name, n in types.most_common()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", type=Path)
    parser.add_argument("--buildings", type=int, default=1000)
    parser.add_argument("--roofs", type=int, default=50)
    arguments = parser.parse_args()
    if arguments.run:
        judge_run(arguments.run)
    print(f"unshaded, from pvlib: {100 * compare_with_pvlib():.4f} % at most", flush=True)
    with tempfile.TemporaryDirectory() as work:
        apart = np.abs(compare_with_rays(Path(work) / "rays", arguments.roofs))
        print(
            f"shaded share, from rays, of {len(apart)} faces of {arguments.roofs} roofs: "
            f"{100 * apart.mean():.2f} points in the mean, {100 * apart.max():.2f} at most",
            flush=True,
        )
        for per_km2 in (100.0, 2000.0):
            cost, peak = measure_cost(Path(work) / f"{per_km2:g}", arguments.buildings, per_km2)
            print(
                f"cost, {arguments.buildings} buildings at {per_km2:g} per km2: {cost:.1f} ms of "
                f"CPU a building, peak {peak:.0f} MB",
                flush=True,
            )


if __name__ == "__main__":
    main()
