"""Pictures of models: a notebook's view asks nothing of the network and turns, a plot shows points
where they are.
"""

import importlib
import re

import numpy as np
import pytest

import hiproof
from hiproof.draw.html import VIEW_SIZE
from hiproof.draw.primitives import (
    make_typical_building,
    measures,
    primitive_svg,
    typical_parameters,
)
from hiproof.draw.view import choose_turn, list_colours, project_points, select_seen_faces
from hiproof.errors import InputError
from hiproof.primitives import CATALOGUE
from hiproof.primitives.parameters import list_parameters
from hiproof.status import Status
from parametric_house import gable_house


@pytest.fixture(scope="module")
def house():
    return gable_house()


def test_the_view_is_whole_and_asks_nothing_of_the_network(house):
    html = house._repr_html_()
    assert html.count("<path") >= 3 and "height 3.00 m" in html and "<b>a</b>" in html
    assert not re.search(r"https?://|src=|@import|url\(", html)
    assert len(html) < 8000
    assert house._repr_html_() == html


def test_a_building_without_a_model_says_why():
    html = hiproof.Building("<script>", Status.NO_POINTS)._repr_html_()
    assert "no usable points" in html and "<svg" not in html and "<script>" not in html


def test_faces_seen_are_those_that_look_here(house):
    from_above = select_seen_faces(house.solid, list_colours(house), tilt_deg=90.0)
    assert [face.is_roof for face in from_above] == [True, True]
    assert (
        len(select_seen_faces(house.solid, list_colours(house))) == 4
    )  # two slopes, one wall each way


@pytest.mark.parametrize("rotation", [0.0, 37.0, 125.0, -80.0])
def test_a_building_is_seen_from_the_same_corner_whichever_way_it_stands(house, rotation):
    turned = gable_house(rotation)
    assert choose_turn(turned) == pytest.approx(choose_turn(house) - rotation)
    pages = [
        np.sort(
            project_points(b.solid.vertices - b.solid.vertices.mean(axis=0), choose_turn(b), 35.0)[
                :, :2
            ],
            axis=0,
        )
        for b in (house, turned)
    ]
    assert np.allclose(*pages, atol=1e-3)


def test_north_is_up_from_above():
    page = project_points(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]), 0.0, 90.0)
    assert np.allclose(page[:, :2], [[0.0, -1.0], [1.0, 0.0]])


def test_a_plot_tells_near_points_from_far_ones(house):
    pytest.importorskip("matplotlib", reason="plots need matplotlib (extra `report`)").use("Agg")
    xy = np.random.default_rng(0).uniform((-5.0, -3.0), (5.0, 3.0), (40, 2))
    local = np.column_stack([xy, house.roof.height_at(xy)])
    local[:10, 2] += 1.0
    axes = hiproof.plot(house, house.roof.frame.to_world(local))
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["within 0.2 m: 30 points", "further: 10 points"]
    # `reconstruct` leaves it out
    unknown = np.vstack([house.roof.frame.to_world(local), [[np.nan, 0.0, 0.0]]])
    assert hiproof.plot(house, unknown).get_xlim() == axes.get_xlim()
    with pytest.raises(InputError, match=r"shape \(n, 3\), got \(40, 2\)"):
        hiproof.plot(house, xy)
    with pytest.raises(InputError, match="with a model"):
        hiproof.plot(hiproof.Building("b", Status.NO_POINTS))


@pytest.mark.parametrize("turn", range(0, 360, 30))
@pytest.mark.parametrize(("width", "height"), [(60.0, 3.0), (4.0, 80.0), (10.0, 8.0)])
def test_the_view_frames_a_building_whichever_way_it_turns(width, height, turn):
    """A hall, a tower and a house: no corner lies beyond the picture."""
    tall = gable_house(float(turn), width=width, length=2 * width, eave=height)
    drawn = re.findall(r'<path d="([^"]+)"', tall._repr_html_())
    numbers = [float(number) for path in drawn for number in re.findall(r"-?\d+\.\d", path)]
    corners = np.abs(np.reshape(numbers, (-1, 2)))
    assert (corners.max(axis=0) < np.array(VIEW_SIZE) / 2).all()


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
