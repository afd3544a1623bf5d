"""Who may ask the page's server, and what: this machine, the token's bearer, the page itself; and
what kill -9 leaves.
"""

import http.client
import json
import os
import re
import signal
import subprocess
import sys
import threading
from urllib.parse import urlsplit

import pytest

from hiproof.city.plan.overrides import read_overrides
from hiproof.edit.desk import Desk
from hiproof.edit.edits import EDITS_FILE, UNTOUCHED
from hiproof.edit.server import Server, Service
from hiproof.errors import InputError
from pages import serve

OWN = {"Host": "127.0.0.1:8000", "Content-Type": "application/json"}


@pytest.fixture
def service(folder):
    made_service = Service(Desk(folder, "anna"))
    made_service.port = 8000
    return made_service


def get_status(service, target=None, method="GET", body=b"", **headers):
    target = f"/{service.token}/buildings" if target is None else target
    sent_headers = {**OWN, **{name.replace("_", "-"): value for name, value in headers.items()}}
    return service.answer(
        method, target, {k: v for k, v in sent_headers.items() if v is not None}, body
    ).code


def test_the_page_and_its_own_requests_are_answered(service):
    assert get_status(service) == 200
    assert get_status(service, Origin="http://127.0.0.1:8000", Sec_Fetch_Site="same-origin") == 200
    assert get_status(service, Host="localhost:8000", Origin="http://localhost:8000") == 200
    for name in (
        "",
        "edit.js",
        "edit.css",
        "viewer.js",
        "handles.js",
        "start",
        "drawing?type=hip",
        "points?id=house-0",
    ):
        assert get_status(service, f"/{service.token}/{name}") == 200, name


def test_without_the_token_nothing_is_told(service):
    for target in (
        "/",
        "/buildings",
        "//buildings",
        f"/{service.token[:-1]}/",
        f"/{service.token}x/",
        "/é/",
        "*",
    ):
        response = service.answer("GET", target, OWN)
        assert response.code == 403 and service.token.encode() not in response.body, target


def test_no_name_leads_out_of_the_run(service):
    """Nor does a path: tests/test_loopback.py."""
    for name in ("building", "points"):
        assert get_status(service, f"/{service.token}/{name}?id=../secret.txt") == 422
    assert get_status(service, f"/{service.token}/drawing?type=../secret") == 422
    for name in ("run.json", "assets/edit.js", "edits.jsonl"):
        assert get_status(service, f"/{service.token}/{name}") == 404, name


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (b"", 422),
        (b"{", 422),
        (b"[" * 100_000, 422),
        (b"[]", 422),
        (b'{"id": 3}', 422),
        (b'{"id": "house-0"}', 422),
        (b'{"id": "house-0", "parts": [], "asked": {"action": "show"}}', 422),
        (b'{"id": "house-0", "parts": [{"type": NaN}], "asked": {"action": "show"}}', 422),
    ],
)
def test_a_body_that_makes_no_sense_is_one_sentence(service, body, expected):
    response = service.answer("POST", f"/{service.token}/change", OWN, body)
    assert response.code == expected and json.loads(response.body)["error"].startswith("expected")


def test_only_json_is_taken_as_an_edit(service):
    assert (
        get_status(service, f"/{service.token}/accept", "POST", b"{}", Content_Type="text/plain")
        == 415
    )
    assert get_status(service, f"/{service.token}/delete", "POST", b'{"id": "house-0"}') == 404


def test_another_version_is_told_to_the_page(service):
    parts = service.desk.building("house-0")["parts"]
    body = {"id": "house-0", "parts": parts, "version": UNTOUCHED}
    target = f"/{service.token}/accept"
    assert service.answer("POST", target, OWN, json.dumps(body).encode()).code == 200
    response = service.answer("POST", target, OWN, json.dumps(body).encode())
    assert response.code == 409
    body["version"] = json.loads(response.body)["version"]
    assert service.answer("POST", target, OWN, json.dumps(body).encode()).code == 200


def test_it_listens_at_the_loopback_address_alone(service):
    with serve(Server(service)) as server:
        assert server.server_address[0] == "127.0.0.1" and service.port == server.server_port
        with pytest.raises(InputError, match="expected a free port"):
            Server(service, server.server_port)
        answer = request(service.address, "GET", "")
    assert answer.status == 200
    assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
    assert answer.headers["Referrer-Policy"] == "no-referrer"


def request(address, method, name, body=None):
    """An answer read to its end."""
    split = urlsplit(address)
    line = http.client.HTTPConnection(split.hostname, split.port, timeout=60)
    headers = {"Content-Type": "application/json"}
    line.request(method, split.path + name, None if body is None else json.dumps(body), headers)
    answer = line.getresponse()
    answer.text = answer.read()
    line.close()
    return answer


def start_server(folder):
    """A server in a process of its own, and its address."""
    command = [sys.executable, "-m", "hiproof", "edit", str(folder), "--who", "anna"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}
    )
    for line in process.stdout:
        if match := re.match(r"open (\S+)", line):
            return process, match[1]
    raise AssertionError(f"the server ended with {process.wait()}")


def accept_until_killed(folder, number):
    """Start a server, accept one edit after the other, and send it a signal meanwhile; the process
    and what it confirmed.
    """
    process, address = start_server(folder)
    confirmed = {}

    def accept_repeatedly():
        """Accept one building after the other until nobody answers."""
        versions, number = {}, 0
        try:
            while True:
                id, number = f"house-{number % 3}", number + 1
                if id not in versions:
                    building = json.loads(request(address, "GET", f"building?id={id}").text)
                    versions[id], parts = building["version"], building["parts"]
                body = {"id": id, "parts": parts, "version": versions[id], "note": f"edit {number}"}
                answer = request(address, "POST", "accept", body)
                assert answer.status == 200, answer.text
                versions[id] = json.loads(answer.text)["version"]
                confirmed[id] = f"edit {number}"
        except (OSError, http.client.HTTPException):
            return

    thread = threading.Thread(target=accept_repeatedly)
    thread.start()
    while len(confirmed) < 3:
        thread.join(0.05)
        assert thread.is_alive()
    process.send_signal(number)
    thread.join()
    process.wait()
    process.stdout.close()
    return process, confirmed


def test_ctrl_c_leaves_nothing_half_written(folder):
    old_names = {path.name for path in folder.iterdir()}
    process, _ = accept_until_killed(folder, signal.SIGINT)
    assert process.returncode == 0
    assert {path.name for path in folder.iterdir()} - old_names == {
        EDITS_FILE,
        f".{EDITS_FILE}.lock",
    }


def test_a_kill_loses_no_accepted_edit(folder):
    _, confirmed = accept_until_killed(folder, signal.SIGKILL)
    stored = dict(read_overrides(str(folder / EDITS_FILE)))
    assert set(stored) == set(confirmed)
    for id, note in confirmed.items():  # one that was on its way may have come through as well
        assert int(stored[id]["note"].split()[1]) >= int(note.split()[1])
    assert Desk(folder, "ben").building("house-0")["accepted"]["who"] == "anna"
