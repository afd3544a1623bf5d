"""Overhangs in runs over many buildings: points beyond footprints, neighbours, tiles."""

import json

import numpy as np
import pytest
import shapely

from hiproof.city.run import Request, reconstruct_area
from hiproof.settings import Settings
from tiny_town import ORIGIN, gable, write_cloud, write_footprints

EAVES_M = 0.6


def write_pair(folder, roof_class=6):
    """A cloud of two gables that share a wall, and ground around them, with footprints."""
    rng = np.random.default_rng(100)
    xy = rng.uniform((0, 0), (40, 24), (8 * 40 * 24, 2))
    x, y = (xy - [8, 8]).T
    is_roof = (x >= 0) & (x <= 20) & (np.abs(y - 4) <= 4 + EAVES_M)
    z = np.where(is_roof, gable(x, y, 8.0, 20.0, 5.0, 3.0) + 0.8 * (x > 11), 0.0)
    xyz = np.column_stack([xy, z + rng.normal(0, 0.02, len(xy))]) + ORIGIN
    classes = np.where(is_roof, roof_class, 2 if roof_class == 6 else 1).astype(np.uint8)
    boxes = {"a": shapely.box(8, 8, 19, 16), "b": shapely.box(19, 8, 28, 16)}
    footprints = {k: shapely.transform(v, lambda p: p + ORIGIN[:2]) for k, v in boxes.items()}
    return (
        write_cloud(folder / "cloud.laz", xyz, classes),
        write_footprints(folder / "footprints.geojson", footprints),
    )


@pytest.mark.parametrize("roof_class", [6, 1])
def test_buildings_of_a_run_have_their_overhangs(tmp_path, roof_class):
    cloud, footprints = write_pair(tmp_path, roof_class)
    settings = Settings.from_dict({"write": {"lods": ["2.2", "2.3"]}})
    request = Request((str(cloud),), tmp_path / "out", str(footprints), settings=settings)
    reconstruct_area(request)
    lines = (tmp_path / "out" / "parameters.jsonl").read_text().splitlines()[1:]
    for record in map(json.loads, lines):
        lengths = [item["length"] for item in record["overhangs"]]
        assert lengths == [pytest.approx(EAVES_M, abs=0.1)] * 2, record["id"]
        ring = np.array(record["outline"][0])
        sides = (
            ring[[item["edge"] + 1 for item in record["overhangs"]]]
            - ring[[item["edge"] for item in record["overhangs"]]]
        )
        # along the eaves: not at the party wall, nor at the gable ends
        assert (np.abs(sides[:, 0]) > 5).all()
