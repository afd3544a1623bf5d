"""Curved roofs have as many facets as the tolerance of chords asks for."""

import numpy as np
import pytest

import hiproof
from hiproof.compose import check_solid, compose
from hiproof.compose.solid import draw_facets
from hiproof.frames import LocalFrame
from hiproof.model import ROOF, Roof
from hiproof.parametric.run import build_file
from hiproof.primitives import CATALOGUE
from hiproof.primitives.catalogue import CURVED
from hiproof.read.models.solids import read_solids
from hiproof.settings import ComposeSettings, Settings
from hiproof.write.head import FileHead
from hiproof.write.parameters import write_parameters


def make_roof(kind, width=8.0):
    shape = CATALOGUE[kind]
    length = width / 2 if kind == "half_cone" else width
    parameters = shape.typical(width, length, 0.4 * width)
    part = shape.variant(parameters).part(shape.to_theta(parameters, 0.3, (1.0, 2.0, 6.0)))
    return Roof((part,), part.pieces[0].outline, LocalFrame(np.zeros(3)))


def compose_with(roof, chord_m):
    return compose(roof, 0.0, Settings.from_dict({"compose": {"chord_tolerance_m": chord_m}}))


@pytest.mark.parametrize("kind", CURVED)
def test_the_default_draws_what_is_fitted(kind):
    roof = make_roof(kind)
    (drawn,) = draw_facets(roof, ComposeSettings().chord_tolerance_m).parts
    assert np.array_equal(drawn.pieces[0].planes, roof.parts[0].pieces[0].planes)


@pytest.mark.parametrize(
    ("kind", "fewest"),
    [("cone", 32), ("half_cone", 16), ("dome", 100), ("barrel", 12), ("onion", 70)],
)
def test_a_finer_tolerance_has_more_facets_and_the_same_volume(kind, fewest):
    roof = make_roof(kind)
    usual, fine = compose_with(roof, 0.1), compose_with(roof, 0.03)
    assert not check_solid(fine)
    assert len(fine.select_faces(ROOF)) >= max(fewest, 1.5 * len(usual.select_faces(ROOF)))
    assert fine.volume == pytest.approx(usual.volume, rel=0.005)


def test_facets_of_a_cone_keep_within_the_tolerance():
    rng = np.random.default_rng(0)
    for chord_m in (0.02, 0.1, 0.4):
        (part,) = draw_facets(make_roof("cone", 14.0), chord_m).parts
        turns, r = rng.uniform(0.0, 2.0 * np.pi, 500), 6.9 * np.sqrt(rng.uniform(0.0, 1.0, 500))
        xy = part.translation[:2] + np.column_stack([r * np.cos(turns), r * np.sin(turns)])
        slope = part.parameters["height"] / 7.0
        away = (part.pieces[0].height_at(xy) - (6.0 + slope * (7.0 - r))) / slope
        assert np.abs(away).max() <= chord_m


def test_a_file_of_parameters_keeps_the_tolerance(tmp_path):
    compose_settings = ComposeSettings(chord_tolerance_m=0.03)
    roof = make_roof("cone")
    record = {
        "id": "tower",
        "origin": [0.0, 0.0, 0.0],
        "z_ground": 0.0,
        "outline": [np.asarray(roof.outline.exterior.coords).tolist()],
        "parts": [
            {
                "type": "cone",
                "parameters": roof.parts[0].parameters,
                "position": roof.parts[0].translation.tolist(),
                "rotation": np.degrees(roof.parts[0].kappa),
            }
        ],
    }
    tower = hiproof.build(record, compose_settings)
    head = FileHead("EPSG:7415", compose=compose_settings)
    write_parameters(tmp_path / "parameters.jsonl", [tower], head=head)
    build_file(tmp_path / "parameters.jsonl", tmp_path / "out")
    (id, solid), *_ = read_solids(tmp_path / "out" / "buildings.city.jsonl")
    assert (id, len(solid.select_faces(ROOF))) == ("tower", 32)
    assert solid.volume == pytest.approx(tower.solid.volume, rel=1e-6)
