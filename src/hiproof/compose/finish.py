"""A model finished: its solid with the underside that it is to have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from ..model import Model, Passage, Solid, Underside
from ..settings import ComposeSettings
from .settle import PLAN_DIGITS
from .underside import make_underside


def add_underside(model: Model, underside: Underside) -> Model:
    """Return the model with its `underside` made.

    Raises CompositionError as `make_underside` does.
    """
    level = model.on_one_level
    if underside.is_level:
        return replace(model, solid=level, underside=underside, level_solid=None)
    solid = finish_solid(level, underside, model.roof.frame.origin, model.compose)
    return replace(model, solid=solid, underside=underside, level_solid=level)


def add_passage(model: Model, outline: shapely.Polygon, z_ceiling: float) -> Model:
    """Return the model with one more passage.

    Its `outline` is in the roof's frame, the height of its ceiling in the world. Raises
    CompositionError as `make_underside` does.
    """
    passage = Passage(outline, z_ceiling - float(model.roof.frame.origin[2]))
    passages = (*model.underside.passages, passage)
    return add_underside(model, replace(model.underside, passages=passages))


def finish_solid(
    level: Solid, underside: Underside, origin: np.ndarray, compose: ComposeSettings | None = None
) -> Solid:
    """Return a solid over one level (in the world) with its underside made.

    The roof's frame begins at `origin` (3,).
    """
    local = Solid(np.round(level.vertices - origin, PLAN_DIGITS), level.faces)
    return make_underside(local, underside, compose or ComposeSettings()).move(origin)
