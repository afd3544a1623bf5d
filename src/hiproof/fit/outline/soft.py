"""The softness of a side: noise in plan takes points across it. Compiled."""

from __future__ import annotations

import math

from ...compiled import compiled

# standard deviations of the noise from a side, beyond which a point is inside or outside for sure
SURE_BLURS = 4.0


@compiled
def share_inside(depth):
    """Return the likelihood, 0 to 1, of a roof point at `depth` inside a side.

    Depth is in standard deviations of the noise.
    """
    return 0.5 * math.erfc(-depth / math.sqrt(2.0))
