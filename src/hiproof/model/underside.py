"""How a solid ends below: walls down to the terrain, and passages under it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely


@dataclass(frozen=True)
class Passage:
    """A passage under a building, open below its `ceiling` over its `outline`.

    Both are in the roof's frame, in metres.
    """

    outline: shapely.Polygon
    ceiling: float


@dataclass(frozen=True)
class Underside:
    """The lower end of a solid.

    `terrain` holds closed lines (m, 3) along the outline down to which walls reach, in the roof's
    frame; without lines the solid stands on one level. `passages` lead through below it.
    """

    terrain: tuple[np.ndarray, ...] = ()
    passages: tuple[Passage, ...] = ()

    @property
    def is_level(self) -> bool:
        return not (self.terrain or self.passages)


ONE_LEVEL = Underside()
