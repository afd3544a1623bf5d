"""Side mansard: three slopes from the eave up to a level top that reaches to the fourth side."""

from .algebra import V, q0, q1
from .contract import at_quarters
from .half import right_half
from .mansard import PRIMITIVE as MANSARD

PRIMITIVE = right_half(
    MANSARD,
    name="side_mansard",
    osm_shape="mansard",
    colour="#35a866",
    starts=(
        *at_quarters("gable", (q0 - 0.4 * q1 * V, q1, 1.0, 0.6), (0, 2)),
        *at_quarters("flat", (q0, 1.0, 1.0, 0.25)),
    ),
)
