"""The desk over HTTP, for one person at this machine.

Whoever asks must know the token in the address, must have reached the loopback address by its name
(so that no foreign name leads here), and must be the page itself where the browser says who asks.
What can be asked is a fixed list; a building is named by its id, which is looked up, never opened.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from ..data_files import read_asset
from ..errors import HiproofError, InputError, OutputError
from ..log import LOGGER
from ..loopback import HTML, LOOPBACK, Answer, Headers, LoopbackHandler, LoopbackServer
from ..primitives.catalogue import CATALOGUE
from ..write.colours import page_colours
from .desk import Desk, render_drawing
from .edits import OtherVersion

JSON = "application/json"
SCRIPT = "text/javascript; charset=utf-8"
STYLE = "text/css; charset=utf-8"
SVG = "image/svg+xml"
EDIT_ASSETS = {
    "": ("edit/assets/edit.html", HTML),
    "page.css": ("evaluate/assets/page.css", STYLE),
    "edit.css": ("edit/assets/edit.css", STYLE),
    "edit.js": ("edit/assets/edit.js", SCRIPT),
    "handles.js": ("edit/assets/handles.js", SCRIPT),
    "viewer.js": ("evaluate/assets/viewer.js", SCRIPT),
}


class Service:
    """Answers to requests on `port`, by `answer`, without a socket."""

    def __init__(self, desk: Desk, token: str | None = None) -> None:
        self.desk, self.token, self.port = desk, token or secrets.token_urlsafe(24), 0
        self.read: dict[str, Callable[[Mapping[str, str]], Any]] = {
            "start": lambda q: {
                "folder": str(desk.run.folder),
                "who": desk.who,
                "types": list(CATALOGUE),
                "colours": page_colours(),
                "missing": desk.points.missing,
            },
            "buildings": lambda q: desk.buildings(q.get("find", "")),
            "building": lambda q: desk.building(q.get("id", "")),
            "points": lambda q: desk.cloud(q.get("id", "")),
        }
        self.write = {
            "change": desk.change,
            "alternatives": desk.alternatives,
            "accept": desk.accept,
            "withdraw": desk.withdraw,
        }

    @property
    def address(self) -> str:
        return f"http://{LOOPBACK}:{self.port}/{self.token}/"

    def answer(self, method: str, target: str, headers: Headers, body: bytes = b"") -> Answer:
        """Return the answer to a request; to a wrong one it is a sentence, no traceback."""
        try:
            refused = self.refusal(method, target, headers)
            if refused is not None:
                return refused
            split = urlsplit(target)
            name = split.path.removeprefix(f"/{self.token}/")
            query = {
                key: values[-1]
                for key, values in parse_qs(split.query, keep_blank_values=True).items()
            }
            return self.asset(name, query) if method == "GET" else self.change(name, body)
        except OtherVersion as error:
            return make_answer(409, str(error), version=error.version)
        except OutputError as error:
            return make_answer(500, str(error))
        except HiproofError as error:
            return make_answer(422, str(error))
        except Exception as error:
            LOGGER.error(
                "failed on %s %s; please report this", method, unquote(target)[-80:], exc_info=True
            )
            return make_answer(
                500,
                f"hiproof failed on this ({type(error).__name__}: {error}); nothing was written",
            )

    def refusal(self, method: str, target: str, headers: Headers) -> Answer | None:
        """Return an answer to those who may not ask, None to those who may."""
        first = urlsplit(target).path.split("/")[1:2]
        if not first or not secrets.compare_digest(first[0].encode(), self.token.encode()):
            return make_answer(
                403,
                "expected the token in the address, got another; use the address that was printed",
            )
        if method == "POST" and headers.get("Content-Type", "").split(";")[0] != JSON:
            return make_answer(415, "expected JSON, got something else")
        return None

    def asset(self, name: str, query: Mapping[str, str]) -> Answer:
        """Return what is read: a file of the page, a figure, or JSON."""
        if name in EDIT_ASSETS:
            place, kind = EDIT_ASSETS[name]
            return Answer(200, read_asset(place).encode(), kind)
        if name == "drawing":
            return Answer(200, render_drawing(query.get("type", "")).encode(), SVG)
        if name not in self.read:
            return make_answer(404, "expected something of this page, got another name")
        return as_json(self.read[name](query))

    def change(self, name: str, body: bytes) -> Answer:
        """Answer a request with a body: {"id": ..., ...}."""
        if name not in self.write:
            return make_answer(404, "expected something of this page, got another name")
        try:
            requested = json.loads(body)
        except (ValueError, RecursionError) as error:
            raise InputError(f"expected JSON, got what cannot be read: {error}") from error
        if not isinstance(requested, dict) or not isinstance(requested.get("id"), str):
            raise InputError("expected an object with the id of a building, got something else")
        return as_json(self.write[name](requested["id"], requested))


def as_json(value: Any, code: int = 200) -> Answer:
    return Answer(code, json.dumps(value, separators=(",", ":"), allow_nan=False).encode(), JSON)


def make_answer(code: int, sentence: str, **more: Any) -> Answer:
    return as_json({"error": sentence, **more}, code)


class EditHandler(LoopbackHandler):
    """A request and its answer; all that decides stands in `Service`."""

    server: Server

    def answer(self, method: str, body: bytes) -> Answer:
        return self.server.service.answer(method, self.path, self.headers, body)

    def refuse(self, code: int, sentence: str) -> Answer:
        return make_answer(code, sentence)


class Server(LoopbackServer):
    """The service at a port. Raises InputError where that is taken."""

    def __init__(self, service: Service, port: int = 0) -> None:
        super().__init__(EditHandler, port)
        self.service, service.port = service, self.server_port
