"""The pages of `hiproof view` and `hiproof report` and the view of a notebook: whole scenes, keys,
and no complaint of axe-core.
"""

import numpy as np
import pytest

from hiproof.cli.view import open_tiles
from hiproof.evaluate.report import write_report
from hiproof.evaluate.run import evaluate_run
from hiproof.view.server import make_server
from pages import (
    SETTLE,
    at_every_size,
    is_too_wide,
    list_complaints,
    list_tab_stops,
    needs_browser,
    open_page,
    project_on_canvas,
    serve,
)
from parametric_house import gable_house
from sample_models import write_scanned_run

pytestmark = [needs_browser, pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")]
FILLED = 0.4  # of the canvas, the least that a scene fills one way: it is whole, but not lost


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_scanned_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def report(folder):
    run = evaluate_run(folder, [str(folder / "points.xyz")])
    write_report(folder / "report.html", run, "a run")
    return (folder / "report.html").as_uri()


@pytest.fixture(scope="module")
def view(folder):
    with open_tiles(folder) as tiles, serve(make_server(tiles, "a run")) as server:
        yield server.address


def is_whole(places):
    """Whether a scene lies in the canvas and fills it."""
    lower, upper = np.min(places, axis=0), np.max(places, axis=0)
    return bool((lower >= 0).all() and (upper <= 1).all() and (upper - lower).max() >= FILLED)


@at_every_size
def test_the_viewer_shows_the_whole_scene_and_axe_finds_nothing(browser, view, size):
    with open_page(browser, view, size) as page:
        page.evaluate(SETTLE)
        assert not is_too_wide(page) and list_complaints(page) == []
        page.evaluate("() => show({ tile: scene.layers[0].tile, row: 0 })")
        assert "house-1" in page.inner_text("#details")
        assert not is_too_wide(page) and list_complaints(page) == []
        for shape in (size, size[::-1]):
            page.set_viewport_size({"width": shape[0], "height": shape[1]})
            page.wait_for_timeout(200)
            for action in ("scene.home()", "scene.turn(2, 0)", "scene.turn(0, 1.5)"):
                page.evaluate(f"() => {{ {action}; }}")
                assert is_whole(project_on_canvas(page, "scene", "scene.layers[0].tile.corners"))


@at_every_size
def test_the_report_shows_a_whole_scene_and_building_and_axe_finds_nothing(browser, report, size):
    with open_page(browser, report, size) as page:
        assert not is_too_wide(page) and list_complaints(page) == []
        for action in ("viewer.home()", "viewer.turn(2, 0)", "viewer.turn(0, 1.5)"):
            page.evaluate(f"() => {{ {action}; }}")
            assert is_whole(project_on_canvas(page, "viewer", "mesh.corners"))
        page.fill("#find", "house-1")
        page.keyboard.press("Enter")
        assert "house-1" in page.inner_text("#details")
        assert not is_too_wide(page) and list_complaints(page) == []
        house = "mesh.corners.filter((_, i) => mesh.owner[Math.floor(i / 9)] === selected)"
        assert is_whole(project_on_canvas(page, "viewer", house))
        page.evaluate("() => viewer.zoom(0.5)")
        assert not is_whole(project_on_canvas(page, "viewer", house))


def test_the_viewer_works_by_keys(browser, view):
    with open_page(browser, view) as page:
        page.evaluate(SETTLE)
        assert list_tab_stops(page, 2) == ["scene", "details-of"]
        page.focus("#scene")
        old_view = page.evaluate("() => [scene.azimuth, scene.elevation, scene.distance]")
        for key in ("ArrowRight", "ArrowDown", "+"):
            page.keyboard.press(key)
        azimuth, elevation, distance = page.evaluate(
            "() => [scene.azimuth, scene.elevation, scene.distance]"
        )
        assert azimuth < old_view[0] and elevation > old_view[1] and distance < old_view[2]
        page.keyboard.press("Home")
        assert page.evaluate("() => scene.distance") == pytest.approx(old_view[2])
        first = "scene.layers[0].tile.corners.subarray(0, 9)"
        page.evaluate(f"() => {{ scene.target = sphereOf({first}).middle; }}")
        page.keyboard.press("Enter")
        assert page.inner_text("#details").split()[:2] == ["id", "house-1"]
        page.keyboard.press("Escape")
        assert page.inner_text("#details") == ""


def test_the_report_works_by_keys(browser, report):
    with open_page(browser, report) as page:
        stops = ["mode", "find", "map", "bare: unknown, no model", "scene", "show-points", "panel"]
        result = list_tab_stops(page, 9)
        assert [name.split(":")[0] for name in result[:7]] == [name.split(":")[0] for name in stops]
        assert result[7:] == ["figures by roof type", "block 2"]
        page.keyboard.press("Enter")
        assert "block 2" in page.inner_text("#details")
        page.focus("#map")
        page.keyboard.press("Home")
        for key, id in (("ArrowRight", "bare"), ("ArrowRight", "house-1"), ("ArrowLeft", "bare")):
            page.keyboard.press(key)
            assert page.inner_text("#details").split()[1] == id


@at_every_size
def test_a_notebook_shows_whole_houses_whichever_way_they_turn(browser, tmp_path, size):
    """By the drawing's own box, from above and aslant; a long low house fits as a tower does."""
    houses = [gable_house(turn) for turn in (0.0, 37.0)]
    body = "".join(house._repr_html_() for house in houses)
    (tmp_path / "a.html").write_text(
        f'<!doctype html><html lang="en"><title>a</title><main><h1>a</h1>{body}</main></html>',
        encoding="utf-8",
    )
    with open_page(browser, (tmp_path / "a.html").as_uri(), size) as page:
        assert list_complaints(page) == []
        assert all(name.startswith("hiproof-") for name in list_tab_stops(page, 2))
        for key in ("ArrowRight", "ArrowDown") * 8:
            page.keyboard.press(key)
            overflow = page.evaluate(
                "() => [...document.querySelectorAll('svg')].map(svg => {"
                "const { x, y, width, height } = svg.getBBox(), box = svg.viewBox.baseVal;"
                "return Math.max(box.x - x, box.y - y, x + width - box.x - box.width,"
                "y + height - box.y - box.height); })"
            )
            assert max(overflow) <= 0
