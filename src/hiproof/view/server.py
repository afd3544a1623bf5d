"""A page that shows 3D Tiles, served to this machine's browser alone; it asks nothing of the network."""

from __future__ import annotations

import json
from functools import partial
from html import escape
from http.server import SimpleHTTPRequestHandler
from importlib.resources import files
from pathlib import Path

from ..loopback import LoopbackServer, own_hosts
from ..write.colours import type_colours

ASSETS = {
    "style": ("hiproof.view", "view.css"),
    "viewer": ("hiproof.evaluate", "viewer.js"),
    "tiles": ("hiproof.view", "tiles.js"),
    "page": ("hiproof.view", "page.js"),
    "html": ("hiproof.view", "view.html"),
}


def server_of(tileset: Path, title: str, port: int = 0) -> LoopbackServer:
    """A server of the page at `/` and of the files of the folder `tileset`; 0 is any free `port`.

    Raises InputError where the port is taken.
    """
    return LoopbackServer(partial(Handler, directory=str(tileset), page=page_of(title)), port)


def page_of(title: str) -> str:
    """The page as text, scripts and styles in it."""
    texts = {name: (files(package) / "assets" / file).read_text("utf-8") for name, (package, file) in ASSETS.items()}
    content = {
        "title": escape(title),
        "style": texts["style"],
        "colours": json.dumps(type_colours()),
        "script": texts["viewer"] + texts["tiles"] + texts["page"],
    }
    page = texts["html"]
    for name, text in content.items():
        page = page.replace(f"<!--{name}-->", text)
    return page


class Handler(SimpleHTTPRequestHandler):
    """Serves the page and a folder, only to those who call this machine by its own name."""

    server: LoopbackServer

    def __init__(self, *args, page: str, **named) -> None:
        self.page = page.encode()
        super().__init__(*args, **named)

    def do_GET(self) -> None:
        if self.headers.get("Host") not in own_hosts(self.server.server_port):
            self.send_error(403)
        elif self.path in ("/", "/index.html"):
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(self.page)))
            self.end_headers()
            self.wfile.write(self.page)
        else:
            super().do_GET()

    def end_headers(self) -> None:
        self.send_header("Cache-Control", "no-cache")
        super().end_headers()

    def log_message(self, *args) -> None:
        """Say nothing: a terminal full of requests helps nobody."""
