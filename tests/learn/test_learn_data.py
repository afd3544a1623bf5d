"""Training data: labels that mean what they say, splits that hold, files that cannot be used."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from handmade import RD_ORIGIN, box, make_building
from hiproof.errors import InputError
from hiproof.learn.data import (
    BUILDINGS_FILE,
    CURVED_TYPES,
    SURFACES_FILE,
    TRAINING_TYPES,
    open_source,
    read_shapes,
)
from hiproof.learn.houses import lengthen, resize, training_house, without_a_corner
from hiproof.learn.sample import TEST, TRAINING, VALIDATION
from hiproof.segment.inference import NOT_ROOF
from hiproof.simulate import ROOF_TYPES
from hiproof.simulate.roofs import random_building
from hiproof.write import write_cityjson

DEN_HAAG = Path(__file__).parents[2] / ".." / "shared" / "data" / "denhaag" / "DenHaag_01.city.json"


def write_boxes(path, count, code="1000"):
    """Write a CityJSON of `count` boxes of 6 x 8 x 4 m in a row, flat roofs; return its path."""
    solid, known = box(6.0, 8.0, 0.0, 4.0), {"roofType": code}
    places = RD_ORIGIN + np.outer(20.0 * np.arange(count), (1, 0, 0))
    boxes = [
        make_building(solid, f"box-{i}", origin=p, attributes=known) for i, p in enumerate(places)
    ]
    write_cityjson(path, boxes)
    return path


def test_simulated_clouds_are_the_same_whenever_asked_for_and_differ_by_role():
    source = open_source("simulated")
    first = source.sample(TRAINING, 5)
    repeat = source.sample(TRAINING, 5)
    other = source.sample(VALIDATION, 5)
    np.testing.assert_array_equal(first.xyz, repeat.xyz)
    assert first.xyz.shape != other.xyz.shape or not np.array_equal(first.xyz, other.xyz)


def test_simulated_labels_are_types_or_not_roof():
    source = open_source("simulated", ("pyramid", "gable", "hip"))
    samples = [source.sample(TRAINING, i) for i in range(40)]
    assert {sample.type for sample in samples} == {0, 1, 2}
    for sample in samples:
        assert set(np.unique(sample.labels)) <= {-1, 0, 1, 2}
        assert (sample.labels == sample.type).sum() >= 10
        assert len(sample.labels) == len(sample.xyz) and np.isfinite(sample.xyz).all()


@pytest.mark.parametrize("type", CURVED_TYPES)
def test_curved_roofs_are_simulated_where_they_are_named(type):
    source = open_source("simulated", ("flat", type))
    samples = [source.sample(TRAINING, i) for i in range(12)]
    assert {sample.type for sample in samples} == {0, 1}
    for curved in (sample for sample in samples if sample.type == 1):
        roof = curved.xyz[curved.labels == 1]
        assert len(roof) >= 10
        # It has a round or bent top: its highest points lie around the middle of its plan.
        top = roof[roof[:, 2] >= np.percentile(roof[:, 2], 90), :2]
        assert np.linalg.norm(top.mean(axis=0) - roof[:, :2].mean(axis=0)) < 0.3 * np.ptp(top) + 1.0
    with pytest.raises(InputError, match="half_cone"):
        open_source("simulated", ("half_cone",))


@pytest.mark.parametrize(("annex_share", "fewest"), [(1.0, 2), (0.3, 1)])
@pytest.mark.parametrize("type", [*ROOF_TYPES, *CURVED_TYPES])
def test_varied_and_annexed_houses_are_whole_and_keep_their_type(type, annex_share, fewest):
    for seed in range(15):
        house = training_house(np.random.default_rng([3, seed]), type, annex_share=annex_share)
        assert house.type == type and len(house.roof.parts) >= fewest
        assert house.outline.geom_type == "Polygon" and house.outline.area > 1.0


def test_a_cut_corner_leaves_a_convex_plan_under_the_same_planes():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        part = random_building(rng, "hip").roof.parts[0]
        old, new = part.pieces[0], without_a_corner(rng, part).pieces[0]
        assert 0.5 * old.outline.area < new.outline.area < old.outline.area
        assert new.outline.within(old.outline.buffer(1e-9))
        assert new.outline.convex_hull.area == pytest.approx(new.outline.area)
        np.testing.assert_array_equal(old.planes, new.planes)


def test_a_resized_part_keeps_its_shape_and_a_lengthened_one_its_ends():
    rng = np.random.default_rng(0)
    hip = random_building(rng, "hip").roof.parts[0]
    longer = lengthen(rng, hip).parameters
    assert longer["length"] - longer["ridge_length"] == pytest.approx(
        hip.parameters["length"] - hip.parameters["ridge_length"]
    )
    smaller = resize(rng, hip).parameters
    ratios = {name: smaller[name] / hip.parameters[name] for name in smaller}
    assert ratios["length"] == pytest.approx(ratios["width"])
    assert ratios["height"] <= ratios["width"] <= 1.0


def test_boxes_of_a_cityjson_are_scanned_and_split(tmp_path):
    path = write_boxes(tmp_path / "boxes.city.json", 12)
    shapes = read_shapes(path)
    assert len(shapes) == 12 and all(shape.outline.area == pytest.approx(48.0) for shape in shapes)
    assert 0 < sum(shape.held_out for shape in shapes) < 12
    source = open_source(f"denhaag:{path}")
    sample = source.sample(TRAINING, 0)
    assert source.types[sample.type] == "flat"
    roof = sample.xyz[sample.labels == sample.type]
    assert np.ptp(roof[:, 2]) < 1.5


def test_mixture_validates_on_the_first_source_alone(tmp_path):
    path = write_boxes(tmp_path / "boxes.city.json", 12)
    mixture, simulated = open_source(["simulated", f"denhaag:{path}"]), open_source("simulated")
    np.testing.assert_array_equal(mixture.sample(TEST, 3).xyz, simulated.sample(TEST, 3).xyz)
    assert "boxes.city.json" in mixture.description


def test_the_hagues_buildings_are_held_out_whole():
    if not DEN_HAAG.exists():
        pytest.skip("needs ../shared/data/denhaag")
    city = json.loads(DEN_HAAG.read_text())["CityObjects"]
    side = {}
    for shape in read_shapes(DEN_HAAG):
        side.setdefault(city[shape.id].get("parents", [shape.id])[0], set()).add(shape.held_out)
    assert all(len(sides) == 1 for sides in side.values())


@pytest.mark.parametrize("data", ["", "simulated:x", "roofn3d", "denhaag:", "nonsense", []])
def test_unknown_data_is_refused(data):
    with pytest.raises(InputError, match="expected training data"):
        open_source(data)


def test_unknown_types_and_unusable_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="igloo"):
        open_source("simulated", ("gable", "igloo"))
    (tmp_path / "text.json").write_text("{}")
    with pytest.raises(InputError, match="CityJSON"):
        open_source(f"denhaag:{tmp_path / 'text.json'}")
    unknown = write_boxes(tmp_path / "unknown.city.json", 5, code="9999")
    with pytest.raises(InputError, match="roofType"):
        open_source(f"denhaag:{unknown}")
    with pytest.raises(InputError, match=r"roofn3d_buildings\.csv"):
        open_source(f"roofn3d:{tmp_path}")


CLASSES = {"gable": "Saddleback roof", "hip": "Two-sided hip roof", "pyramid": "Pyramid roof"}
PLACE = (583_000.0, 4_507_000.0, 20.0)
OUTLINE = "MULTIPOLYGON(((0 0,9 0,9 9,0 9,0 0)))"


def multipoint(points):
    return "MULTIPOINT Z (" + ",".join(f"{x:.3f} {y:.3f} {z:.3f}" for x, y, z in points) + ")"


def write_roofn3d(folder, count=40, header_of_points="points"):
    """Simulated clouds as RoofN3D, every roof one surface; returns roof points by id."""
    buildings = [
        [
            "id",
            "class",
            header_of_points,
            "outline",
            "unassignedsurfacegrowingpoints",
            "unassignedsubsurfacegrowingpoints",
            "brep",
        ]
    ]
    surfaces = [
        ["id", "points", "outline", "plane_a", "plane_b", "plane_c", "plane_d", "fk_buildings"]
    ]
    roof_points, source = {}, open_source("simulated", TRAINING_TYPES)
    for id in range(count):
        sample = source.sample(TRAINING, id)
        few = slice(None, None, 1 + len(sample.xyz) // 200)
        points, on_roof = sample.xyz[few] + PLACE, sample.labels[few] != NOT_ROOF
        buildings.append(
            [
                id,
                CLASSES[TRAINING_TYPES[sample.type]],
                multipoint(points),
                OUTLINE,
                "",
                "",
                "MULTIPOLYGON Z (((0 0 0,1 0 0,1 1 0,0 0 0)))",
            ]
        )
        surfaces.append([1000 + id, multipoint(points[on_roof]), OUTLINE, 0, 0, 1, -20, id])
        roof_points[str(id)] = int(on_roof.sum())
    buildings.append(buildings[1])
    for name, rows in ((BUILDINGS_FILE, buildings), (SURFACES_FILE, surfaces)):
        with open(folder / name, "w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows(rows)
    return roof_points


@pytest.fixture
def source(tmp_path):
    write_roofn3d(tmp_path)
    with pytest.warns(UserWarning, match="id of an earlier one"):
        return open_source(f"roofn3d:{tmp_path}")


def test_buildings_are_read_once_and_split_by_id(source):
    assert len(source.held_out) == 40
    assert 0 < source.held_out.sum() < 20
    assert source.types == ("gable", "hip", "pyramid")
    assert "held out" in source.description


def test_points_of_surfaces_carry_the_type_and_the_rest_none(source, tmp_path):
    roof_points = sorted(write_roofn3d(tmp_path).values())
    labels = [
        int(source.on_surface[a:b].sum())
        for a, b in zip(source.starts[:-1], source.starts[1:], strict=True)
    ]
    assert sorted(labels) == roof_points
    for index in range(10):
        sample = source.sample(TRAINING, index)
        assert set(np.unique(sample.labels)) <= {NOT_ROOF, sample.type}
        assert abs(sample.xyz.mean()) < 1e-3


def test_training_draws_types_evenly_and_never_what_is_held_out(source):
    held_out = {source.sample(TEST, i).xyz.tobytes() for i in range(source.held_out.sum())}
    samples = [source.sample(TRAINING, i) for i in range(150)]
    assert not held_out & {sample.xyz.tobytes() for sample in samples}
    assert np.bincount([sample.type for sample in samples]).min() > 25


def test_files_that_are_missing_or_of_another_layout_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"roofn3d_buildings\.csv"):
        open_source(f"roofn3d:{tmp_path}")
    write_roofn3d(tmp_path, count=3, header_of_points="geometry")
    with pytest.raises(InputError, match="columns"):
        open_source(f"roofn3d:{tmp_path}")
    write_roofn3d(tmp_path, count=1)
    with pytest.raises(InputError, match="enough RoofN3D buildings"), pytest.warns(UserWarning):
        open_source(f"roofn3d:{tmp_path}")
