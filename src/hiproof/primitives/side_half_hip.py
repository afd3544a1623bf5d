"""Side half-hip: a gable of which one end is cut by a small hip."""

from .algebra import q0, q1
from .contract import at_quarters
from .half import right_half
from .half_hip import PRIMITIVE as HALF_HIP

PRIMITIVE = right_half(
    HALF_HIP,
    name="side_half_hip",
    osm_shape="side_half-hipped",
    colour="#8fd6ee",
    starts=at_quarters("gable", (q0, q1, 1.0, 0.5), (0, 2)),
)
