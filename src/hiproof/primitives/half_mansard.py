"""Half mansard: one slope from the eave up to a level top."""

from .algebra import V, q0, q1
from .contract import DerivedStart, at_quarters
from .half import front_half
from .truncated_gable import PRIMITIVE as TRUNCATED_GABLE

PRIMITIVE = front_half(
    TRUNCATED_GABLE,
    name="half_mansard",
    osm_shape="saltbox",
    colour="#6fbf8f",
    starts=(
        DerivedStart("monopitch", (q0 + 0.2 * q1 * V, q1, 0.6)),
        *at_quarters("flat", (q0, 1.0, 0.15)),
    ),
)
