"""The bundled neighbourhood is what its command makes, and its files agree with its truth."""

import json

import laspy
import numpy as np
import pyogrio
import pytest
import rasterio
import shapely

from hiproof.errors import OutputError
from hiproof.simulate import ROOF_TYPES, demo_files
from hiproof.simulate.neighbourhood import DEMO_FILES, STREETS, neighbourhood, write_neighbourhood
from hiproof.simulate.relief import Plane, Relief
from hiproof.simulate.survey import write_laz


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
    assert (
        types == set(ROOF_TYPES)
        and {"L", "T", "U", "cross", "extension", "two_level", "saw_tooth_hall"} <= kinds
    )


def test_bundled_files_are_what_the_command_makes(tmp_path):
    write_neighbourhood(tmp_path)
    bundled = demo_files()
    assert (tmp_path / "truth.json").read_text() == bundled["truth"].read_text()
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
