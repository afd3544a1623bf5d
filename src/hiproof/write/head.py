"""What the files of a run have in common."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..settings import ComposeSettings, WriteSettings
from .naming import FileUnits


@dataclass(frozen=True)
class FileHead:
    """What the files of a run have in common: the CRS (anything pyproj understands, or None), the unit of coordinates
    without one (a key of read.crs.NAMED_UNITS), the offset (3,) of the CityJSON file, None where its first building
    settles it, how solids are composed and what is written of buildings."""

    crs: Any = None
    unit: str = "auto"
    offset: np.ndarray | None = None
    compose: ComposeSettings = field(default_factory=ComposeSettings)
    write: WriteSettings = field(default_factory=WriteSettings)

    @functools.cached_property
    def units(self) -> FileUnits:
        """Units of the coordinates in each file."""
        from ..read.crs import parse_crs, units_of

        return FileUnits.of(self.crs, units_of(parse_crs(self.crs), named=self.unit))
