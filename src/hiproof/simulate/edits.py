"""Random changes of a building's parts.

They are what a person, a program or a slip of the hand may do to parameters.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..model import Building
from ..primitives.catalogue import CATALOGUE

EDIT_KINDS = ("parameter", "type", "ridge", "eave", "turn", "move", "size", "add", "remove")


def random_edit(rng: np.random.Generator, building: Building) -> tuple[str, int, dict[str, Any]]:
    """Draw (kind, part, change) for `Building.with_part`.

    It is for `without_part` where the kind is "remove".

    Parameters become anything from a hundredth to four times what they were, now and then below
    zero or none at all; types any other; parts go up to 5 m aside, and turn anywhere.
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


def edit_at_random(rng: np.random.Generator, building: Building) -> Building:
    """Return the building after a random edit.

    Raises the HiproofError of an edit that makes no building.
    """
    kind, index, change = random_edit(rng, building)
    return building.without_part(index) if kind == "remove" else building.with_part(index, **change)
