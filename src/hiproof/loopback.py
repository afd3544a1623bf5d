"""Pages for one person at this machine: a server at the loopback address, and the names under which it may be called."""

from __future__ import annotations

from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from .errors import InputError

LOOPBACK = "127.0.0.1"


class LoopbackServer(ThreadingHTTPServer):
    """Listens at the loopback address alone; `port` 0 is any that is free. Raises InputError where the port is taken."""

    daemon_threads = True

    def __init__(self, handler: Callable[..., BaseHTTPRequestHandler], port: int = 0) -> None:
        try:
            super().__init__((LOOPBACK, port), handler)
        except (OSError, OverflowError) as error:
            raise InputError(f"expected a free port, got {port}: {error}; leave --port out to get any") from error

    @property
    def address(self) -> str:
        return f"http://{LOOPBACK}:{self.server_port}/"


def own_hosts(port: int) -> set[Any]:
    """What a request's Host may be: a site elsewhere that gives its own name this machine's address has another.

    >>> sorted(own_hosts(8000))
    ['127.0.0.1:8000', 'localhost:8000']
    """
    names = (LOOPBACK, "localhost")
    return {f"{name}:{port}" for name in names} | (set(names) if port == 80 else set())  # which browsers leave out
