"""A simulated city: every building once, tiles that do not depend on each other, files that agree
with the truth.
"""

import json

import laspy
import numpy as np
import pyogrio
import pytest
import shapely
from click.testing import CliRunner

from hiproof.errors import InputError, OutputError
from hiproof.simulate import ROOF_TYPES
from hiproof.simulate.__main__ import app
from hiproof.simulate.city import (
    HOUSES,
    WORKS,
    City,
    Stock,
    block_buildings,
    drawn_names,
    write_city,
)
from hiproof.simulate.compounds import COMPOUND_KINDS
from hiproof.simulate.scanner import ScanSettings
from hiproof.simulate.survey import survey

SMALL = City(buildings=30, seed=4, density=1.0, tile_m=100.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("city")
    counts = list(write_city(path, SMALL))
    return path, counts


def test_every_building_is_in_footprints_and_truth_once(folder):
    path, counts = folder
    truth = [json.loads(line) for line in (path / "truth.jsonl").read_text().splitlines()]
    _, _, geometry, fields = pyogrio.raw.read(path / "footprints.gpkg")
    names = [f"b{k:07d}" for k in range(1, 31)]
    assert sorted(record["id"] for record in truth) == names == sorted(fields[0])
    assert sum(count.buildings for count in counts) == 30
    outlines = shapely.from_wkb(geometry)
    assert shapely.is_valid(outlines).all()
    assert sum(a.intersection(b).area for k, a in enumerate(outlines) for b in outlines[:k]) < 0.01


def test_tiles_hold_their_own_points_at_the_density_asked(folder):
    path, counts = folder
    for count in counts:
        las = laspy.read(path / "tiles" / f"{count.tile}.laz")
        x, y = map(float, count.tile.split("_"))
        assert len(las.points) == count.points
        # Coordinates are stored to the centimetre, so a point may be rounded onto the upper border.
        assert (
            las.x.min() >= x
            and las.x.max() <= x + 100
            and las.y.min() >= y
            and las.y.max() <= y + 100
        )
        assert set(np.unique(las.classification)) <= {2, 5, 6}
    total = sum(count.points for count in counts)
    assert total / (len(counts) * 100.0**2) == pytest.approx(SMALL.density, rel=0.35)


def test_a_tile_is_the_same_without_the_others(folder):
    path, _ = folder
    stock = Stock(SMALL)
    bounds = list(stock.tiles())[-1]
    settings = ScanSettings(density=SMALL.density)
    clouds = survey(
        stock.patches(bounds), stock.near(bounds), stock.terrain, SMALL.flight, SMALL.seed, settings
    )
    points = np.concatenate([cloud.points for cloud in clouds])
    las = laspy.read(path / "tiles" / f"{bounds[0]:.0f}_{bounds[1]:.0f}.laz")
    assert len(points) == len(las.points) and np.abs(points[:, 2] - las.z).max() < 0.0051


def test_a_building_over_a_tile_border_has_its_points_in_both(folder):
    path, counts = folder
    points = [laspy.read(path / "tiles" / f"{count.tile}.laz") for count in counts]
    xyz = np.concatenate(
        [np.column_stack([las.x, las.y, las.z])[las.classification == 6] for las in points]
    )
    tiles = np.repeat(np.arange(len(points)), [(las.classification == 6).sum() for las in points])
    crossing = 0
    for lot in (
        lot for block in range(len(Stock(SMALL).blocks)) for lot in Stock(SMALL).lots(block)
    ):
        inner = lot.building.footprint.buffer(-0.7)
        inside = shapely.contains_xy(inner, xyz[:, 0], xyz[:, 1])
        assert inside.sum() > 0.4 * inner.area * SMALL.density
        crossing += len(set(tiles[inside])) > 1
    assert crossing > 0


def test_blocks_do_not_depend_on_the_citys_size():
    small, large = Stock(City(buildings=30, seed=4)), Stock(City(buildings=60, seed=4))
    shared = set(small.blocks[:-1]) & set(large.blocks[:-1])
    assert shared
    for block in shared:
        first, second = small.lots(small.blocks.index(block)), large.lots(large.blocks.index(block))
        assert [a.building.truth() for a in first] == [b.building.truth() for b in second]
        assert all(np.array_equal(a.crowns, b.crowns) for a, b in zip(first, second, strict=True))


def test_streets_offer_every_type():
    assert set(HOUSES) | set(WORKS) == set(ROOF_TYPES) | set(COMPOUND_KINDS)
    names = drawn_names(np.random.default_rng(0), HOUSES)
    assert {next(names) for _ in range(1500)} == set(HOUSES)
    terrain = SMALL.terrain
    kinds = {b.kind for i in range(20) for b in block_buildings(1, i, 0, terrain)}
    assert {"single", "terraced", "extension"} <= kinds


def test_the_command_reports_and_refuses(tmp_path):
    result = CliRunner().invoke(
        app, ["city", str(tmp_path), "--buildings", "3", "--density", "0.5", "--tile", "200"]
    )
    assert result.exit_code == 0 and "3 buildings" in result.output
    second = CliRunner().invoke(app, ["city", str(tmp_path), "--buildings", "3"])
    assert second.exit_code == 2 and "without a city" in second.output


def test_impossible_cities_are_refused_in_a_sentence(tmp_path):
    for wrong in (
        {"buildings": 0},
        {"buildings": 5, "tile_m": 1.0},
        {"buildings": 5, "density": -2.0},
    ):
        with pytest.raises(InputError, match="expected"):
            City(**wrong)
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(OutputError, match="choose a folder"):
        next(write_city(blocked / "below", SMALL))
