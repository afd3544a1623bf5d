"""The sheets of drawn roofs: lines have their kinds, points their heights over the roof, a run
becomes a picture.
"""

import importlib
from collections import Counter

import numpy as np
import pytest

from hiproof import Request, reconstruct_area
from hiproof.compose import compose
from hiproof.simulate import random_building, random_compound, uniform_points

pytest.importorskip("matplotlib", reason="drawing needs matplotlib (extra `report`)")
draw_roofs = importlib.import_module("docs.draw_roofs")


def count_lines(building):
    return Counter(kind for kind, _ in draw_roofs.list_roof_lines(compose(building.roof, 0.0)))


@pytest.mark.parametrize(
    ("type", "ridges", "eaves"),
    [("flat", 0, 4), ("gable", 1, 6), ("hip", 5, 4), ("pyramid", 4, 4), ("mansard", 8, 4)],
)
def test_a_single_roof_has_its_ridges_and_eaves(type, ridges, eaves):
    building = random_building(np.random.default_rng(1), type)
    assert count_lines(building) == Counter({"ridge": ridges, "eave": eaves})


def test_valleys_and_steps_are_told_from_ridges():
    hips = random_compound(np.random.default_rng(0), "L_of_hips")
    lines = draw_roofs.list_roof_lines(compose(hips.roof, 0.0))
    valley = sum(
        float(np.linalg.norm(ends[1] - ends[0])) for kind, ends in lines if kind == "valley"
    )
    assert valley == pytest.approx(hips.parameters["width"] / np.sqrt(2), abs=0.01)
    assert count_lines(random_compound(np.random.default_rng(0), "two_level"))["step"] >= 1
    assert "step" not in {kind for kind, _ in lines}


def test_points_have_their_height_over_the_roof():
    building = random_building(np.random.default_rng(2), "gable")
    points = uniform_points(building, np.random.default_rng(3), noise=0.0)
    shift = np.random.default_rng(4).uniform(-0.5, 0.5, len(points))
    gap = draw_roofs.measure_gaps(
        compose(building.roof, 0.0), points + np.column_stack([0 * shift, 0 * shift, shift])
    )
    assert np.allclose(gap, shift, atol=2e-3)
    assert np.isnan(
        draw_roofs.measure_gaps(compose(building.roof, 0.0), np.array([[99.0, 99.0, 5.0]]))
    ).all()


def test_a_run_becomes_sheets(town_files, tmp_path):
    reconstruct_area(Request((town_files[0],), tmp_path / "run", town_files[1]))
    words = ["--out", str(tmp_path), "--worst", "2", "--chance", "1", "--ids", "house-0"]
    draw_roofs.main([str(tmp_path / "run"), *words])
    names = sorted(path.name for path in tmp_path.glob("*.png"))
    assert names == ["asked-1.png", "chance-1.png", "worst-1.png"]
    assert all((tmp_path / name).stat().st_size > 5000 for name in names)


def test_what_is_no_run_is_refused(tmp_path):
    with pytest.raises(SystemExit, match="expected"):
        draw_roofs.main([str(tmp_path), "--out", str(tmp_path)])
    with pytest.raises(SystemExit, match="one of delft"):
        draw_roofs.main(["nowhere", "--out", str(tmp_path)])
