"""Pages for one person at this machine: a server that decides who may ask, and headers."""

from __future__ import annotations

import io
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from email.message import Message
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, NamedTuple

from .errors import InputError
from .log import LOGGER

LOOPBACK = "127.0.0.1"
# Seconds until a request must be here whole, and until a connection that says nothing is closed.
QUIET_S = 60.0
END_S = 30.0  # seconds that answers on their way get when the server ends
MOST_THREADS = 128  # of this process, each a connection: a browser opens six
MOST_BYTES = 20_000_000  # bytes of a request: many times what any building's parts take
HTML = "text/html; charset=utf-8"
TEXT_TYPE = "text/plain; charset=utf-8"
# Headers of every answer.
SAFE = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src "
    "'self' "
    "data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}

Headers = Mapping[str, str] | Message


class Answer(NamedTuple):
    """An HTTP answer: its code, bytes, their type, and headers in place of those of SAFE."""

    code: int
    body: bytes
    kind: str = TEXT_TYPE
    headers: Mapping[str, str] = {}


class LoopbackServer(ThreadingHTTPServer):
    """A server at the loopback address alone.

    `port` 0 is any that is free. Raises InputError where the port is taken. Closing it waits for
    answers on their way, so that what they write is whole.
    """

    daemon_threads = True

    def __init__(self, handler: Callable[..., BaseHTTPRequestHandler], port: int = 0) -> None:
        self.changed, self.answers, self.is_closing = threading.Condition(), 0, False
        try:
            super().__init__((LOOPBACK, port), handler)
        except (OSError, OverflowError) as error:
            raise InputError(
                f"expected a free port, got {port}: {error}; leave --port out to get any"
            ) from error

    @property
    def address(self) -> str:
        return f"http://{LOOPBACK}:{self.server_port}/"

    def serve_until_stopped(self) -> None:
        """Serve until Ctrl-C, or until the process is asked to end."""
        old_handlers = {
            name: signal.signal(name, stop)
            for name in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM))
        }
        try:
            with suppress(KeyboardInterrupt):
                self.serve_forever()
        finally:
            for name, previous in old_handlers.items():
                signal.signal(name, previous)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Give a connection a thread, unless there are too many."""
        if threading.active_count() > MOST_THREADS:
            self.shutdown_request(request)
        else:
            super().process_request(request, client_address)

    @contextmanager
    def count_answer(self) -> Iterator[None]:
        """Count an answer on its way; none begins once the server closes."""
        with self.changed:
            if self.is_closing:
                raise ConnectionAbortedError
            self.answers += 1
        try:
            yield
        finally:
            with self.changed:
                self.answers -= 1
                self.changed.notify_all()

    def server_close(self) -> None:
        super().server_close()
        with self.changed:
            self.is_closing = True
            self.changed.wait_for(lambda: not self.answers, END_S)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of connections that break; an error of our own goes to the log."""
        if not isinstance(sys.exc_info()[1], OSError):
            LOGGER.error("failed on a request; please report this", exc_info=True)


def stop(*_: Any) -> None:
    raise KeyboardInterrupt


class TimedReader(io.RawIOBase):
    """A socket's reader up to `until` (time.monotonic), however slowly bytes are sent."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection, self.until = connection, 0.0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        remainder = self.until - time.monotonic()
        if remainder <= 0:
            raise TimeoutError("the request took too long")
        self.connection.settimeout(remainder)
        return self.connection.recv_into(buffer)


class LoopbackHandler(BaseHTTPRequestHandler):
    """A handler that sends `answer` to this machine's own pages, and refuses others before."""

    protocol_version = "HTTP/1.1"
    # Without this the body waits until the browser has confirmed the head.
    disable_nagle_algorithm = True
    server: LoopbackServer

    def answer(self, method: str, body: bytes) -> Answer:
        """Return the answer to a request, GET or POST."""
        raise NotImplementedError

    def refuse(self, code: int, sentence: str) -> Answer:
        """Return the answer that says why a request is refused."""
        return Answer(code, sentence.encode())

    def setup(self) -> None:
        super().setup()
        self.timed = TimedReader(self.connection)
        self.rfile = io.BufferedReader(self.timed)

    def handle_one_request(self) -> None:
        self.timed.until = time.monotonic() + QUIET_S
        super().handle_one_request()

    def do_GET(self) -> None:
        if self.headers.get("Content-Length") or self.headers.get("Transfer-Encoding"):
            # Nobody reads that body, which must not be taken for the next request.
            self.close_connection = True
        self.send(self.safe_answer("GET"))

    do_HEAD = do_GET

    def do_POST(self) -> None:
        length = self.headers.get("Content-Length", "")
        is_length = length.isascii() and length.isdigit() and len(length) < len(str(MOST_BYTES)) + 1
        if not is_length or int(length) > MOST_BYTES:
            self.close_connection = True
            text = f"expected a body of at most {MOST_BYTES} bytes, got {length[:20] or 'none'}"
            return self.send(self.refuse(413, text))
        return self.send(self.safe_answer("POST", self.rfile.read(int(length))))

    def safe_answer(self, method: str, body: bytes = b"") -> Answer:
        if reason := refusal(self.headers, self.server.server_port):
            return self.refuse(403, reason)
        if not self.path.startswith("/"):
            return self.refuse(400, "expected a path, got something else")
        with self.server.count_answer():
            return self.answer(method, body)

    def send(self, answer: Answer) -> None:
        self.connection.settimeout(QUIET_S)
        self.send_response(answer.code)
        self.send_header("Content-Type", answer.kind)
        self.send_header("Content-Length", str(len(answer.body)))
        self.own = answer.headers
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(answer.body)

    def end_headers(self) -> None:
        """End every answer's head, errors' too, with headers that keep a page to itself."""
        if self.request_version != "HTTP/0.9":
            for name, value in {**SAFE, **getattr(self, "own", {})}.items():
                self.send_header(name, value)
        super().end_headers()

    def version_string(self) -> str:
        return "hiproof"

    def log_message(self, format: str, *arguments: Any) -> None:
        """Log nothing: requests would fill a terminal, and addresses hold tokens."""


def refusal(headers: Headers, port: int) -> str:
    """Return why a request with these headers is refused, or an empty text.

    A caller must call this machine by its own name, as a page of its own.

    >>> refusal({"Host": "localhost:8000"}, 8000), refusal({"Host": "localhost:8000",
    ...     "Origin": "null"}, 8000)
    ('', 'expected a request of this page, got one of another origin')
    """
    own_hosts = list_own_hosts(port)
    hosts = headers.get_all("Host") if isinstance(headers, Message) else [headers.get("Host")]
    if not hosts or len(hosts) > 1 or hosts[0] not in own_hosts:
        return (
            f"expected a request to {LOOPBACK}, got another host; use the address that was printed"
        )
    origin = headers.get("Origin")
    if origin is not None and origin not in {f"http://{name}" for name in own_hosts}:
        return "expected a request of this page, got one of another origin"
    if headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
        return "expected a request of this page, got one of another site"
    return ""


def list_own_hosts(port: int) -> set[Any]:
    """Return the values that a request's Host may have.

    A site elsewhere that gives its own name this machine's address has another.

    >>> sorted(list_own_hosts(8000))
    ['127.0.0.1:8000', 'localhost:8000']
    """
    names = (LOOPBACK, "localhost")
    # Browsers leave out port 80.
    return {f"{name}:{port}" for name in names} | (set(names) if port == 80 else set())
