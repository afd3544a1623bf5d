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
from hiproof.primitives.catalogue import CATALOGUE
from hiproof.settings import Settings
from hiproof.simulate import random_building, random_compound
from hiproof.status import Status
from hiproof.write.parameters import building_record

PRESSED = 0.3  # share of edits by buttons
EDIT_KINDS = ("parameter", "type", "ridge", "eave", "turn", "move", "size", "add", "remove")


def random_edit(rng: np.random.Generator, building: Building) -> tuple[str, int, dict[str, Any]]:
    """Draw (kind, part, change) for `Building.with_part`. It is for `without_part` where the kind
    is "remove". Parameters become anything from a hundredth to four times what they were, now and
    then below zero or none at all; types any other; parts go up to 5 m aside, and turn anywhere.
    """
    kind = str(rng.choice(EDIT_KINDS))
    index = int(rng.integers(len(building.parts)))
    part, z = building.parts[index], float(building.roof.frame.origin[2])
    x0, y0, x1, y1 = building.roof.outline.bounds
    width, length = rng.uniform(0.3, 12.0), rng.uniform(0.3, 20.0)
    if kind == "parameter" and part.parameters:
        name = str(rng.choice(list(part.parameters)))
        return kind, index, {name: random_value(rng, part.parameters[name])}
    if kind == "add":
        place = [
            rng.uniform(x0, x1),
            rng.uniform(y0, y1),
            float(part.translation[2]) + rng.uniform(-2.0, 4.0),
        ]
        new = {
            "type": str(rng.choice(list(CATALOGUE))),
            "position": place,
            "rotation": rng.uniform(-180.0, 180.0),
        }
        return kind, len(building.parts), new | {"width": width, "length": length}
    changes: dict[str, dict[str, Any]] = {
        "type": {"type": str(rng.choice(list(CATALOGUE)))},
        "ridge": {"ridge_height": z + float(part.translation[2]) + rng.uniform(-1.0, 8.0)},
        "eave": {"eave_height": z + float(part.translation[2]) + rng.uniform(-4.0, 4.0)},
        "turn": {"rotation": rng.uniform(-180.0, 180.0)},
        "move": {"position": (part.translation + rng.uniform(-5.0, 5.0, 3)).tolist()},
        "size": {"width": width, "length": length},
    }
    return kind, index, changes.get(kind, {"type": str(rng.choice(list(CATALOGUE)))})


def random_value(rng: np.random.Generator, value: float) -> float:
    """Draw a value near, far from, or opposite to `value`."""
    slip = rng.random()
    if slip < 0.05:
        return 0.0
    return float(
        value * np.exp(rng.uniform(np.log(0.01), np.log(4.0))) * (-1.0 if slip < 0.1 else 1.0)
    )


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
    """Count the outcomes of edits upon edits of buildings, each crash with its text."""
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
