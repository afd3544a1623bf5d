"""Corner mansard: slopes from two adjacent eaves up to a level top that reaches to the other two sides."""

from .algebra import V, q0, q1, q2
from .contract import DerivedStart, at_quarters
from .half import front_half
from .side_mansard import PRIMITIVE as SIDE_MANSARD

PRIMITIVE = front_half(
    SIDE_MANSARD,
    name="corner_mansard",
    osm_shape="mansard",
    colour="#1e7a46",
    starts=(DerivedStart("corner", (q0 + q1 * V, q1, q2, 0.5)), *at_quarters("flat", (q0, 1.0, 1.0, 0.15))),
)
