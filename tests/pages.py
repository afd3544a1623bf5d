"""Pages in a real Chromium, as large as a laptop and a phone: opened, checked, walked through."""

import re
import shutil
import threading
from contextlib import contextmanager

import pytest

# Debian's Chromium first: it needs no download and no other driver
PLACES = ("/usr/bin/chromium", "chromium", "chromium-browser", "google-chrome")
BROWSER = next(filter(None, map(shutil.which, PLACES)), None)
FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--disable-background-networking",
    "--enable-unsafe-swiftshader",
]
SIZES = {"laptop": (1280, 800), "phone": (390, 844)}
WAIT_MS = 60_000

needs_browser = pytest.mark.skipif(
    BROWSER is None, reason="no Chromium here; apt-get install chromium"
)
at_every_size = pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)

FOCUSED = """() => {
  const { activeElement: at } = document, { outlineStyle, outlineWidth } = getComputedStyle(at);
  const name = at.id || at.getAttribute("aria-label") || at.textContent;
  return [name, outlineStyle !== "none" && parseFloat(outlineWidth) >= 2];
}"""

# where the corners of a viewer's scene fall on its canvas, as shares of the canvas
PLACED = """(viewer, corners) => {
  const { clientWidth, clientHeight } = viewer.canvas, placed = [];
  for (let i = 0; i < corners.length; i += 3) {
    const [x, y] = viewer.project(corners.subarray(i, i + 3));
    placed.push([x / clientWidth, y / clientHeight]);
  }
  return placed;
}"""


# until the tiles of a view are there; a page that nobody looks at is asked for no frame
SETTLE = """async () => {
  await ready;
  do { await new Promise(done => setTimeout(done, 50)); scene.paint(); } while (scene.loading);
}"""


@contextmanager
def serve(server):
    """Answer requests in a thread; gives the server."""
    with server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def is_complaint(message):
    """Whether a script says that something is wrong, rather than the browser of its own."""
    of_browser = re.match(r"Failed to load resource|\[\.WebGL", message.text)
    return message.type in ("error", "warning") and not of_browser


@contextmanager
def open_page(browser, address, size=SIZES["laptop"], script=""):
    """A page of a size, whose scripts must neither fail nor complain while it is open; `script`
    runs before them.
    """
    context = browser.new_context(viewport={"width": size[0], "height": size[1]})
    context.add_init_script(script)
    page = context.new_page()
    page.set_default_timeout(WAIT_MS)
    faults = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("console", lambda said: faults.append(said.text) if is_complaint(said) else None)
    page.goto(address)
    yield page
    context.close()
    assert faults == []


def list_complaints(page):
    """What axe-core finds wrong with the page, by rule and element."""
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright",
        reason="no axe-core here; pip install axe-playwright-python",
    )
    violations = axe.Axe().run(page).response["violations"]
    return [(rule["id"], node["html"]) for rule in violations for node in rule["nodes"]]


def list_tab_stops(page, count):
    """The names of what the Tab key reaches from the top, each of which shows its focus."""
    names = []
    for _ in range(count):
        page.keyboard.press("Tab")
        name, is_shown = page.evaluate(FOCUSED)
        assert is_shown, f"{name} does not show its focus"
        names.append(name)
    return names


def is_too_wide(page):
    """Whether the page scrolls sideways."""
    return page.evaluate("() => document.documentElement.scrollWidth > innerWidth")


def project_on_canvas(page, viewer, corners):
    """Where corners of a scene fall, as shares (n, 2) of the canvas; both are expressions."""
    return page.evaluate(f"() => ({PLACED})({viewer}, {corners})")
