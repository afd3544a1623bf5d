"""Footprints beside their roofs: all of a data set are moved by one shift, a row of houses moves as
one, or nothing moves.
"""

import json
import re
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from benchmarks.registration import SETS, read_set, shift_polygons

from hiproof.city.plan.prepare import make_plan
from hiproof.city.plan.registration import SAMPLE_CELL_M, is_suspected
from hiproof.city.plan.work_plan import WorkPlan
from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.errors import InputWarning
from hiproof.fit.registration import register
from hiproof.settings import Settings
from tiny_town import ORIGIN, Town, write_cloud, write_footprints

SHARED = Path(__file__).parents[2] / "shared" / "data"
OFF = Settings.from_dict({"reconstruct": {"align": "off"}})
SHIFT = np.array([1.2, -0.8])
read_once = cache(read_set)


@cache
def scattered_houses(rows: int = 5, columns: int = 5) -> Town:
    """Flat houses of different sizes in a grid, every 50 m one, with ground around."""
    rng = np.random.default_rng(3)
    xy = rng.uniform(0, (50.0 * columns, 50.0 * rows), (int(2 * 2500 * rows * columns), 2))
    classes, z, footprints = np.full(len(xy), 2, np.uint8), np.zeros(len(xy)), {}
    for i in range(rows * columns):
        corner = np.array([50.0 * (i % columns) + 15, 50.0 * (i // columns) + 15])
        size = rng.uniform((8, 7), (16, 12))
        inside = ((xy >= corner) & (xy <= corner + size)).all(axis=1)
        classes[inside], z[inside] = 6, 6.0
        footprints[f"house-{i}"] = shapely.box(
            *(corner + ORIGIN[:2]), *(corner + size + ORIGIN[:2])
        )
    return Town(np.round(np.column_stack([xy, z]) + ORIGIN, 3), classes, footprints)


def row_of_houses(houses: int = 4) -> Town:
    """Gables that touch, with ground around."""
    rng = np.random.default_rng(5)
    xy = rng.uniform(0, (6.0 * houses + 24, 32.0), (int(8 * (6.0 * houses + 24) * 32), 2))
    inside = ((xy >= 12) & (xy <= [12 + 6.0 * houses, 20])).all(axis=1)
    z = np.where(inside, 9 - 0.6 * np.abs(xy[:, 1] - 16), 0.0)
    places = [np.array([12 + 6.0 * i, 12.0]) + ORIGIN[:2] for i in range(houses)]
    footprints = {f"house-{i}": shapely.box(x, y, x + 6, y + 8) for i, (x, y) in enumerate(places)}
    return Town(
        np.round(np.column_stack([xy, z]) + ORIGIN, 3),
        np.where(inside, 6, 2).astype(np.uint8),
        footprints,
    )


def move_town(town: Town, shift) -> Town:
    polygons = {
        id: shapely.transform(polygon, lambda xy: xy + shift)
        for id, polygon in town.footprints.items()
    }
    return replace(town, footprints=polygons)


def make_request(folder, town: Town, pieces: int = 1, **options) -> Request:
    """A run on the town, whose cloud is cut into so many files."""
    folder.mkdir(exist_ok=True)
    parts = np.array_split(np.random.default_rng(0).permutation(len(town.xyz)), pieces)
    clouds = [
        write_cloud(folder / f"{n}.laz", town.xyz[p], town.classification[p])
        for n, p in enumerate(parts)
    ]
    footprints = write_footprints(folder / "footprints.gpkg", town.footprints)
    return Request(tuple(map(str, clouds)), folder / "out", str(footprints), **options)


@pytest.fixture(scope="module")
def shifted_request(tmp_path_factory):
    return make_request(tmp_path_factory.mktemp("shifted"), move_town(scattered_houses(), -SHIFT))


def plan_of(request: Request) -> WorkPlan:
    with pytest.warns(InputWarning, match="all footprints lie beside their roofs"):
        return make_plan(request)


def test_the_common_shift_is_found_and_areas_are_moved(shifted_request):
    plan = plan_of(shifted_request)
    assert plan.registration.is_clear
    assert np.abs(plan.registration.xy - SHIFT).max() < 0.1
    assert plan.registration.footprints == 25 and max(plan.registration.sigma) < 0.1
    for job in plan.jobs:
        distance = np.subtract(job.area.bounds, job.footprint.polygon.bounds)
        assert np.allclose(distance, np.tile(plan.registration.xy, 2), atol=1e-6)


@pytest.mark.parametrize("classes", [{6: 1}, {6: 0, 2: 0}])
def test_the_common_shift_is_found_where_no_class_marks_roofs(classes, shifted_request, tmp_path):
    town = move_town(scattered_houses(), -SHIFT)
    unmarked = np.array([classes.get(c, c) for c in range(7)], np.uint8)[town.classification]
    request = make_request(tmp_path, replace(town, classification=unmarked), pieces=2)
    plan = plan_of(request)
    assert plan.registration.is_clear
    assert np.abs(plan.registration.xy - SHIFT).max() < 0.1
    assert plan_of(replace(request, where="id = 'house-7'")).registration == plan.registration


def test_the_common_shift_depends_on_the_files_alone(shifted_request, tmp_path):
    registration = plan_of(shifted_request).registration
    box = (*(ORIGIN[:2] + 40), *(ORIGIN[:2] + 120))
    for other in (
        replace(shifted_request, bbox=box),
        replace(shifted_request, where="id = 'house-7'"),
        make_request(tmp_path / "cut", move_town(scattered_houses(), -SHIFT), pieces=3),
    ):
        plan = plan_of(other)
        assert plan.registration == registration
    reordered = dict(reversed(list(move_town(scattered_houses(), -SHIFT).footprints.items())))
    town = replace(scattered_houses(), footprints=reordered)
    assert plan_of(make_request(tmp_path / "reordered", town)).registration == registration


def test_footprints_in_place_stay_and_align_off_looks_for_nothing(tmp_path, shifted_request):
    plan = make_plan(make_request(tmp_path, scattered_houses()))
    assert not plan.registration.is_clear and plan.registration.length < 0.1
    assert all(job.area.equals(job.footprint.polygon) for job in plan.jobs)
    assert make_plan(replace(shifted_request, settings=OFF)).registration is None


@pytest.mark.parametrize("shift", [(0.0, 0.0), (1.0, 0.5), (-2.0, 1.5)])
def test_a_shift_of_too_few_footprints_is_told_and_not_taken_off(shift, tmp_path):
    town = move_town(scattered_houses(3, 3), -np.array(shift))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        plan = make_plan(make_request(tmp_path, town))
    assert not plan.registration.is_clear
    said = [str(one.message) for one in told if "may lie" in str(one.message)]
    assert len(said) == any(shift)
    if said:
        beside = np.array(re.search(r"by \((.*?), (.*?)\) m", said[0]).groups(), float)
        assert beside == pytest.approx(-np.array(shift), abs=0.3)


def test_roofs_on_the_border_of_a_sampled_square_are_not_cut(tmp_path):
    """Half a roof fits its footprint in many places: 5 houses seemed to lie 3.5 m beside theirs."""
    town = scattered_houses(1, 5)
    middle = shapely.MultiPolygon(list(town.footprints.values())).centroid.y
    north = SAMPLE_CELL_M * np.ceil(middle / SAMPLE_CELL_M) - middle
    town = replace(move_town(town, (0.0, north)), xyz=town.xyz + [0.0, north, 0.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error", InputWarning)
        plan = make_plan(make_request(tmp_path, town))
    assert plan.registration.length < 0.1


def move_file(footprints: Path, vector, path: Path) -> None:
    """Write the footprints of a file beside their places."""
    meta, _, wkb, _ = pyogrio.raw.read(footprints)
    wkb = shapely.to_wkb(shapely.transform(shapely.from_wkb(wkb), lambda xy: xy + vector))
    pyogrio.raw.write(path, wkb, [], [], geometry_type=meta["geometry_type"], crs=meta["crs"])


@pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/data here")
@pytest.mark.parametrize(
    ("epoch", "vector"),
    [("2010", (0.0, 0.0)), ("2014", (0.94, 0.34)), ("2010", (-2.3, 1.93)), ("2014", (3.06, -2.57))],
)
def test_known_shifts_are_found_or_told_where_no_class_marks_roofs(epoch, vector, tmp_path):
    """Class 1 holds roofs and trees along canals."""
    folder, path = SHARED / "two_epochs", tmp_path / "footprints.gpkg"
    move_file(folder / "footprints.gpkg", vector, path)
    clouds = tuple(map(str, sorted((folder / epoch).iterdir())))
    settings = Settings.from_dict({"read": {"roofs": "shape"}})
    request = Request(clouds, tmp_path / "out", str(path), settings=settings)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        registration = make_plan(request).registration
    assert np.hypot(*np.add(registration.xy, vector)) < 0.3
    said = [w for w in told if "all footprints" in str(w.message)]
    assert len(said) == any(vector)


@pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/data here")
@pytest.mark.parametrize(
    ("azimuth", "distance"), [(0, 0.5), (45, 0.75), (90, 0.5), (180, 0.75), (225, 0.5), (270, 0.75)]
)
def test_known_shifts_of_a_small_set_are_told(distance, azimuth, tmp_path):
    """The border of the cloud cuts 6 of 21 footprints, which were up to 1.2 m off."""
    folder, path = SHARED / "amsterdam_west", tmp_path / "footprints.gpkg"
    vector = distance * np.array([np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))])
    move_file(folder / "footprints_bag.gpkg", vector, path)
    clouds = tuple(map(str, sorted(folder.glob("*.laz"))))
    request = Request(clouds, tmp_path / "out", str(path))
    with pytest.warns(InputWarning, match="all footprints may lie beside their roofs"):
        registration = make_plan(request).registration
    assert np.hypot(*(registration.xy + vector)) < 0.25


@pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/data here")
@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("distance", [0.0, 1.0, 3.0])
def test_known_shifts_of_real_footprints_are_found_or_told(name, distance):
    polygons, points = read_once(name)
    turn = np.random.default_rng(len(polygons)).uniform(0, 2 * np.pi)
    vector = distance * np.array([np.cos(turn), np.sin(turn)])
    result = register([(points[:, :2], shift_polygons(polygons, vector))])
    assert np.hypot(*(result.xy + vector)) < 0.3
    assert (result.is_clear or is_suspected(result)) == (distance > 0)


def read_records(out) -> dict[str, dict]:
    lines = map(json.loads, (out / "parameters.jsonl").read_text().splitlines())
    return {line["id"]: line for line in lines if "id" in line}


def test_a_run_builds_on_the_roofs_and_says_so(shifted_request, tmp_path):
    request = replace(shifted_request, out=tmp_path / "out", where="id in ('house-7', 'house-8')")
    with pytest.warns(InputWarning, match="all footprints lie beside their roofs"):
        reconstruct_area(request)
    record = json.loads((request.out / "run.json").read_text())
    assert record["registration"]["applied"] and record["registration"]["squares"] >= 15
    for id, building in read_records(request.out).items():
        assert building["shift"] == record["registration"]["shift_m"]
        truth = scattered_houses().footprints[id]
        outline = shapely.Polygon(np.array(building["outline"][0]) + building["origin"][:2])
        assert outline.symmetric_difference(truth).area < 0.1 * truth.area


def test_a_row_moves_as_one_whichever_of_its_houses_are_asked_for(tmp_path):
    request = make_request(tmp_path, move_town(row_of_houses(), (-0.7, 0.4)))
    reconstruct_area(request)
    whole = read_records(request.out)
    shifts = {tuple(building["shift"]) for building in whole.values()}
    assert len(shifts) == 1 and np.abs(np.subtract(shifts.pop(), (0.7, -0.4))).max() < 0.1
    assert all(
        "was moved with the 4 of its row by (0.7" in building["detail"]
        for building in whole.values()
    )
    single_request = replace(request, out=tmp_path / "one", where="id = 'house-2'")
    reconstruct_area(single_request)
    assert read_records(single_request.out)["house-2"] == whole["house-2"]


def test_one_house_of_a_row_is_not_moved_away_from_the_others(tmp_path):
    town = row_of_houses()
    footprints = {**town.footprints, "house-1": move_town(town, (0.0, 1.0)).footprints["house-1"]}
    request = make_request(tmp_path, replace(town, footprints=footprints))
    reconstruct_area(request)
    assert {tuple(building["shift"]) for building in read_records(request.out).values()} == {
        (0.0, 0.0)
    }
