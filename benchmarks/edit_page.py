"""The page of `hiproof edit` on Delft: the time of an edit, and repairs.

The most doubtful buildings are corrected through the page's requests.

usage: python -m benchmarks.edit_page RUN [--buildings 60] [--mend 12] [--rounds 3] [--browser]

RUN is the folder of a finished run whose clouds are still there; edits.jsonl in it is replaced.
Prints the median and the 95th percentile of an edit (a ridge raised, measured) and of a refit, from
the request's bytes to the answer's, and with --browser from the key to the model shown in Chromium
(needs playwright). Then each of the most doubtful buildings is mended by a script that does what a
person does, without eyes: other types, cuts, parts left out, edges dragged, dormers and blocks
drawn around points that crowd above the roof and recesses around those below, each refitted; the
first that raises the share of points within 0.2 m by a hundredth is kept, else the best, round by
round. What comes of it is accepted, and the run done again with it.
"""

from __future__ import annotations

import argparse
import base64
import json
import os
import shutil
import statistics
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from hiproof.city.run import Request, reconstruct_area
from hiproof.compose import check_solid
from hiproof.edit.desk import Desk
from hiproof.edit.edits import EDITS_FILE
from hiproof.edit.server import Server, Service
from hiproof.evaluate.metrics import FACADE_M
from hiproof.evaluate.run import run_record
from hiproof.geometry.rings import OVERLAY_GRID_M
from hiproof.parametric.file import read_parameters
from hiproof.read.solids import read_solids
from hiproof.settings import Settings

TYPES = ("flat", "monopitch", "gable", "hip", "half_hip", "side_hip", "asymmetric_gable", "mansard")
SHARES = (0.35, 0.5, 0.65)
PARTS = 3  # of a building, the largest, that the script tries to change
ABOVE_M, BELOW_M = (
    (0.25, 4.0),
    (-7.0, -0.25),
)  # heights of points above or below the roof that a part of their own may explain
CROWDS_M, CROWD, CROWDS = (
    (0.7, 0.45),
    5,
    4,
)  # points so near each other in space, at least so many, are a crowd; so many are tried
DRAGS_M = (0.4, -0.4)  # of an edge
LEAST_M = 0.6  # side of a part drawn around a crowd
ENOUGH = 0.01  # gain of share at which the script stops looking for a better one


class Window:
    """A window on the page, without a browser: it asks what the page's script asks."""

    def __init__(self, folder: Path) -> None:
        self.service = Service(Desk(folder, "benchmark"))
        self.service.port = 8000
        self.headers = {"Host": "127.0.0.1:8000", "Content-Type": "application/json"}

    def ask(
        self, method: str, name: str, body: dict[str, Any] | None = None
    ) -> tuple[int, dict[str, Any]]:
        text = b"" if body is None else json.dumps(body).encode()
        answer = self.service.answer(method, f"/{self.service.token}/{name}", self.headers, text)
        return answer.code, json.loads(answer.body)

    def change(self, id: str, parts: list, **asked: Any) -> dict[str, Any] | None:
        """Return the model after an edit, None where it makes none."""
        code, response = self.ask("POST", "change", {"id": id, "parts": parts, "asked": asked})
        return response if code == 200 else None


def measure_times(window: Window, ids: list[str]) -> None:
    """Measure the milliseconds of an edit and of a refit.

    Both are composed, checked and measured.
    """
    wall, cpu = {"ridge raised": [], "refit": []}, {"ridge raised": [], "refit": []}
    for id in ids:
        model = window.ask("GET", f"building?id={id}")[1]
        window.ask("GET", f"points?id={id}")
        window.change(id, model["parts"], action="show")
        height = model["origin"][2] + model["handles"][0]["ridge"] + 0.3
        for name, change in {
            "ridge raised": {"action": "change", "part": 0, "change": {"ridge_height": height}},
            "refit": {"action": "refit"},
        }.items():
            start, cpu_start = time.perf_counter(), time.process_time()
            window.change(id, model["parts"], **change)
            wall[name].append(1e3 * (time.perf_counter() - start))
            cpu[name].append(1e3 * (time.process_time() - cpu_start))
    for name, durations in wall.items():
        print(
            f"{name}: median {statistics.median(durations):.0f} ms, 95 % "
            f"{np.percentile(durations, 95):.0f} ms over {len(durations)} buildings "
            f"(CPU {statistics.median(cpu[name]):.0f} and {np.percentile(cpu[name], 95):.0f} ms; "
            f"load {os.getloadavg()[0]:.0f})",
            flush=True,
        )


def measure_in_browser(window: Window, ids: list[str]) -> None:
    """Measure the milliseconds from the key r to the model, in Chromium."""
    from playwright.sync_api import sync_playwright

    flags = [
        "--no-sandbox",
        "--disable-quic",
        "--disable-background-networking",
        "--enable-unsafe-swiftshader",
    ]
    durations = []
    with Server(window.service) as server, sync_playwright() as driver:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        page = browser.new_page(viewport={"width": 1500, "height": 900})
        page.goto(window.service.address)
        page.evaluate("() => queue")
        for id in ids:
            page.evaluate("id => inTurn(() => open(id))", id)
            for _ in range(2):  # the first also composes what the second starts from
                page.keyboard.press("r")
                page.evaluate("() => queue")
            durations.append(float(page.evaluate("Number($('say').dataset.ms)")))
        browser.close()
        server.shutdown()
    window.service.port = 8000
    print(
        f"refit in the page: median {statistics.median(durations):.0f} ms, 95 % "
        f"{np.percentile(durations, 95):.0f} ms, {len(durations)} buildings"
    )


def list_tries(model: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield edits that a person might try on the largest parts."""
    areas = [h.get("width", 0.0) * h.get("length", 0.0) for h in model["handles"]]
    for part in sorted(range(len(areas)), key=lambda k: -areas[k])[:PARTS]:
        kinds = [kind for kind in TYPES if kind != model["parts"][part]["type"]]
        yield from ({"action": "change", "part": part, "change": {"type": kind}} for kind in kinds)
        for side in ("length", "width"):
            yield from (
                {"action": "split", "part": part, "side": side, "share": share} for share in SHARES
            )
        if len(areas) > 1:
            yield {"action": "remove", "part": part}
            yield from list_drags(model, part)


def list_drags(model: dict[str, Any], part: int) -> Iterator[dict[str, Any]]:
    """Yield moves of each edge of a part, out and in, as by its handle."""
    h, z = model["handles"][part], model["parts"][part]["position"][2]
    for side, turn in (("length", 0.0), ("width", 0.5 * np.pi)) if h else ():
        axis = np.array([np.cos(h["turn"] + turn), np.sin(h["turn"] + turn)])
        for sign in (-1.0, 1.0):
            for drag in (d for d in DRAGS_M if h[side] + d > LEAST_M):
                x, y = (np.array(h["place"]) + 0.5 * sign * drag * axis).tolist()
                yield {
                    "action": "change",
                    "part": part,
                    "change": {side: h[side] + drag, "position": [x, y, z]},
                }


def try_models(window: Window, id: str, model: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the models of all tries, refitted where that can be."""
    for action, heights in (("dormer", ABOVE_M), ("recess", BELOW_M)):
        for crowd in find_crowds(window, id, model, heights):
            yield from draw_parts(window, id, model, crowd, action)
    for change in list_tries(model):
        yield from refit(window, id, window.change(id, model["parts"], **change))


def refit(window: Window, id: str, model: dict[str, Any] | None) -> Iterator[dict[str, Any]]:
    """Yield the model fitted to the points again.

    It is itself where it cannot be fitted; there is nothing of None.
    """
    if model is not None:
        yield window.change(id, model["parts"], action="refit") or model


def find_crowds(
    window: Window, id: str, model: dict[str, Any], heights: tuple[float, float]
) -> list[np.ndarray]:
    """Return the largest crowds of points (n, 3) between two heights.

    Heights are over the roof: a person sees such crowds stand out of it.
    """
    cloud = window.ask("GET", f"points?id={id}")[1]
    places = np.frombuffer(base64.b64decode(cloud["places"]), "<f4").reshape(-1, 3).astype(float)
    gaps = np.frombuffer(base64.b64decode(model["gaps"]), "<f4")
    outlines = [shapely.Polygon(o[0]) for part in model["parts"] for o in part["outlines"]]
    roofed = shapely.union_all(shapely.make_valid(outlines), grid_size=OVERLAY_GRID_M)
    counts = shapely.intersects_xy(shapely.buffer(roofed, -FACADE_M), *places[:, :2].T)
    outliers = places[(gaps > heights[0]) & (gaps < heights[1]) & counts]
    if not len(outliers):
        return []
    tree, crowds = cKDTree(outliers), {}
    for reach in CROWDS_M:
        crowd = connected_components(tree.sparse_distance_matrix(tree, reach))[1]
        members = (np.flatnonzero(crowd == k) for k in range(crowd.max() + 1))
        largest = sorted((m for m in members if len(m) >= CROWD), key=len, reverse=True)[:CROWDS]
        crowds |= {m.tobytes(): outliers[m] for m in largest}
    return list(crowds.values())


def draw_parts(
    window: Window, id: str, model: dict[str, Any], crowd: np.ndarray, action: str
) -> Iterator[dict[str, Any]]:
    """Yield models with a dormer, a block or a recess around a crowd.

    They are refitted, and edges are dragged while that helps.
    """
    middle = crowd.mean(axis=0)
    for part in list_owners(model, middle)[:PARTS]:
        drawn_model = window.change(
            id, model["parts"], action=action, part=part, place=middle.tolist()
        )
        if drawn_model is None:
            continue
        last = len(drawn_model["parts"]) - 1
        for kind in dict.fromkeys((drawn_model["parts"][last]["type"], "flat")):
            change = {"type": kind} | fit_box(
                crowd,
                drawn_model["handles"][last]["turn"],
                drawn_model["parts"][last]["position"][2],
            )
            best = window.change(
                id, drawn_model["parts"], action="change", part=last, change=change
            )
            best = next(refit(window, id, best), None)
            yield from () if best is None else drag_edges(window, id, best, last)


def fit_box(crowd: np.ndarray, turn: float, z: float) -> dict[str, Any]:
    """Return width, length and position of the rectangle around a crowd.

    Its length is turned so.
    """
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    uv = crowd[:, :2] @ axes.T
    length, width = np.maximum(np.ptp(uv, axis=0), LEAST_M).tolist()
    x, y = (0.5 * (uv.min(axis=0) + uv.max(axis=0)) @ axes).tolist()
    return {"width": width, "length": length, "position": [x, y, z]}


def drag_edges(
    window: Window, id: str, model: dict[str, Any], part: int
) -> Iterator[dict[str, Any]]:
    """Yield the model, and whatever dragging edges of a part makes better."""
    yield model
    for change in list_drags(model, part):
        for candidate in refit(window, id, window.change(id, model["parts"], **change)):
            if read_share(candidate) > read_share(model):
                yield from drag_edges(window, id, candidate, part)
                return


def list_owners(model: dict[str, Any], place: np.ndarray) -> list[int]:
    """Return the parts in whose reach a place lies."""
    return [
        index
        for index, h in enumerate(model["handles"])
        if h
        and np.hypot(h["place"][0] - place[0], h["place"][1] - place[1])
        < 0.5 * max(h["width"], h["length"])
    ]


def read_share(model: dict[str, Any] | None) -> float:
    return -1.0 if model is None else model["figures"]["share_within_20cm"] or 0.0


def choose_better(models: Iterator[dict[str, Any]], best: dict[str, Any]) -> dict[str, Any]:
    """Return the first model whose share is higher by ENOUGH, else the best.

    `best` is among them.
    """
    best_model = best
    for model in models:
        best_model = max(best_model, model, key=read_share)
        if read_share(best_model) >= read_share(best) + ENOUGH:
            break
    return best_model


def mend_building(window: Window, id: str, rounds: int) -> tuple[float, float, int, int]:
    """Correct and accept a building.

    Returns its share before and after, and its parts before and after.
    """
    start = window.ask("GET", f"building?id={id}")[1]
    first = best = window.change(id, start["parts"], action="show")
    refitted = window.change(id, start["parts"], action="refit")
    best = max(best, refitted or best, key=read_share)
    for _ in range(rounds):
        improved = choose_better(try_models(window, id, best), best)
        if improved is best:
            break
        best = improved
    note = f"share {read_share(first):.3f} to {read_share(best):.3f}"
    code, answer = window.ask(
        "POST",
        "accept",
        {"id": id, "parts": best["parts"], "version": start["version"], "note": note},
    )
    assert code == 200, answer
    return read_share(first), read_share(best), len(start["parts"]), len(best["parts"])


def run_again(folder: Path) -> None:
    """Run the folder's run with the edits accepted in it."""
    record = run_record(folder)
    inputs, settings = record["inputs"], Settings.from_dict(record["settings"])
    request = Request(
        tuple(inputs["clouds"]),
        folder,
        inputs["footprints"],
        inputs["terrain"],
        settings=settings,
        overrides=str(folder / EDITS_FILE),
    )
    reconstruct_area(request)


def mend_doubtful(window: Window, folder: Path, count: int, rounds: int) -> None:
    """Correct the most doubtful buildings, then run again.

    They are corrected one after the other.
    """
    ids = [
        row["id"] for row in window.ask("GET", "buildings")[1]["rows"] if row["share"] is not None
    ][:count]
    old_rows = {row["id"]: row for row in read_parameters(folder / "parameters.jsonl")}
    for id in ids:
        start = time.perf_counter()
        old_share, new_share, parts_was, parts_now = mend_building(window, id, rounds)
        line = f"{id}: share {old_share:.3f} -> {new_share:.3f}, parts {parts_was} -> {parts_now}"
        print(f"{line} ({time.perf_counter() - start:.0f} s)", flush=True)
    run_again(folder)
    new_rows = {row["id"]: row for row in read_parameters(folder / "parameters.jsonl")}
    n_better = sum(read_record_share(new_rows[id]) > read_record_share(old_rows[id]) for id in ids)
    solids = dict(read_solids(folder / "buildings.city.jsonl"))
    valid = sum(not check_solid(solids[id], planarity_m=0.01) for id in ids)
    other_ids = [id for id in old_rows if id not in ids]
    n_same = sum(new_rows[id] == old_rows[id] for id in other_ids)
    print(
        f"after the next run: share up of {n_better} of {len(ids)}, {valid} valid, {n_same} of "
        f"{len(other_ids)} others unchanged"
    )


def read_record_share(record: dict[str, Any]) -> float:
    return record["residuals"]["share_within_20cm"] or 0.0


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path)
    parser.add_argument("--buildings", type=int, default=60)
    parser.add_argument("--mend", type=int, default=12)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--browser", action="store_true")
    request = parser.parse_args()
    (request.run / EDITS_FILE).unlink(missing_ok=True)
    window = Window(request.run)
    rows = [
        row["id"] for row in window.ask("GET", "buildings")[1]["rows"] if row["share"] is not None
    ]
    ids = rows[:: max(1, len(rows) // request.buildings)][: request.buildings]
    measure_times(window, ids)
    if request.browser:
        measure_in_browser(window, ids)
    if request.mend:
        mend_doubtful(window, request.run, request.mend, request.rounds)


if __name__ == "__main__":
    main()
