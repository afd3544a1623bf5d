"""Shed (saw-tooth, CityGML 1100): 2 to 6 equal monopitches in a row."""

from dataclasses import replace

from .table import make_shape

# of a saw-tooth that is one primitive; longer rows are put together from volumes
TEETH = range(2, 7)

first, *rest = (make_shape("shed", {"teeth": teeth}, strips=teeth) for teeth in TEETH)
SHED = replace(first, more=tuple(rest))
