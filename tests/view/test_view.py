"""`hiproof view`: the page as Chromium shows it, and who is served what."""

import errno
import json
import os
import re
import shutil
import warnings
from contextlib import contextmanager
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest

import pages
from hiproof.cli.convert import convert
from hiproof.cli.evaluate import evaluate
from hiproof.cli.report import report
from hiproof.cli.view import open_tiles
from hiproof.errors import InputError, InputWarning, OutputError
from hiproof.view.server import make_server
from hiproof.write import files
from hiproof.write.colours import SUN_STOPS, UNKNOWN_COLOUR, page_colours, srgb
from hiproof.write.meshes.tiles import write_models
from hiproof.write.meshes.viewed import ViewedModel
from pages import needs_browser
from sample_models import ORIGIN, SOLIDS, two_parts, write_sample_run

# of a layer's first roof, in the canvas
TOP = """() => { const { corners } = scene.layers[0].tile;
  return scene.project([0, 1, 2].map(k => (corners[k] + corners[3 + k] + corners[6 + k]) / 3)); }"""
VISIBLE = "() => { scene.paint(); return scene.layers.filter(layer => layer.visible).length; }"
# the colour of each building's roof, and of all else
PAINTED = """() => {
  const [{ tile }] = scene.layers, colours = scene.coloursOf(tile), seen = {};
  tile.owner.forEach((row, t) => {
    const shown = Array.from(colours.subarray(12 * t, 12 * t + 3), v => v / tile.light[t]);
    (seen[row] ||= {})[tile.isRoof[t] ? "roof" : "other"] = shown;
  });
  return seen;
}"""


def parameters(*kinds):
    """What is told of a roof of parts of these types."""
    return json.dumps({"parts": [{"type": kind, "parameters": {"width": 8.123}} for kind in kinds]})


@pytest.fixture(scope="module")
def tiles(tmp_path_factory):
    folder = tmp_path_factory.mktemp("view") / "a.3dtiles"
    models = [
        ViewedModel(
            id,
            kind,
            solid,
            {"parameters": parameters(kind), "rf_slope": 36.87, "unknown": None},
            {0: kind},
        )
        for id, (kind, solid) in SOLIDS.items()
    ]
    pair = two_parts()
    neighbour = pair.solid.move(np.array([0, 20, 0]) - ORIGIN)
    models.append(
        pair._replace(solid=neighbour, attributes={"parameters": parameters("gable", "hip")})
    )
    with pytest.warns(UserWarning, match="no CRS"):
        write_models(folder, models)
    return folder


@contextmanager
def view(browser, tiles):
    with (
        pages.serve(make_server(tiles, "a <run>")) as server,
        pages.open_page(browser, server.address) as page,
    ):
        yield page


@needs_browser
def test_the_page_shows_the_tiles_and_tells_of_a_building_clicked(browser, tiles):
    with view(browser, tiles) as page:
        page.evaluate(pages.SETTLE)
        assert page.evaluate("[Boolean(scene.gl), scene.layers.length]") == [True, 1]
        # of all parts, the most frequent first
        assert page.inner_text("#legend").split() == ["gable", "flat", "hip"]
        x, y = page.evaluate(TOP)
        page.click("#scene", position={"x": x, "y": y})
        told = page.inner_text("#details")
        for words in (r"id\s+house-1", r"rf_slope\s+36.87", r"part 0\s+gable: width 8.12"):
            assert re.search(words, told)
        assert "unknown" not in told
        # a click beside the buildings changes nothing
        height = page.evaluate("scene.canvas.clientHeight")
        page.click("#scene", position={"x": 2, "y": height - 2})
        assert page.inner_text("#details") == told
        page.evaluate("document.activeElement.blur()")  # keys count wherever the focus is
        page.keyboard.press("Escape")
        assert page.inner_text("#details") == ""
        page.evaluate("() => { scene.target[0] += 1e6; }")
        assert page.evaluate(VISIBLE) == 0
        page.keyboard.press("Home")
        assert page.evaluate(VISIBLE) == 1


def colour(browser, folder, values, mode):
    """Show the sample with attributes: the legend, and the colours by type, by `mode` and by type
    again.
    """
    models = [
        ViewedModel(id, kind, solid, attributes, {0: kind})
        for (id, (kind, solid)), attributes in zip(SOLIDS.items(), values, strict=True)
    ]
    with pytest.warns(UserWarning, match="no CRS"):
        write_models(folder, models)
    with view(browser, folder) as page:
        page.evaluate(pages.SETTLE)
        assert not page.evaluate("document.getElementById('colour-by').hidden")
        colours = [page.evaluate(PAINTED)]
        page.select_option("#mode", mode)
        colours.append(page.evaluate(PAINTED))
        legend = page.inner_text("#legend")
        page.select_option("#mode", "type")
        return legend, *colours, page.evaluate(PAINTED)


@needs_browser
def test_roofs_have_the_colours_of_the_sun_where_it_is_known(browser, tmp_path):
    known = {"hiproof_flat_roof_area_m2": 20.0, "hiproof_sloped_roof_area_m2": 60.0}
    known["hiproof_sun_sky"] = "clear sky"
    # kWh, as a table has them
    values = [known | {"hiproof_roof_sun_kwh": sun} for sun in (90.0 * 1000, None)]
    legend, types, suns, again = colour(browser, tmp_path / "a.3dtiles", values, "sun")
    assert again == types != suns and "from 800 kWh/m² (clear sky)" in legend
    expected = [colour for least, colour in SUN_STOPS if least == 1100.0] + [UNKNOWN_COLOUR]
    for row, name in enumerate(expected):
        assert np.allclose(suns[str(row)]["roof"], 255 * np.array(srgb(name)), atol=2.0)
        assert suns[str(row)]["other"] == types[str(row)]["other"]


@needs_browser
def test_roofs_have_the_colours_of_an_update_where_one_is_told(browser, tmp_path):
    values = [{"hiproof_change": "changed"}, {}]
    legend, types, changes, again = colour(browser, tmp_path / "a.3dtiles", values, "change")
    assert set(legend.split()) == {"changed", "unchanged"} and again == types
    for row, name in enumerate(("changed", "unchanged")):
        rgb = 255 * np.array(srgb(page_colours()["change"][name]))
        assert np.allclose(changes[str(row)]["roof"], rgb, atol=2.0)


@needs_browser
def test_tiles_that_cannot_be_read_are_said(browser, tiles, tmp_path):
    folder = shutil.copytree(tiles, tmp_path / "broken")
    for file, message in (
        ("tiles/r.glb", "Some tiles cannot be read (tiles/r.glb: 404)"),
        ("tileset.json", "is hiproof view still running"),
    ):
        (folder / file).unlink()
        with view(browser, folder) as page:
            said = page.get_by_text(message)
            said.wait_for()
            assert said.is_visible()


def test_page_and_tiles_are_served_at_a_port_of_their_own(tiles):
    with pages.serve(make_server(tiles, "a <run>")) as server:
        page, tileset, tile = (
            urlopen(server.address + name, timeout=20).read()
            for name in ("", "tileset.json", "tiles/r.glb")
        )
        with pytest.raises(InputError, match="leave --port out"):
            make_server(tiles, "run", server.server_port)
    assert b"a &lt;run&gt;" in page and b"http" not in page.replace(b"http://www.w3.org", b"")
    assert json.loads(tileset)["asset"]["version"] == "1.1" and tile[:4] == b"glTF"


def test_tiles_of_a_run_are_made_once_and_again_when_it_changed(tmp_path, capsys):
    write_sample_run(tmp_path)
    with warnings.catch_warnings():  # heights over the globe matter to no picture
        warnings.simplefilter("error", InputWarning)
        with open_tiles(tmp_path) as folder:
            pass
    with open_tiles(tmp_path) as folder:
        time_made = (folder / "tileset.json").stat().st_mtime_ns
    with open_tiles(tmp_path) as second:
        assert second == folder and (folder / "tileset.json").stat().st_mtime_ns == time_made
    os.utime(tmp_path / "buildings.city.jsonl", (time_made / 1e9 + 10, time_made / 1e9 + 10))
    with open_tiles(tmp_path) as third:
        assert (third / "tileset.json").stat().st_mtime_ns > time_made
    with open_tiles(folder) as first:
        assert first == folder


def refuse_writing_below(folder, monkeypatch):
    """Make `folder` part of a read-only file system, as far as our writers see."""
    read_only = OSError(errno.EROFS, os.strerror(errno.EROFS))

    def make_refusing(function):
        def call(path, *args, **named):
            if Path(path).is_relative_to(folder):
                raise read_only
            return function(path, *args, **named)

        return call

    for name in ("mkdir", "unlink", "rename"):
        monkeypatch.setattr(Path, name, make_refusing(getattr(Path, name)))
    opened = files.OutputFile.__init__
    monkeypatch.setattr(
        files.OutputFile,
        "__init__",
        lambda file, hidden, path: make_refusing(open_at)(hidden, file, path),
    )

    def open_at(hidden, file, path):
        opened(file, hidden, path)


@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
def test_a_run_that_cannot_be_written_is_shown_all_the_same(tmp_path, monkeypatch, caplog):
    write_sample_run(tmp_path / "run")
    refuse_writing_below(tmp_path / "run", monkeypatch)
    with open_tiles(tmp_path / "run") as tiles:
        assert json.loads((tiles / "tileset.json").read_text())["asset"]["version"] == "1.1"
        assert not tiles.is_relative_to(tmp_path)
    assert not tiles.exists()
    assert "read-only" in caplog.text and "temporary folder" in caplog.text


@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
def test_other_commands_say_how_to_write_elsewhere(tmp_path, monkeypatch):
    write_sample_run(tmp_path / "run")
    cloud = tmp_path / "points.xyz"
    cloud.write_text("85000.0 446000.0 5.0\n85001.0 446000.0 5.0\n")
    refuse_writing_below(tmp_path / "run", monkeypatch)
    for call, message in (
        (lambda: convert(tmp_path / "run"), "hiproof convert {} OUT"),
        (lambda: report(tmp_path / "run"), "hiproof report {} --out FILE"),
        (lambda: evaluate(tmp_path / "run", [str(cloud)]), "hiproof evaluate {} --out FOLDER"),
    ):
        with pytest.raises(OutputError, match="read-only") as caught:
            call()
        assert message.format(tmp_path / "run") in str(caught.value)
    convert(tmp_path / "run", tmp_path / "a.glb")
    assert (tmp_path / "a.glb").read_bytes()[:4] == b"glTF"
