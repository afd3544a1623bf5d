"""What the files of a run have in common."""

from __future__ import annotations

import datetime
import functools
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..data_files import Values
from ..settings import ComposeSettings, WriteSettings
from .attribute_list import PREFIX
from .naming import FileUnits


@dataclass(frozen=True)
class UpdateHead:
    """What an update found beside its buildings.

    `survey` is the date of the new survey, `roofs_outside` are roofs outside all outlines as
    parameters.jsonl holds them.
    """

    survey: str
    roofs_outside: tuple[Values, ...] = ()


@dataclass(frozen=True)
class FileHead:
    """What the files of a run have in common.

    It is the CRS (anything pyproj understands, or None), the unit of coordinates without one (a key
    of read.crs.NAMED_UNITS), the offset (3,) of the CityJSON file, None where its first building
    sets it, how solids are composed, what is written of buildings, what goes before roofer's
    attribute names, the date that CityGML gives its buildings, if any, and what an update found
    beside its buildings, None for a run that is no update. `sky` names that of enriched buildings,
    `scale` is the grid to which CityJSON rounds coordinates, in its unit.
    """

    crs: Any = None
    unit: str = "auto"
    offset: np.ndarray | None = None
    compose: ComposeSettings = field(default_factory=ComposeSettings)
    write: WriteSettings = field(default_factory=WriteSettings)
    prefix: str = PREFIX
    creation_date: datetime.date | None = None
    update: UpdateHead | None = None
    sky: str = ""
    scale: float = 0.0001  # on which solids are composed

    @functools.cached_property
    def units(self) -> FileUnits:
        """Units of the coordinates in each file, and the way to its CRS."""
        from ..read.crs import find_units, parse_crs

        units = find_units(parse_crs(self.crs), "the models", self.unit)
        return FileUnits.of(self.crs, units, self.write.out_crs)

    @functools.cached_property
    def crs_of_files(self) -> Any:
        """The CRS that files name, `--out-crs` or the run's, which parameters stay in."""
        from .reprojected import choose_file_crs

        return choose_file_crs(self.crs, self.write.out_crs) if self.write.out_crs else self.crs
