"""The figures of roof types: every parameter is drawn, as long as it is, and the documents hold
what the code draws.
"""

import importlib
import re

import numpy as np
import pytest

from hiproof.draw.primitives import (
    make_typical_building,
    measures,
    primitive_svg,
    typical_parameters,
)
from hiproof.primitives import CATALOGUE
from hiproof.primitives.parameters import list_parameters

draw = importlib.import_module("docs.draw_primitives")
LEVEL = 1e-9


@pytest.mark.parametrize("kind", CATALOGUE)
def test_every_parameter_is_drawn_as_long_as_it_is(kind):
    parameters, lengths = typical_parameters(kind), measures(kind)
    assert [m.name for m in lengths] == list(list_parameters(kind)) == list(parameters)
    for measure in lengths:
        if measure.end is not None:
            assert measure.length == pytest.approx(abs(parameters[measure.name]), abs=LEVEL), (
                measure.name
            )
        assert f">{measure.name}" in primitive_svg(kind)


@pytest.mark.parametrize("kind", [name for name in CATALOGUE if name not in ("flat", "shed")])
def test_heights_are_drawn_where_the_roof_is(kind):
    roof = make_typical_building(kind).roof
    top = next(m for m in measures(kind) if m.name == "height")
    low, high = np.array(roof.outline.bounds).reshape(2, 2)
    inside = np.clip(top.end[None, :2], low + 0.001, high - 0.001)
    assert roof.height_at(inside)[0] == pytest.approx(top.end[2], abs=2e-3)
    assert top.start[2] == 0.0


def test_the_documents_figures_are_current():
    assert (draw.FOLDER.parent / "primitives.md").read_text() == draw.make_page()
    for kind in CATALOGUE:
        assert (draw.FOLDER / f"{kind}.svg").read_text() == primitive_svg(kind)
    assert sorted(path.stem for path in draw.FOLDER.iterdir()) == sorted(CATALOGUE)


def test_figures_ask_nothing_of_the_network():
    assert not any(re.search(r"href|url\(|<script", primitive_svg(kind)) for kind in CATALOGUE)
