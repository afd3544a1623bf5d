"""What the user asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ..frames import Box
from ..masking import remember
from ..settings import Settings

NO_MATTER = {"decides": "nothing"}
WHICH = {"decides": "which buildings"}
FILES_FIELD = {"names": "files"}


@dataclass(frozen=True)
class Request:
    """A run: point clouds, the folder `out` for the results, and options.

    Clouds are files and addresses.

    `footprints` (file, address or database) with their `layer`, the `id_attribute` that names them,
    an SQL condition `where` and a `bbox` (xmin, ymin, xmax, ymax) in the coordinates of the clouds
    say which buildings there are; without footprints the clouds are split. `terrain` is a raster,
    `overrides` a file of what is known better, `underpasses` a layer of polygons; `processes` work
    on this machine (None: as many as pay, see cores.py), or those of the Dask `scheduler`;
    `restart` begins anew in a folder that holds another run. `epochs` names the survey of each of
    the clouds, where there are several. `use_attribute` is one that the footprints need to have.

    >>> from pathlib import Path
    >>> Request(("tile.laz",), Path("models"), footprints="footprints.gpkg").settings.fit.objective
    'likelihood'
    """

    clouds: tuple[str, ...] = field(metadata=FILES_FIELD)
    out: Path = field(metadata=NO_MATTER)
    footprints: str | None = field(default=None, metadata=WHICH | FILES_FIELD)
    terrain: str | None = field(default=None, metadata=FILES_FIELD)
    id_attribute: str | None = field(default=None, metadata=WHICH)
    layer: str | None = field(default=None, metadata=WHICH)
    settings: Settings = field(default_factory=Settings)
    # the ledger knows them building by building
    overrides: str | None = field(default=None, metadata=NO_MATTER)
    processes: int | None = field(default=1, metadata=NO_MATTER)
    scheduler: str | None = field(default=None, metadata=NO_MATTER)
    restart: bool = field(default=False, metadata=NO_MATTER)
    where: str | None = field(default=None, metadata=WHICH)
    bbox: Box | None = field(default=None, metadata=WHICH)
    underpasses: str | None = field(default=None, metadata=WHICH | FILES_FIELD)
    epochs: tuple[str, ...] = ()
    # of what follows the run, and checked before it
    use_attribute: str | None = field(default=None, metadata=NO_MATTER)

    def __post_init__(self) -> None:
        remember(*self.clouds, self.footprints, self.terrain, self.overrides, self.scheduler)
        remember(self.underpasses)
