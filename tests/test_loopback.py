"""The servers of `hiproof edit` and `hiproof view` over raw sockets, as a hostile page or program
would ask them.
"""

import re
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest

from hiproof import loopback
from hiproof.edit.desk import Desk
from hiproof.edit.server import Server, Service
from hiproof.view.server import make_server
from pages import serve
from sample_parameters import write_parameters_of_each_kind

# both have the server whose waits take a second
one_page = pytest.mark.parametrize("page", ["view"], indirect=True)


@pytest.fixture(params=["edit", "view"])
def page(request, tmp_path, monkeypatch, capfd):
    """(port, path of the page) of a live server; nothing may reach the terminal."""
    monkeypatch.setattr(loopback, "QUIET_S", 0.5)
    if request.param == "edit":
        parameters = write_parameters_of_each_kind(tmp_path / "parameters.jsonl")
        service = Service(Desk(parameters.parent, "anna"))
        server, start = Server(service), f"/{service.token}/"
    else:
        folder = tmp_path / "a.3dtiles"
        (folder / "tiles").mkdir(parents=True)
        (folder / "tileset.json").write_text("{}")
        (folder / ".hidden").write_text("secret")
        (tmp_path / "secret.txt").write_text("secret")
        (folder / "link").symlink_to(tmp_path / "secret.txt")
        server, start = make_server(folder, "run"), "/"
    with serve(server):
        yield server.server_port, start
    output = capfd.readouterr()
    assert output.out + output.err == ""


def send(port, text, wait_s=20.0):
    """What comes back for bytes sent, until the server closes the line."""
    with socket.create_connection(("127.0.0.1", port), timeout=wait_s) as line:
        line.sendall(text)
        answer = b""
        while chunk := line.recv(65536):
            answer += chunk
        return answer


def request(port, target, method="GET", host=None, *more, body=b""):
    lines = [f"{method} {target} HTTP/1.1", f"Host: {host or f'127.0.0.1:{port}'}"]
    return "\r\n".join([*lines, "Connection: close", *more, "\r\n"]).encode("latin-1") + body


KEPT_TO_ITSELF = (
    b"X-Content-Type-Options: nosniff",
    b"frame-ancestors 'none'",
    b"Referrer-Policy: no-referrer",
)


def code(answer):
    return int(re.match(rb"HTTP/1\.1 (\d+) ", answer)[1])


def test_the_page_is_answered_with_headers_that_keep_it_to_itself(page):
    port, start = page
    answer = send(port, request(port, start))
    head, body = answer.split(b"\r\n\r\n", 1)
    assert code(answer) == 200 and b"<html" in body
    assert all(header in head for header in KEPT_TO_ITSELF)
    assert head.count(b"Content-Security-Policy") == 1
    assert b"unsafe" not in head and b"Python" not in head


ELSEWHERE = """%00 ?x .. ../secret.txt ..%2fsecret.txt %2e%2e/secret.txt tiles tiles/ .hidden link
%2fetc%2fpasswd //etc/passwd \xff %ff % tiles/../../secret.txt C:%5Cx a\\b"""


def test_head_is_get_without_a_body(page):
    port, start = page
    for target in (start, start + "missing"):
        head, body = send(port, request(port, target, "HEAD")).split(b"\r\n\r\n", 1)
        whole, _ = send(port, request(port, target)).split(b"\r\n\r\n", 1)
        drop = re.compile(rb"Date: [^\r]*")
        assert body == b"" and drop.sub(b"", head) == drop.sub(b"", whole)


@pytest.mark.parametrize("method", ["GET", "HEAD", "POST"])
@pytest.mark.parametrize(
    "headers",
    [
        ("evil.example",),
        ("127.0.0.1:1",),
        ("127.0.0.1",),
        (None, "Origin: http://evil.example"),
        (None, "Origin: null"),
        (None, "Sec-Fetch-Site: cross-site"),
        (None, "Host: evil.example"),
    ],
)
def test_foreign_pages_and_names_are_refused(page, method, headers):
    port, start = page
    answer = send(port, request(port, start, method, *headers, "Content-Length: 2", body=b"{}"))
    assert code(answer) == 403 and b"<html" not in answer


def test_a_request_without_a_host_is_refused(page):
    port, start = page
    assert code(send(port, f"GET {start} HTTP/1.1\r\nConnection: close\r\n\r\n".encode())) == 403
    assert b"<html" not in send(port, f"GET {start}\r\n\r\n".encode())  # as of HTTP/0.9


@pytest.mark.parametrize("target", [*ELSEWHERE.split(), "a" * 60_000])
def test_no_address_leads_elsewhere(page, target):
    port, start = page
    answer = send(port, request(port, start + target))
    assert code(answer) == (200 if target == "?x" else 404)
    assert b"secret" not in answer.split(b"\r\n\r\n", 1)[1] and b"Directory" not in answer


@pytest.mark.parametrize("target", ["*", "http://[", "http://127.0.0.1/", "x", "[::1"])
def test_what_is_no_path_is_refused(page, target):
    assert code(send(page[0], request(page[0], target))) in (400, 403)


@pytest.mark.parametrize(
    "text",
    [
        b"\r\n",
        b"\0\0\0\0\r\n\r\n",
        b"GET\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET / HTTP/\xb2.1\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 1000 + b"\r\n",
        b"GET / HTTP/1.1\r\nX: " + b"y" * 100_000 + b"\r\n\r\n",
        b"GET /" + b"y" * 100_000 + b" HTTP/1.1\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n",
        b"PUT / HTTP/1.1\r\n\r\n",
        b"\xff\xfe / HTTP/1.1\r\n\r\n",
        b"__init__ / HTTP/1.1\r\n\r\n",
    ],
)
def test_what_is_no_request_ends_the_connection(page, text):
    answer = send(page[0], text)
    is_refused = b" 4" in answer[:14] or b" 5" in answer[:14]
    assert answer == b"" or is_refused or answer.startswith(b"<!DOCTYPE")


@pytest.mark.parametrize(
    "length", ["\xb2", "-1", "1e3", "0x10", "9" * 400, "99999999", "+5", "", " ", "5, 5"]
)
def test_a_length_that_is_none_is_refused(page, length):
    port, start = page
    head = ("POST", None, f"Content-Length: {length}")
    assert code(send(port, request(port, start + "change", *head, body=b"{}"))) == 413


def test_a_chunked_body_is_no_second_request(page):
    port, start = page
    inner = request(port, start, "POST", None, "Content-Length: 0")
    inner = inner.replace(b"Connection: close\r\n", b"")
    head = f"GET {start} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n"
    outer = f"{head}Transfer-Encoding: chunked\r\n\r\n".encode()
    assert send(port, outer + inner).count(b"HTTP/1.1 ") == 1


@one_page
def test_silent_and_slow_connections_are_closed(page):
    port, start = page
    begun = time.monotonic()
    head = ("POST", None, "Content-Type: application/json", "Content-Length: 9")
    unfinished = (b"", b"GET / HT", request(port, start, *head, body=b"{"))
    with ThreadPoolExecutor() as pool:
        assert set(pool.map(partial(send, port), unfinished)) == {b""}
    with socket.create_connection(("127.0.0.1", port), timeout=20) as line:
        for _ in range(100):  # a byte now and then puts nothing off
            try:
                line.sendall(b"G")
            except OSError:
                break
            time.sleep(0.1)
        else:
            raise AssertionError("still open")
    assert time.monotonic() - begun < 15
    assert code(send(port, request(port, start))) == 200


def test_a_client_that_goes_away_is_no_news(page):
    port, start = page
    for _ in range(5):
        line = socket.create_connection(("127.0.0.1", port))
        line.sendall(request(port, start))
        line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        line.close()
    assert code(send(port, request(port, start))) == 200


@one_page
def test_many_connections_at_once_leave_room(page, monkeypatch):
    port, start = page
    monkeypatch.setattr(loopback, "MOST_THREADS", threading.active_count() + 5)
    lines = [socket.create_connection(("127.0.0.1", port)) for _ in range(10)]
    time.sleep(1.0)  # those that are silent are closed
    assert code(send(port, request(port, start))) == 200
    for line in lines:
        line.close()


def test_closing_waits_for_an_answer_on_its_way():
    begun, answers = threading.Event(), []

    class Slow(loopback.LoopbackHandler):
        def answer(self, method, body):
            begun.set()
            time.sleep(0.3)
            answers.append(method)
            return loopback.Answer(200, b"")

    with serve(loopback.LoopbackServer(Slow)) as server:
        text = request(server.server_port, "/", "POST", None, "Content-Length: 0")
        threading.Thread(target=send, args=(server.server_port, text)).start()
        begun.wait(10)
        server.shutdown()
        assert answers == []
    assert answers == ["POST"]
