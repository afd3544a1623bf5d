"""Random edits of generated buildings: changed parameters, and the buttons of the page."""

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
from hiproof.simulate.edits import random_edit
from hiproof.status import Status
from hiproof.write.parameters import building_record

PRESSED = 0.3  # share of edits by buttons


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


def draw_edit(rng: np.random.Generator, house: Building) -> Callable[[], Building]:
    """Draw what does a random edit."""
    if rng.random() < PRESSED:
        request = draw_press(rng, house)
        nothing = np.zeros((0, 3))
        return lambda: apply_edit(building_record(house), request, nothing, Settings(), False)
    kind, index, change = random_edit(rng, house)
    if kind == "remove":
        return lambda: house.without_part(index)
    return lambda: house.with_part(index, **change)


def count_outcomes(edits: int, buildings: int, seed: int) -> Counter:
    """Edit buildings again and again; count the kinds of outcomes, each crash with its text.

    An edit stands on those before it that made a building.
    """
    rng, houses, outcomes = np.random.default_rng(seed), generate_buildings(buildings), Counter()
    for number in range(edits):
        place = number % buildings
        try:
            house = draw_edit(rng, houses[place])()
            outcomes["invalid" if check_solid(house.solid, planarity_m=0.01) else "valid"] += 1
            houses[place] = house if len(house.parts) < 12 else houses[place]
        except HiproofError as error:
            outcomes["several lines" if "\n" in str(error) else "one sentence"] += 1
        except Exception as error:
            outcomes[f"crash {error!r}"] += 1
    return outcomes
