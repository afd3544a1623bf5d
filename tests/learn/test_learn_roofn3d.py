"""RoofN3D as training data, on small files of its exact format."""

import csv

import numpy as np
import pytest
from benchmarks.samples import training_sample

from hiproof.errors import InputError
from hiproof.learn.data import BUILDINGS_FILE, SURFACES_FILE, TRAINING_TYPES, open_source
from hiproof.learn.sample import TEST, TRAINING
from hiproof.segment.inference import NOT_ROOF

CLASSES = {"gable": "Saddleback roof", "hip": "Two-sided hip roof", "pyramid": "Pyramid roof"}
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
    roof_points = {}
    for id in range(count):
        points, labels, type = training_sample(
            np.random.default_rng(id), TRAINING_TYPES, n_points=(80, 200)
        )
        points = points + (583_000.0, 4_507_000.0, 20.0)
        buildings.append(
            [
                id,
                CLASSES[TRAINING_TYPES[type]],
                multipoint(points),
                OUTLINE,
                "",
                "",
                "MULTIPOLYGON Z (((0 0 0,1 0 0,1 1 0,0 0 0)))",
            ]
        )
        surfaces.append([1000 + id, multipoint(points[labels < 3]), OUTLINE, 0, 0, 1, -20, id])
        roof_points[str(id)] = int((labels < 3).sum())
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
