"""A page that shows 3D Tiles, served to this machine's browser alone, without network."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from functools import partial
from html import escape
from pathlib import Path
from urllib.parse import unquote, urlsplit

from ..data_files import fill_page, read_asset
from ..loopback import HTML, SAFE, Answer, LoopbackHandler, LoopbackServer
from ..write.colours import page_colours

# Of a file or folder of tiles: no drive, no way up, nothing hidden.
TILE_FILE_NAME = re.compile(r"[\w-][\w.-]{0,200}", re.ASCII)
NO_SOURCE = "'none'"
CONTENT_TYPES = {".json": "application/json", ".glb": "model/gltf-binary"}

VIEW_ASSETS = {
    "common": "evaluate/assets/page.css",
    "style": "view/assets/view.css",
    "viewer": "evaluate/assets/viewer.js",
    "tiles": "view/assets/tiles.js",
    "page": "view/assets/page.js",
    "html": "view/assets/view.html",
}


def make_server(tileset: Path, title: str, port: int = 0) -> LoopbackServer:
    """Make a server of the page and folder `tileset`; `port` 0 is any; InputError if taken."""
    return LoopbackServer(
        partial(ViewHandler, directory=str(tileset), page=render_page(title)), port
    )


def render_page(title: str) -> str:
    """Return the page as text, with its scripts and styles."""
    texts = {name: read_asset(place) for name, place in VIEW_ASSETS.items()}
    content = {
        "title": escape(title),
        "style": texts["common"] + texts["style"],
        "colours": json.dumps(page_colours()),
        "script": texts["viewer"] + texts["tiles"] + texts["page"],
    }
    return fill_page(texts["html"], content)


def make_policy(page: str) -> str:
    """Return the Content-Security-Policy of a page.

    It lets the page run the scripts and styles that stand in it, and no other.

    >>> make_policy("<style>a</style>")[:91]
    "default-src 'none'; script-src 'none'; style-src 'sha256-ypeBEsobvcr6wjGzmiPcTaeG7/gUfE5yuY"
    """
    sources = {
        kind: " ".join(
            f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
            for text in re.findall(rf"<{kind}>(.*?)</{kind}>", page, re.DOTALL)
        )
        for kind in ("script", "style")
    }
    policy = SAFE["Content-Security-Policy"]
    for kind, digests in sources.items():
        policy = policy.replace(f"{kind}-src 'self'", f"{kind}-src {digests or NO_SOURCE}")
    return policy


class ViewHandler(LoopbackHandler):
    """Serves the page and the files of a folder, and nothing outside it, not even lists."""

    def __init__(self, *args, directory: str, page: str, **named) -> None:
        self.folder, self.page, self.policy = (
            Path(directory).resolve(),
            page.encode(),
            make_policy(page),
        )
        super().__init__(*args, **named)

    def answer(self, method: str, body: bytes) -> Answer:
        if method != "GET":
            return self.refuse(405, "expected GET: this page only shows")
        path = urlsplit(self.path).path
        if path in ("/", "/index.html"):
            return Answer(200, self.page, HTML, {"Content-Security-Policy": self.policy})
        file = file_at(self.folder, path)
        if file is None:
            return self.refuse(404, "expected a file of the tiles, got another name")
        return Answer(
            200, file.read_bytes(), CONTENT_TYPES.get(file.suffix, "application/octet-stream")
        )


def file_at(folder: Path, path: str) -> Path | None:
    """Return the file below `folder` that an address names, None where there is none."""
    names = unquote(path).split("/")[1:]
    if not all(TILE_FILE_NAME.fullmatch(name) for name in names):
        return None
    file = folder.joinpath(*names).resolve()
    return file if file.is_file() and file.is_relative_to(folder) else None
