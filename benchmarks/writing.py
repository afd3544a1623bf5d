"""Time of writing a building by format, and memory by their number.

    python -m benchmarks.writing [COUNT]

Generated roofs of every type, composed once, are written COUNT times over (default 2000) to a
temporary folder. Prints CPU milliseconds a building (median of five runs) for each writer, given
the solid's figures, and the process's peak memory after COUNT / 10 and after COUNT buildings.
"""

import resource
import statistics
import sys
import tempfile
import time
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path

import numpy as np

from hiproof.compose import compose
from hiproof.model import Building, Model, Quality
from hiproof.simulate import ROOF_TYPES, random_building
from hiproof.status import Status
from hiproof.write import (
    AttributesWriter,
    CityGMLWriter,
    CityJSONWriter,
    ParametersWriter,
    roof_figures,
    write_all,
)

WRITERS = {
    "buildings.gml": CityGMLWriter,
    "buildings.city.jsonl": CityJSONWriter,
    "parameters.jsonl": ParametersWriter,
    "buildings.gpkg": AttributesWriter,
}


def generate_buildings(seed=0):
    """Generate one building of each roof type, in world coordinates."""
    rng = np.random.default_rng(seed)
    for type in ROOF_TYPES:
        building = random_building(rng, type)
        origin = building.roof.frame.origin
        solid = compose(building.roof, 0.0).move(origin)
        quality = Quality(300, 5.0, 0.05, 0.04, 0.06, 0.1, 0.99, 0.95, 0.02, 0.0)
        yield Building(
            type,
            Status.MODELLED,
            "",
            Model(building.roof, solid),
            quality,
            float(origin[2]),
            "simulated",
        )


def iterate_street(buildings, count):
    """Yield `count` buildings with ids of their own."""
    return (
        replace(building, id=f"b{n}") for n, building in enumerate(islice(cycle(buildings), count))
    )


def measure_cpu_ms(work, count, runs=5):
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append((time.process_time() - start) / count * 1e3)
    return statistics.median(times)


def write_with(writer, path, pairs):
    with writer(path) as out:
        for building, figures in pairs:
            out.add(building, figures)


def measure_peak_mb():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main(count):
    buildings = list(generate_buildings())
    with tempfile.TemporaryDirectory() as folder:
        for size in (count // 10, count):
            write_all(folder, iterate_street(buildings, size), "EPSG:7415")
            print(f"peak memory after {size} buildings: {measure_peak_mb():.0f} MB")
        street = list(iterate_street(buildings, 500))
        figures = [roof_figures(building.solid) for building in street]
        total = measure_cpu_ms(
            lambda: [roof_figures(building.solid) for building in street], len(street)
        )
        print(f"{'figures of the solid':22} {total:.3f} ms")
        for name, writer in WRITERS.items():
            pairs = list(zip(street, figures, strict=True))
            spent = measure_cpu_ms(
                lambda w=writer, n=name, p=pairs: write_with(w, Path(folder, n), p), len(street)
            )
            total += spent if name != "buildings.gpkg" else 0.0
            print(f"{name:22} {spent:.3f} ms")
        print(f"{'without the table':22} {total:.3f} ms")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000)
