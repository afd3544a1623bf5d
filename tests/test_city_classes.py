"""Runs of clouds without a building class: roofs and ground are found, and what hides a roof is
said.
"""

import json
import warnings

import laspy
import numpy as np
import pytest
import shapely

from hiproof import build
from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work.found import found_roof
from hiproof.errors import InputError, InputWarning
from hiproof.settings import Settings
from hiproof.simulate import SOURCES, Defects, ScanSettings, random_compound, scan
from leafy_scenes import drone, forest, make_house_under_tree
from run_records import by_id, run_points
from tiny_town import make_town, write_cloud, write_footprints


def run(folder, xyz, classes, footprints=None, settings=None):
    """The rows of a run by id."""
    return run_points(folder, xyz, classes, footprints, settings=settings or Settings())[0]


def make_settings(roofs):
    return Settings.from_dict({"read": {"roofs": roofs}})


def measure_height(row, xy_world):
    """Height (n,) in the world of the roof that a row of the parameters makes."""
    roof = build(row).roof
    return roof.height_at(xy_world - roof.frame.origin[:2]) + roof.frame.origin[2]


@pytest.mark.parametrize("ground", [1, 2], ids=["one class only", "a ground class"])
def test_footprints_are_enough(tmp_path, ground):
    town = make_town()
    classes = np.where(town.classification == 2, ground, 1)
    with pytest.warns(InputWarning, match="no building class"):
        rows = run(tmp_path, town.xyz, classes, town.footprints)
    assert [row["status"] for row in rows.values()] == ["modelled"] * 4
    assert all(abs(row["z_ground"] - 2.0) < 1.5 for row in rows.values())
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["settings"]["read"]["roofs"] == "shape"


def test_nothing_but_points_is_enough(tmp_path):
    town = make_town()
    with pytest.warns(InputWarning, match="no building class"):
        rows = run(tmp_path, town.xyz, np.ones(len(town.xyz)))
    assert [row["status"] for row in rows.values()] == ["modelled"] * 4


def test_shape_can_be_asked_for_although_there_is_a_class(tmp_path):
    town = make_town()
    wrong = np.where(np.arange(len(town.xyz)) % 2, town.classification, 1)
    rows = run(tmp_path, town.xyz, wrong, settings=make_settings("shape"))
    assert [row["status"] for row in rows.values()] == ["modelled"] * 4


def test_the_first_look_at_the_classes_leaves_the_news_of_a_file_to_the_one_that_sorts_it(tmp_path):
    town = make_town(1)
    cloud = laspy.read(write_cloud(tmp_path / "cloud.laz", town.xyz, town.classification))
    cloud.withheld = np.arange(len(town.xyz)) % 2
    cloud.write(tmp_path / "cloud.laz")
    footprints = write_footprints(tmp_path / "footprints.geojson", town.footprints)
    with pytest.warns(InputWarning, match="withheld") as remarks:
        reconstruct_area(Request((str(tmp_path / "cloud.laz"),), tmp_path / "out", str(footprints)))
    assert len(remarks) == 1


def test_how_points_are_cut_into_files_changes_no_building(tmp_path):
    town = make_town(2)
    with pytest.warns(InputWarning):
        whole = run(tmp_path, town.xyz, np.ones(len(town.xyz)), town.footprints)
    mixed = np.random.default_rng(0).permutation(town.xyz)
    parts = [
        write_cloud(tmp_path / f"{i}.laz", part, np.ones(len(part)))
        for i, part in enumerate(np.split(mixed, [2000]))
    ]
    with pytest.warns(InputWarning):
        reconstruct_area(
            Request(tuple(map(str, parts)), tmp_path / "cut", str(tmp_path / "footprints.geojson"))
        )
    assert by_id(tmp_path / "cut") == whole


@pytest.mark.parametrize("kind", [2, 3, 7, 9, 17])
def test_a_cloud_of_one_class_that_holds_no_roof_is_refused(tmp_path, kind):
    town = make_town(1)
    with pytest.raises(InputError, match=f"got classes {kind} "):
        run(tmp_path, town.xyz, np.full(len(town.xyz), kind), town.footprints)


def test_a_cloud_of_trees_without_footprints_is_refused(tmp_path):
    cloud = forest(np.random.default_rng(0), 40.0, 5.0)
    with (
        pytest.warns(InputWarning),
        pytest.raises(InputError, match="none of which lies on a smooth surface"),
    ):
        run(tmp_path, cloud.points + (85000, 446000, 0), np.ones(len(cloud)))


def test_a_roof_that_was_cut_out_is_one_building(tmp_path):
    town = make_town(1)
    roof = town.xyz[town.classification == 6]
    with pytest.warns(InputWarning, match="taken for the points of one roof"):
        rows = run(tmp_path, roof, np.zeros(len(roof)))
    assert [row["status"] for row in rows.values()] == ["modelled"]


@pytest.mark.parametrize("roofs", ["auto", "alone"])
def test_a_tree_beside_a_roof_that_was_cut_out_is_no_part_of_it(tmp_path, roofs):
    cloud, building = make_house_under_tree(np.random.default_rng(2), 0.4)
    points = cloud.points + (85000, 446000, 0)
    outline = shapely.transform(building.footprint, lambda xy: xy + (85000, 446000))
    cut = shapely.contains_xy(outline.buffer(1.5), *points[:, :2].T) & (
        cloud.source != SOURCES.index("ground")
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)  # auto says what it takes the cloud for
        (row,) = run(
            tmp_path, points[cut], np.ones(cut.sum()), settings=make_settings(roofs)
        ).values()
    result = shapely.transform(
        shapely.Polygon(row["outline"][0]), lambda xy: xy + row["origin"][:2]
    )
    assert result.intersection(outline).area / result.union(outline).area > 0.9


def test_the_low_part_of_a_roof_cut_out_is_no_ground_under_the_high_one(tmp_path):
    rng = np.random.default_rng(4)
    building = random_compound(rng, "two_level", (85000.0, 446000.0, 2.0))
    cloud = scan(building, rng, ScanSettings(density=8.0, defects=Defects.none()))
    roof = cloud.points[cloud.source == SOURCES.index("roof")]
    with pytest.warns(InputWarning, match="no building class"):
        rows = run(tmp_path, roof, np.ones(len(roof)), {"house": building.footprint})
    gap = roof[:, 2] - measure_height(rows["house"], roof[:, :2])
    assert np.mean(np.abs(gap) < 0.2) > 0.97


@pytest.mark.parametrize("density", [2.0, 8.0])
def test_roofs_of_neighbours_that_were_cut_out_are_no_ground(density, tmp_path):
    """Houses stood on the lowest points of those around, a fifth as high as they are."""
    town = make_town(seed=3, density=density)
    is_roof = town.classification == 6
    with pytest.warns(InputWarning, match="no building class"):
        rows = run(tmp_path, town.xyz[is_roof], np.ones(is_roof.sum()), town.footprints)
    for id, row in rows.items():
        inside = shapely.contains_xy(town.footprints[id], *town.xyz[:, :2].T) & is_roof
        lowest = town.xyz[inside, 2].min()
        assert row["status"] == "modelled" and row["z_ground"] < lowest - 2.5
        assert "its ground is assumed" in row["detail"]


def test_sparse_points_of_a_shed_are_its_roof_where_a_footprint_is_and_none_is_lost_by_that():
    area, n_gained = shapely.box(0, 0, 3.0, 2.7), 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        points = rng.uniform((0, 0, 2.2), (3.0, 2.7, 2.6), (26, 3))
        points[:10, 1], points[:10, 2] = rng.normal(2.6, 0.1, 10), rng.uniform(0.5, 4.2, 10)
        unknown = np.full(len(points), np.nan)
        shed, asked_for = (
            found_roof(points, area, unknown, is_asked_for) for is_asked_for in (False, True)
        )
        assert asked_for.is_seen
        assert not shed.is_seen or len(shed.points) <= len(asked_for.points)
        n_gained += not shed.is_seen
    assert n_gained > 0


def test_a_footprint_in_a_forest_holds_no_roof_and_says_so(tmp_path):
    points = forest(np.random.default_rng(0), 40.0, 5.0).points + (85000, 446000, 0)
    with pytest.warns(InputWarning):
        rows = run(
            tmp_path,
            points,
            np.ones(len(points)),
            {"wood": shapely.box(84994, 445995, 85006, 446004)},
        )
    assert rows["wood"]["status"] == "no_roof"
    assert "no roof seen: its points are leaves" in rows["wood"]["detail"]


def test_a_footprint_on_a_lawn_holds_no_building_and_says_so(tmp_path):
    town = make_town(1)
    lawn = shapely.box(85000, 446000, 85007, 446010)
    with pytest.warns(InputWarning):
        rows = run(tmp_path, town.xyz, np.ones(len(town.xyz)), {"lawn": lawn})
    assert rows["lawn"]["status"] == "no_building"
    assert "its points are ground" in rows["lawn"]["detail"]


def run_moved(folder, cloud, building, settings=None):
    """The row of a building without classes, moved into a national grid."""
    points = cloud.points + (85000, 446000, 0)
    outline = shapely.transform(building.footprint, lambda xy: xy + (85000, 446000))
    with pytest.warns(InputWarning):
        return run(folder, points, np.ones(len(points)), {"house": outline}, settings)["house"]


@pytest.mark.parametrize(("share", "remarks"), [(0.4, False), (0.95, True)])
def test_a_house_under_a_tree_is_its_roof_or_mostly_not_seen(tmp_path, share, remarks):
    cloud, building = make_house_under_tree(np.random.default_rng(2), share)
    row = run_moved(tmp_path, cloud, building)
    assert row["status"] == "modelled"
    assert ("mostly not seen" in row["detail"]) == remarks
    centroid = shapely.get_coordinates(building.outline.centroid)
    truth = building.roof.height_at(centroid) + building.roof.frame.origin[2]
    assert (
        abs(
            measure_height(row, centroid + building.roof.frame.origin[:2] + (85000, 446000)) - truth
        )[0]
        < 0.3
    )


def test_a_drones_cloud_is_as_good_as_it_is_dense(tmp_path):
    cloud, building = drone(np.random.default_rng(1), density=60.0)
    most = Settings.from_dict({"city": {"max_points_a_building": 6000}})
    row = run_moved(tmp_path, cloud, building, most)
    assert row["status"] == "modelled" and "fitted to 6000 of its" in row["detail"]
    inner, rng = building.outline.buffer(-0.3), np.random.default_rng(0)
    xy = rng.uniform(inner.bounds[:2], inner.bounds[2:], (500, 2))
    xy = xy[shapely.contains_xy(inner, *xy.T)]
    truth = building.roof.height_at(xy) + building.roof.frame.origin[2]
    gap = measure_height(row, xy + building.roof.frame.origin[:2] + (85000, 446000)) - truth
    assert np.median(np.abs(gap)) < 0.03


def test_nothing_known_around_a_roof_leaves_all_of_it():
    x, y = np.meshgrid(np.arange(0, 8, 0.3), np.arange(0, 6, 0.3))
    roof = np.column_stack([x.ravel(), y.ravel(), 5 + 0.3 * x.ravel()])
    is_roof = found_roof(roof, shapely.box(0, 0, 8, 6), np.full(len(roof), np.nan))
    assert len(is_roof.points) == len(roof) and is_roof.is_seen and not is_roof.remark
    assert not len(found_roof(roof, shapely.box(20, 0, 28, 6), np.full(len(roof), np.nan)).points)


@pytest.mark.parametrize("density", [0.5, 1.0])
def test_a_sparse_cloud_gets_models_as_good_as_it_allows(tmp_path, density):
    town = make_town(4, density)
    with pytest.warns(InputWarning):
        rows = run(tmp_path, town.xyz, np.ones(len(town.xyz)), town.footprints)
    for i, row in enumerate(rows.values()):
        assert row["status"] in ("modelled", "sparse")
        corners = shapely.get_coordinates(town.footprints[f"house-{i}"].buffer(-1.0))
        # the eave lies 5 m above the ground at 2 m
        assert (measure_height(row, corners) > 2.0 + 4.5).all()


def test_where_classes_tell_the_ground_nothing_low_beside_a_roof_is_taken_for_one(tmp_path):
    x, y = (
        axis.ravel()
        for axis in np.meshgrid(np.arange(-10.0, 24.0, 0.4), np.arange(-10.0, 16.0, 0.4))
    )
    inside, roof = (x > 0) & (x < 14) & (y > 0) & (y < 6), (x > 0) & (x < 9) & (y > 0) & (y < 6)
    z = np.where(roof, 5.0, np.where(inside, 0.2, 0.0))  # beside the house a bed of plants
    house = {"house": shapely.box(0, 0, 14, 6)}
    rows = run(
        tmp_path, np.column_stack([x, y, z]), np.where(inside, 1, 2), house, make_settings("shape")
    )
    (row,) = rows.values()
    assert all(
        part["type"] == "flat" and abs(part["position"][2] + row["origin"][2] - 5.0) < 0.1
        for part in row["parts"]
    )
