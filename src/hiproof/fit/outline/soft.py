"""How soft a side is: the scanner's noise in plan takes points across it. Compiled."""

from __future__ import annotations

import math

from ...compiled import compiled

# standard deviations of the noise from a side, beyond which a point is inside or outside for sure
SURE_BLURS = 4.0


@compiled
def share_inside(depth):
    """How likely a point of the roof is at `depth` inside the side (standard deviations of the
    noise), from 0 to 1.
    """
    return 0.5 * math.erfc(-depth / math.sqrt(2.0))
