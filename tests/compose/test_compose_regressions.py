"""Roofs that once did not become a solid, each a folder of tests/regressions named after what was
wrong.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely

from hiproof.compose import check_solid, compose
from hiproof.model import Part, Piece, Roof
from roof_zoo import FRAME

ROOFS = sorted((Path(__file__).parents[1] / "regressions").glob("*/roof.json"))


def read_roof(path):
    stored = json.loads(path.read_text())
    parts = [
        Part(
            "free",
            tuple(Piece(shapely.from_wkt(p["outline"]), np.array(p["planes"])) for p in pieces),
        )
        for pieces in stored["parts"]
    ]
    return Roof(tuple(parts), shapely.from_wkt(stored["outline"]), FRAME)


@pytest.mark.parametrize("path", ROOFS, ids=lambda path: path.parent.name)
def test_roof_becomes_a_valid_solid(path):
    assert check_solid(compose(read_roof(path), -2.0)) == ()
