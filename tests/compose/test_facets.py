"""Curved roofs have as many facets as the tolerance of chords asks for."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

import hiproof
from hiproof.compose import check_solid, compose
from hiproof.compose.solid import draw_all_facets
from hiproof.frames import LocalFrame
from hiproof.model import ROOF, Part, Piece, Roof
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


def stand_on_flat(roof):
    """Return a roof with a flat part around it, whose outline has no corners on the rim."""
    outline = shapely.box(*roof.outline.bounds).buffer(2.0, join_style="mitre")
    base = Part("flat", (Piece(outline, np.array([[0.0, 0.0, 5.0]])),), {"width": 1.0})
    return Roof((base, *roof.parts), outline, roof.frame)


def compose_with(roof, chord_m):
    return compose(roof, 0.0, Settings.from_dict({"compose": {"chord_tolerance_m": chord_m}}))


@pytest.mark.parametrize("kind", CURVED)
def test_the_default_draws_what_is_fitted(kind):
    roof = stand_on_flat(make_roof(kind))
    _, drawn = draw_all_facets(roof, ComposeSettings().chord_tolerance_m).parts
    assert np.array_equal(drawn.pieces[0].planes, roof.parts[1].pieces[0].planes)


@pytest.mark.parametrize(
    ("kind", "fewest"),
    [("cone", 32), ("half_cone", 16), ("dome", 100), ("barrel", 12), ("onion", 70)],
)
def test_a_finer_tolerance_has_more_facets_and_the_same_volume(kind, fewest):
    roof = stand_on_flat(make_roof(kind))
    usual, fine = compose_with(roof, 0.1), compose_with(roof, 0.03)
    assert not check_solid(fine)
    assert len(fine.select_faces(ROOF)) >= max(fewest, 1.5 * len(usual.select_faces(ROOF)))
    assert fine.volume == pytest.approx(usual.volume, rel=0.006)


def test_facets_of_a_cone_keep_within_the_tolerance():
    rng = np.random.default_rng(0)
    for chord_m in (0.02, 0.1, 0.4):
        _, part = draw_all_facets(stand_on_flat(make_roof("cone", 14.0)), chord_m).parts
        turns, r = rng.uniform(0.0, 2.0 * np.pi, 500), 6.9 * np.sqrt(rng.uniform(0.0, 1.0, 500))
        xy = part.translation[:2] + np.column_stack([r * np.cos(turns), r * np.sin(turns)])
        slope = part.parameters["height"] / 7.0
        away = (part.pieces[0].height_at(xy) - (6.0 + slope * (7.0 - r))) / slope
        assert np.abs(away).max() <= chord_m


@pytest.mark.parametrize("kind", ["cone", "dome", "onion", "half_cone"])
def test_an_eave_along_corners_of_the_outline_is_level_between_them(kind):
    """Facets of other directions would cut it into teeth, whatever the corners and the top."""
    rng = np.random.default_rng(7)
    for sides in range(6, 25, 3):
        radius, away = rng.uniform(2.0, 8.0), rng.uniform(-0.03, 0.03, 2)
        turns = (np.arange(sides) + rng.uniform(-0.2, 0.2, sides)) * 2.0 * np.pi / sides
        if kind == "half_cone":  # its wall is the side at -u
            turns = (np.arange(sides) / (sides - 1.0) - 0.5) * np.pi
        rim = radius * np.column_stack([np.cos(turns), np.sin(turns)])
        shape, outline = CATALOGUE[kind], shapely.Polygon(rim)
        width = 2.0 * np.sqrt(outline.area / np.pi * (2.0 if kind == "half_cone" else 1.0))
        depth = 0.5 * width if kind == "half_cone" else width
        place = (*(radius * away), 6.0)
        if kind == "half_cone":
            place = (0.5 * depth, 0.0, 6.0)
        part = shape.part(shape.to_theta(shape.typical(width, depth, 0.4 * width), 0.0, place))
        part = replace(part, pieces=tuple(Piece(outline, p.planes) for p in part.pieces))
        solid = compose(Roof((part,), outline, LocalFrame(np.zeros(3))), 0.0)
        vertices = solid.vertices[solid.vertices[:, 2] > 3.0]
        on_rim = shapely.dwithin(outline.exterior, shapely.points(vertices), 1e-3)
        on_wall = (np.abs(vertices[:, 0]) < 1e-3) & (kind == "half_cone")
        assert np.count_nonzero(on_rim) >= sides
        assert vertices[on_rim & ~on_wall, 2] == pytest.approx(6.0, abs=1e-3), sides


def test_a_file_of_parameters_keeps_the_tolerance(tmp_path):
    compose_settings = ComposeSettings(chord_tolerance_m=0.03)
    roof, shape = make_roof("barrel"), CATALOGUE["barrel"]
    record = {
        "id": "hall",
        "origin": [0.0, 0.0, 0.0],
        "z_ground": 0.0,
        "outline": [np.asarray(roof.outline.exterior.coords).tolist()],
        "parts": [
            {
                "type": "barrel",
                "parameters": roof.parts[0].parameters,
                "position": roof.parts[0].translation.tolist(),
                "rotation": np.degrees(roof.parts[0].kappa),
            }
        ],
    }
    hall = hiproof.build(record, compose_settings)
    head = FileHead("EPSG:7415", compose=compose_settings)
    write_parameters(tmp_path / "parameters.jsonl", [hall], head=head)
    build_file(tmp_path / "parameters.jsonl", tmp_path / "out")
    (id, solid), *_ = read_solids(tmp_path / "out" / "buildings.city.jsonl")
    strips = len(shape.refine(roof.parts[0].parameters, 0.03).planes)
    assert strips > len(shape.planes)
    assert (id, len(solid.select_faces(ROOF))) == ("hall", strips)
    assert solid.volume == pytest.approx(hall.solid.volume, rel=1e-6)
