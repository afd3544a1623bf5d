"""Shed (saw-tooth, CityGML 1100): 2 to 6 equal monopitches in a row."""

from dataclasses import replace

from ..errors import FitError
from .contract import Parameters
from .table import make_shape

# of a saw-tooth that is one primitive; longer rows are put together from volumes
TEETH = range(2, 7)


def choose_teeth(p: Parameters) -> int:
    """Return the place in TEETH of a saw-tooth's number of teeth; raises FitError for others."""
    teeth = p.get("teeth", TEETH[0])
    if teeth not in TEETH:
        raise FitError(
            f"expected 2 to 6 teeth for the roof type shed, got {teeth}; choose one of these"
        )
    return TEETH.index(int(teeth))


first, *rest = (make_shape("shed", {"teeth": teeth}, strips=teeth) for teeth in TEETH)
SHED = replace(first, more=tuple(rest), choose=choose_teeth)
