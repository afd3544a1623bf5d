"""The roofs of experiments: New York, RoofN3D and simulated ones.

The first two are used where a user has them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import shapely

from hiproof.errors import FitError, InputError
from hiproof.geometry.alpha_shape import alpha_shape
from hiproof.read.roofn3d import read_roofn3d
from hiproof.simulate import NOT_ROOF, ROOF_TYPES, Defects, ScanSettings, random_building, scan

from .output import Options

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
ROOFN3D_TYPES = ("gable", "hip", "pyramid")
MOST_ROWS = 910
"""Buildings taken from a RoofN3D csv, as many as the paper tested on."""


@dataclass(frozen=True)
class RoofSample:
    """One roof: `points` (n, 3), and `is_roof` (n,) those that are judged.

    `points` are as a method sees them; `type` is given where it is known.

    `type` where it is known.

    `outline` is the plan polygon to compare with, a footprint or the alpha shape of the roof's
    points.
    """

    points: np.ndarray
    is_roof: np.ndarray
    outline: shapely.Polygon
    type: str | None = None


def collect_samples(options: Options) -> dict[str, list[RoofSample]]:
    """Collect every data set at hand by name.

    They are New York or the csv given, and simulated roofs.
    """
    samples = {}
    path = options.data or SHARED
    if path.is_file():
        samples["RoofN3D csv"] = list(read_roofn3d_roofs(path, 3 if options.quick else MOST_ROWS))
    elif (path / "roofn3d" / "nyc_roofs.npz").is_file():
        samples["New York roofs"] = list(
            read_new_york_roofs(path / "roofn3d" / "nyc_roofs.npz", 1 if options.quick else None)
        )
    elif options.data is not None:
        raise InputError(
            f"expected a RoofN3D csv or a folder with roofn3d/nyc_roofs.npz, got {path}; check "
            "--data"
        )
    samples["simulated"] = list(
        simulate_roofs(options.seed, 1 if options.quick else 20, options.quick)
    )
    return samples


def read_new_york_roofs(path: Path, limit: int | None = None) -> Iterator[RoofSample]:
    """Yield the roofs of `nyc_roofs.npz`.

    What a published network took for roof (face > 0) is what counts.
    """
    content = np.load(path)
    for start, end in islice(pairwise(content["offset"]), limit):
        points, is_roof = content["points"][start:end].astype(float), content["face"][start:end] > 0
        yield RoofSample(points, is_roof, alpha_shape(points[is_roof, :2]))


def read_roofn3d_roofs(path: Path, limit: int) -> Iterator[RoofSample]:
    """Yield the first buildings of a RoofN3D csv of known classes.

    They come in its order, with at least ten points.
    """
    records = (
        record
        for record in read_roofn3d(path)
        if record.type is not None and len(record.points) >= 10
    )
    for record in islice(records, limit):
        try:
            outline = (
                record.outline if not record.outline.is_empty else alpha_shape(record.points[:, :2])
            )
        except FitError:
            continue
        yield RoofSample(record.points, np.ones(len(record.points), bool), outline, record.type)


def simulate_roofs(seed: int, roofs: int, quick: bool) -> Iterator[RoofSample]:
    """Yield `roofs` of every type as an airborne scanner sees them.

    They have chimneys, dormers, trees, missing strips, and no neighbours.
    """
    settings = ScanSettings(density=5.0, defects=Defects(neighbour=0.0), margin_m=0.0)
    for index, kind in enumerate(ROOFN3D_TYPES if quick else ROOF_TYPES):
        for roof in range(roofs):
            rng = np.random.default_rng([seed, index, roof, 7])
            building = random_building(rng, kind)
            cloud = scan(building, rng, settings)
            yield RoofSample(cloud.points, cloud.label != NOT_ROOF, building.footprint, kind)
