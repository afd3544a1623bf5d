"""Random edits of generated buildings, and the time of an edit.

They change parameters and use the page's buttons. Each becomes a valid solid or one sentence.

usage: python -m benchmarks.edits [EDITS] [BUILDINGS]
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from hiproof.compose import check_solid
from hiproof.compose.settle import settled_roof
from hiproof.edit.actions import apply_edit
from hiproof.errors import HiproofError
from hiproof.model import Building
from hiproof.parametric.building import with_model
from hiproof.settings import Settings
from hiproof.simulate import random_building, random_compound
from hiproof.simulate.edits import EDIT_KINDS, random_edit
from hiproof.status import Status
from hiproof.write.parameters import building_record

PRESSES = ("split", "merge", "dormer", "recess")
PRESSED = 0.3  # of the edits


def generate_buildings(count: int, seed: int = 0) -> list[Building]:
    """Generate primitives and compounds in turn, with composed solids."""
    rng = np.random.default_rng(seed)
    roofs = [(random_building if k % 2 else random_compound)(rng).roof for k in range(count)]
    return [
        with_model(Building(f"house-{k}", Status.MODELLED, z_ground=0.0), settled_roof(roof))
        for k, roof in enumerate(roofs)
    ]


def draw_press(rng: np.random.Generator, building: Building) -> dict[str, Any]:
    """Draw the request of one of the page's buttons, at any part and place."""
    part, other = (int(k) for k in rng.integers(len(building.parts), size=2))
    x0, y0, x1, y1 = building.roof.outline.bounds
    place = [rng.uniform(x0 - 1.0, x1 + 1.0), rng.uniform(y0 - 1.0, y1 + 1.0), 0.0]
    changes: list[dict[str, Any]] = [
        {
            "action": "split",
            "side": str(rng.choice(["length", "width"])),
            "share": rng.uniform(-0.1, 1.1),
        },
        {"action": "merge", "other": other},
        {"action": "dormer", "place": place if rng.random() < 0.9 else None},
        {"action": "recess", "place": place if rng.random() < 0.9 else None},
    ]
    return {"part": part, **changes[rng.integers(len(changes))]}


def draw_edit(rng: np.random.Generator, house: Building) -> tuple[str, Callable[[], Building]]:
    """Draw a random edit's kind, and what does it."""
    if rng.random() < PRESSED:
        request = draw_press(rng, house)
        return request["action"], lambda: apply_edit(
            building_record(house), request, np.zeros((0, 3)), Settings(), False
        )
    kind, index, change = random_edit(rng, house)
    return (
        kind,
        lambda: house.without_part(index) if kind == "remove" else house.with_part(index, **change),
    )


def main(edits: int = 10_000, buildings: int = 500, seed: int = 0) -> dict[str, Counter]:
    """Edit buildings again and again, each time on what the last edit made."""
    rng, houses = np.random.default_rng(seed), generate_buildings(buildings)
    outcomes = {kind: Counter() for kind in (*EDIT_KINDS, *PRESSES)}
    sentences: Counter = Counter()
    seconds = []
    for number in range(edits):
        place = number % buildings
        kind, edit = draw_edit(rng, houses[place])
        start = time.perf_counter()
        try:
            name = edit()
            valid = not check_solid(name.solid, planarity_m=0.01)
            outcomes[kind]["valid" if valid else "INVALID"] += 1
            houses[place] = name if len(name.parts) < 12 else houses[place]
        except HiproofError as error:
            sentences[str(error)[:60]] += 1
            outcomes[kind]["one sentence" if "\n" not in str(error) else "SENTENCES"] += 1
        except Exception as error:
            outcomes[kind][f"CRASH {type(error).__name__}: {error}"[:120]] += 1
        seconds.append(time.perf_counter() - start)
    for kind, counts in outcomes.items():
        print(
            f"{kind}: " + ", ".join(f"{number} {label}" for label, number in counts.most_common())
        )
    print(
        f"{edits} edits of {buildings} buildings, {1e3 * np.median(seconds):.1f} ms in the median"
    )
    for sentence, number in sentences.most_common(8):
        print(f"  {number} {sentence} ...")
    return outcomes


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
