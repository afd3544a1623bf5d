"""Side hip: a gable of which one end slopes too, as has one of a pair of houses under one hipped roof."""

from .algebra import q0, q1, q2
from .contract import at_quarters
from .half import right_half
from .hip import PRIMITIVE as HIP

PRIMITIVE = right_half(
    HIP,
    name="side_hip",
    osm_shape="side_hipped",
    colour="#4fa3c7",
    starts=(*at_quarters("gable", (q0, q1, 1.0), (0, 2)), *at_quarters("hip", (q0, q1, q2), (0, 2))),
)
