"""A simulated city: every building once, tiles that do not depend on each other, files that agree
with the truth.
"""

import json
import re

import laspy
import numpy as np
import pyogrio
import pytest
import rasterio
import shapely
from click.testing import CliRunner

from hiproof.errors import InputError, OutputError
from hiproof.simulate import ROOF_TYPES, demo_files
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
from hiproof.simulate.neighbourhood import DEMO_FILES, STREETS, neighbourhood, write_neighbourhood
from hiproof.simulate.relief import Plane, Relief
from hiproof.simulate.scanner import ScanSettings
from hiproof.simulate.survey import survey, write_laz

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
        assert las.x.min() >= x
        assert las.x.max() <= x + 100
        assert las.y.min() >= y
        assert las.y.max() <= y + 100
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


@pytest.fixture(scope="module")
def cloud():
    las = laspy.read(demo_files()["cloud"])
    return np.column_stack([las.x, las.y, las.z]), np.array(las.classification), las.header


def test_bundled_files_are_small_and_complete():
    sizes = [path.stat().st_size for path in demo_files().values()]
    assert len(sizes) == len(DEMO_FILES) and sum(sizes) < 1_500_000


def test_every_type_and_the_compounds_stand_there():
    truth = json.loads(demo_files()["truth"].read_text())
    types = {part["type"] for building in truth["buildings"] for part in building["parts"]}
    kinds = {building["kind"] for building in truth["buildings"]}
    assert types == set(ROOF_TYPES)
    assert {"L", "T", "U", "cross", "extension", "two_level", "saw_tooth_hall"} <= kinds


def round_numbers(text):
    return re.sub(r"-?\d+\.\d+(e-?\d+)?", lambda number: f"{float(number[0]):.6f}", text)


def test_bundled_files_are_what_the_command_makes(tmp_path):
    write_neighbourhood(tmp_path)
    bundled = demo_files()
    made, kept = ((tmp_path / "truth.json").read_text(), bundled["truth"].read_text())
    assert round_numbers(made) == round_numbers(kept)  # processors differ in the last digit
    for name in ("cloud.laz", "terrain.tif"):
        size = (tmp_path / name).stat().st_size
        assert size == pytest.approx(bundled[name.split(".")[0]].stat().st_size, rel=0.02)


def test_roof_points_follow_the_truth(cloud):
    xyz, classes, _ = cloud
    lots, _ = neighbourhood()
    for lot in lots:
        roof = lot.building.roof
        inner = shapely.buffer(lot.building.footprint, -0.6)
        inside = shapely.contains_xy(inner, xyz[:, 0], xyz[:, 1]) & (classes == 6)
        local = roof.frame.to_local(xyz[inside])
        error = np.abs(local[:, 2] - roof.height_at(local[:, :2]))
        assert len(error) > 30
        assert np.median(error) < 0.06 and (error < 0.25).mean() > 0.75


def test_ground_points_follow_the_terrain_file(cloud):
    xyz, classes, header = cloud
    with rasterio.open(demo_files()["terrain"]) as file:
        ground = xyz[classes == 2][::500]
        heights = np.array([value[0] for value in file.sample(ground[:, :2])])
        assert file.crs.to_epsg() == 7415 or "7415" in file.crs.to_string() or file.crs.is_projected
    assert np.median(np.abs(heights - ground[:, 2])) < 0.06
    assert "7415" in header.parse_crs().to_string()


def test_footprints_are_the_truths_outlines():
    lots, _ = neighbourhood()
    meta, _, geometry, fields = pyogrio.raw.read(demo_files()["footprints"])
    assert meta["crs"] == "EPSG:28992" and list(fields[0]) == [lot.id for lot in lots]
    for lot, wkb in zip(lots, geometry, strict=True):
        assert shapely.from_wkb(wkb).symmetric_difference(lot.building.footprint).area < 1e-6


def test_streets_hold_each_name_once():
    lots, _ = neighbourhood()
    singles = [lot for lot in lots if lot.building.kind != "terraced"]
    rows = any(lot.building.kind == "terraced" for lot in lots)
    assert len(singles) == sum(map(len, STREETS)) - rows
    outlines = [lot.building.footprint for lot in lots]
    overlap = sum(a.intersection(b).area for k, a in enumerate(outlines) for b in outlines[:k])
    assert overlap < 0.01


def test_beams_meet_the_terrain():
    rng = np.random.default_rng(0)
    xy0, slope = rng.uniform(-500, 500, (200, 2)), rng.uniform(-0.4, 0.4, (200, 2))
    for terrain in (Plane(0.03, -0.02, 5.0), Relief.random(rng, 4.0, np.zeros(2))):
        z = terrain.hit(xy0, slope)
        assert np.abs(terrain.height_at(xy0 + slope * z[:, None]) - z).max() < 2e-3
    moved = terrain.move(np.array([10.0, 20.0, 3.0]))
    assert np.allclose(moved.height_at(xy0 + (10.0, 20.0)), terrain.height_at(xy0) + 3.0)


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(OutputError, match="choose a folder"):
        write_laz(tmp_path / "absent" / "cloud.laz", iter(()), np.zeros(3))
