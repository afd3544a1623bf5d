"""Draw the picture of the page of `hiproof edit`, as Chromium shows it.

The building is one of the bundled neighbourhood.

python docs/draw_edit.py [OUT.png]

Needs playwright and Chromium.
"""

import shutil
import sys
import tempfile
import threading
from pathlib import Path

from playwright.sync_api import sync_playwright

from hiproof import Request, reconstruct_area
from hiproof.edit.desk import Desk
from hiproof.edit.server import Server, Service
from hiproof.simulate import demo_files

FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--disable-background-networking",
    "--enable-unsafe-swiftshader",
]
SIZE = {"width": 1360, "height": 820}


def draw(service: Service, path: Path) -> None:
    """Draw the page with its building of most parts.

    Every type is tried on the first part.
    """
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        page = browser.new_page(viewport=SIZE)
        page.goto(service.address)
        page.evaluate("() => queue")
        records = [service.desk.record(row.id)[0] for row in service.desk.run.rows]
        largest = max(records, key=lambda record: len(record["parts"]))
        page.evaluate("id => inTurn(() => open(id))", largest["id"])
        page.keyboard.press("t")
        page.evaluate("() => queue")
        page.fill("#note", "ridge as surveyed")
        page.wait_for_timeout(500)
        page.screenshot(path=path)
        browser.close()


def main(path: Path) -> None:
    files = demo_files()
    with tempfile.TemporaryDirectory() as folder:
        inputs = (
            (str(files["cloud"]),),
            Path(folder),
            str(files["footprints"]),
            str(files["terrain"]),
        )
        reconstruct_area(Request(*inputs))
        service = Service(Desk(Path(folder), "anna"))
        with Server(service) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            draw(service, path)
            server.shutdown()


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_name("edit.png")))
