"""What compose does with roofs it cannot, or can hardly, make a solid of."""

import numpy as np
import pytest
import shapely

import roof_zoo
from hiproof.compose import check_solid, compose
from hiproof.errors import CompositionError
from hiproof.model import Part, Piece, Roof
from hiproof.settings import Settings
from roof_zoo import FRAME

HOUSE = shapely.box(0, 0, 10, 8)
FLAT = np.array([[0.0, 0.0, 5.0]])


@pytest.mark.parametrize(
    ("roof", "sentence"),
    [
        (Roof((), HOUSE, FRAME), "at least one piece"),
        (
            Roof((Part("flat", (Piece(HOUSE, np.zeros((0, 3))),)),), HOUSE, FRAME),
            "at least one piece",
        ),
        (Roof((Part("flat", (Piece(HOUSE, FLAT),)),), shapely.Polygon(), FRAME), "outline"),
        (Roof((Part("flat", (Piece(HOUSE, FLAT * np.nan),)),), HOUSE, FRAME), "finite roof planes"),
        (
            Roof((Part("flat", (Piece(HOUSE, FLAT),)),), shapely.box(1e6, 0, 1e6 + 9, 9), FRAME),
            "local frame",
        ),
        (Roof((Part("flat", (Piece(HOUSE, FLAT),)),), shapely.box(0, 0, 10, 1e-5), FRAME), "area"),
    ],
)
def test_unusable_roof_raises_a_sentence(roof, sentence):
    with pytest.raises(CompositionError, match=sentence):
        compose(roof, 0.0)


@pytest.mark.parametrize("z_ground", [np.nan, np.inf, -np.inf])
def test_ground_must_be_finite(z_ground):
    with pytest.raises(CompositionError, match="finite ground height"):
        roof_zoo.flat_block(HOUSE, 5.0, z_ground)


def test_piece_far_from_the_outline_still_roofs_it():
    roof = roof_zoo.roof([Piece(shapely.box(50, 50, 60, 60), FLAT)], HOUSE)
    assert compose(roof, 0.0).volume == pytest.approx(400.0)


OUTLINES = {
    "the larger half of a bow tie": ([(0, 0), (10, 4), (10, 0), (0, 6)], 90.0, 5),
    "the larger side of a neck thinner than a millimetre": (
        [(0, 0), (5, 0), (5, 2), (8, 2), (8, 0), (10, 0), (10, 5), (8, 5), (8, 2.0005), (5, 2.0005)]
        + [(5, 5), (0, 5)],
        125.0,
        6,
    ),
    "a box of repeated and collinear vertices": (
        [(0, 0), (0, 0), (5, 0), (5.0002, 0), (10, 0), (10, 8), (10, 8.0004), (0, 8)],
        400.0,
        6,
    ),
    "a box without its spike": (
        [(0, 0), (10, 0), (10, 4), (15, 4.0003), (10, 4.0006), (10, 8), (0, 8)],
        400.0,
        6,
    ),
}


@pytest.mark.parametrize("name", OUTLINES)
def test_of_an_odd_outline_a_block_is_left(name):
    ring, volume, faces = OUTLINES[name]
    _, solid = roof_zoo.flat_block(shapely.Polygon(ring), 5.0, 0.0)
    assert check_solid(solid) == () and len(solid.faces) == faces
    assert solid.volume == pytest.approx(volume, abs=0.02)


def test_slivers_join_a_neighbour_by_the_settings():
    pieces = [
        Piece(shapely.box(0, 0, 5, 8), FLAT),
        Piece(shapely.box(5, 0, 5.05, 8), FLAT + [[0, 0, 1]]),
    ]
    pieces.append(Piece(shapely.box(5.05, 0, 10, 8), FLAT + [[0, 0, 2]]))
    roof = roof_zoo.roof(pieces, HOUSE)
    narrow, wide = (
        Settings.from_dict({"compose": {"min_face_width_m": width}}) for width in (0.01, 0.1)
    )
    assert len(compose(roof, 0.0, narrow).select_faces("RoofSurface")) == 3
    assert len(compose(roof, 0.0, wide).select_faces("RoofSurface")) == 2
    assert len(compose(roof, 0.0).select_faces("RoofSurface")) == 2


def test_coordinates_are_multiples_of_a_tenth_of_a_millimetre():
    solid = compose(roof_zoo.generate_roof("cross_gables", 1), -1.23456789)
    assert np.abs(solid.vertices * 1e4 - np.rint(solid.vertices * 1e4)).max() < 1e-6
