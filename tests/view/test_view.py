"""`hiproof view`: the page as headless Chromium shows it, and who is served what."""

import errno
import http.client
import json
import os
import re
import shutil
import subprocess
import threading
import warnings
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from hiproof.cli.convert import convert
from hiproof.cli.evaluate import evaluate
from hiproof.cli.report import report
from hiproof.cli.view import open_tiles
from hiproof.errors import HiproofError, InputError, InputWarning, OutputError
from hiproof.loopback import LOOPBACK, LoopbackServer
from hiproof.view.server import ViewHandler, make_server, render_page
from hiproof.write import files
from hiproof.write.colours import SUN_STOPS, UNKNOWN_COLOUR, page_colours, srgb
from hiproof.write.meshes.tiles import write_models
from hiproof.write.meshes.viewed import ViewedModel
from pages import BROWSER, needs_browser
from sample_models import ORIGIN, SOLIDS, two_parts, write_sample_run

WAIT = """<script>
// Painting by hand: a page that nobody looks at is asked for no frame while the machine is busy.
async function settled() {
  do { await new Promise(done => setTimeout(done, 50)); scene.paint(); } while (scene.loading);
}
</script>"""
UNTIL_SETTLED = WAIT + "<script>ready.then(() => scene && settled());</script>"
ACT = (
    WAIT
    + """<script>
const faults = [], say = {}, told = () => document.getElementById("details").innerText;
window.addEventListener("error", event => faults.push(String(event.message)));
for (const level of ["error", "warn"]) console[level] = (...texts) => faults.push(texts.join(" "));
HTMLCanvasElement.prototype.setPointerCapture = () => {};  // knows no pointers that scripts invent
function click([x, y]) {
  const box = scene.canvas.getBoundingClientRect();
  for (const kind of ["pointerdown", "pointerup"]) scene.canvas.dispatchEvent(
    new PointerEvent(kind,
      { clientX: box.left + x, clientY: box.top + y, button: 0, buttons: 1, pointerId: 1 }));
}
(async () => {
  await ready; await settled();
  say.webgl = Boolean(scene.gl); say.tiles = scene.layers.length;
  say.legend = document.getElementById("legend").innerText;
  const { corners, owner } = scene.layers[0].tile, row = owner.length - 1;
  // of the first building's roof
  const top = [0, 1, 2].map(k => (corners[k] + corners[3 + k] + corners[6 + k]) / 3);
  click(scene.project(top)); say.clicked = told();
  click([2, scene.canvas.clientHeight - 2]); say.kept = told();
  document.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape" })); say.cleared = told();
  scene.target[0] += 1e6; scene.paint();
  say.away = scene.layers.filter(layer => layer.visible).length;
  document.dispatchEvent(new KeyboardEvent("keydown", { key: "Home" })); scene.paint();
  say.home = scene.layers.filter(layer => layer.visible).length;
  say.faults = faults;
  document.body.append(Object.assign(document.createElement("pre"),
    { id: "said", textContent: JSON.stringify(say) }));
})();
</script>"""
)


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


@pytest.fixture
def serving():
    """Serves what a server says in a thread; its address."""
    servers = []

    def start(server):
        servers.append(server)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        return server.server_address[1]

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


def answer(port, path, host=None):
    connection = http.client.HTTPConnection(LOOPBACK, port, timeout=20)
    connection.request("GET", path, headers={"Host": host} if host else {})
    response = connection.getresponse()
    return response.status, response.read()


def render_document(page, folder, serving, profile):
    """The page over the tiles in `folder` after its scripts ran, as text."""
    port = serving(LoopbackServer(partial(ViewHandler, directory=str(folder), page=page)))
    command = [
        BROWSER,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
    ]
    command += ["--enable-unsafe-swiftshader", "--no-proxy-server", f"--user-data-dir={profile}"]
    command += [
        "--window-size=900,700",
        "--virtual-time-budget=60000",
        "--dump-dom",
        f"http://{LOOPBACK}:{port}/",
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=120).stdout


@needs_browser
def test_the_page_shows_the_tiles_and_tells_of_a_building_clicked(tiles, serving, tmp_path):
    page = render_page("a <run>").replace("</body>", ACT + "</body>")
    text = render_document(page, tiles, serving, tmp_path / "profile")
    answer = re.search(r'<pre id="said">(.*?)</pre>', text, re.DOTALL)
    assert answer, f"the page's scripts did not run to their end: {text[-2000:]}"
    say = json.loads(answer[1].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))
    assert say["faults"] == [] and say["webgl"] and say["tiles"] == 1
    # of all parts, the most frequent first
    assert say["legend"].split() == ["gable", "flat", "hip"]
    assert re.search(r"id\s+house-1", say["clicked"]) and re.search(
        r"rf_slope\s+36.87", say["clicked"]
    )
    assert (
        re.search(r"part 0\s+gable: width 8.12", say["clicked"]) and "unknown" not in say["clicked"]
    )
    # a click beside the buildings changes nothing
    assert say["kept"] == say["clicked"] and say["cleared"] == ""
    assert say["away"] == 0 and say["home"] == 1


SUN = (
    WAIT
    + """<script>
(async () => {
  await ready; await settled();
  const mode = document.getElementById("mode"), say = {}, [{ tile }] = scene.layers;
  const choose = value => { mode.value = value; mode.dispatchEvent(new Event("change")); };
  const painted = () => {
    const colours = scene.coloursOf(tile), seen = {};
    tile.owner.forEach((row, t) => {
      const shown = Array.from(colours.subarray(12 * t, 12 * t + 3), v => v / tile.light[t]);
      (seen[row] ||= {})[tile.isRoof[t] ? "roof" : "other"] = shown;
    });
    return seen;
  };
  say.hidden = document.getElementById("colour-by").hidden;
  say.types = painted(); choose("sun"); say.sun = painted();
  say.legend = document.getElementById("legend").innerText;
  choose("type"); say.back = painted();
  document.body.append(Object.assign(document.createElement("pre"),
    { id: "said", textContent: JSON.stringify(say) }));
})();
</script>"""
)


def ask_page(models, script, serving, folder):
    """What a script at the end of the page says of models."""
    with pytest.warns(UserWarning, match="no CRS"):
        write_models(folder / "a.3dtiles", models)
    page = render_page("run").replace("</body>", script + "</body>")
    text = render_document(page, folder / "a.3dtiles", serving, folder / "profile")
    answer = re.search(r'<pre id="said">(.*?)</pre>', text, re.DOTALL)
    assert answer, f"the page's scripts did not run to their end: {text[-2000:]}"
    return json.loads(answer[1])


@needs_browser
def test_roofs_have_the_colours_of_the_sun_where_it_is_known(serving, tmp_path):
    areas = {"hiproof_flat_roof_area_m2": 20.0, "hiproof_sloped_roof_area_m2": 60.0}
    suns = [90.0 * 1000, None, 80.0 * 400]  # kWh, as a table has them
    sky = {"hiproof_sun_sky": "clear sky"}
    models = [
        ViewedModel(id, kind, solid, {**areas, **sky, "hiproof_roof_sun_kwh": sun}, {0: kind})
        for (id, (kind, solid)), sun in zip(SOLIDS.items(), suns, strict=False)
    ]
    say = ask_page(models, SUN, serving, tmp_path)
    assert not say["hidden"] and say["back"] == say["types"] != say["sun"]
    assert "from 800 kWh/m² (clear sky)" in say["legend"]
    colours = [colour for least, colour in SUN_STOPS if least == 1100.0] + [UNKNOWN_COLOUR]
    for row, colour in enumerate(colours[: len(models)]):
        rgb = 255 * np.array(srgb(colour))
        assert np.allclose(say["sun"][str(row)]["roof"], rgb, atol=2.0)
        assert say["sun"][str(row)]["other"] == say["types"][str(row)]["other"]


@needs_browser
def test_roofs_have_the_colours_of_an_update_where_one_is_told(serving, tmp_path):
    changes = [{"hiproof_change": "changed"}, {}, {"hiproof_change": "uncertain"}]
    models = [
        ViewedModel(id, kind, solid, told, {0: kind})
        for (id, (kind, solid)), told in zip(SOLIDS.items(), changes, strict=False)
    ]
    say = ask_page(models, SUN.replace('"sun"', '"change"'), serving, tmp_path)
    expected = [told.get("hiproof_change") for told in changes[: len(models)]]
    named = {name for name in expected if name} | {"unchanged"}
    assert set(say["legend"].split()) == named and say["back"] == say["types"]
    for row, name in enumerate(expected):
        rgb = 255 * np.array(srgb(page_colours()["change"][name or "unchanged"]))
        assert np.allclose(say["sun"][str(row)]["roof"], rgb, atol=2.0)


@needs_browser
def test_tiles_that_cannot_be_read_are_said(tiles, serving, tmp_path):
    shutil.copytree(tiles, tmp_path / "broken")
    (tmp_path / "broken/tiles/r.glb").unlink()
    page = render_page("run").replace("</body>", UNTIL_SETTLED + "</body>")
    folder = tmp_path / "broken"
    text = render_document(page, folder, serving, tmp_path / "first")
    assert "Some tiles cannot be read (tiles/r.glb: 404)" in text
    (folder / "tileset.json").unlink()
    assert "is hiproof view still running" in render_document(
        page, folder, serving, tmp_path / "second"
    )


def test_page_and_tiles_are_served(tiles, serving):
    port = serving(make_server(tiles, "a <run>"))
    status, page = answer(port, "/")
    assert (
        status == 200
        and b"a &lt;run&gt;" in page
        and b"http" not in page.replace(b"http://www.w3.org", b"")
    )
    assert json.loads(answer(port, "/tileset.json")[1])["asset"]["version"] == "1.1"
    assert answer(port, "/tiles/r.glb")[1][:4] == b"glTF"


def test_a_port_that_is_taken_is_told(tiles, serving):
    port = serving(make_server(tiles, "run"))
    with pytest.raises(InputError, match="leave --port out"):
        make_server(tiles, "run", port)


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


def test_a_folder_of_neither_is_refused(tmp_path):
    with pytest.raises(HiproofError, match="hiproof reconstruct"), open_tiles(tmp_path):
        pass


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
