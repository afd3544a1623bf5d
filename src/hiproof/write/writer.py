"""The life of an output file: opened, given building after building, finished, then seen."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Iterable
from contextlib import AbstractContextManager, ExitStack
from typing import Any, BinaryIO, Self

from ..model import Building
from ..model.roof_figures import RoofFigures
from .building_attributes import building_attributes, measure_figures
from .files import atomic_file
from .fragments import Fragment, Sheet
from .head import FileHead
from .naming import UniqueNames, gml_name
from .values import plain_text


class BuildingWriter(AbstractContextManager["BuildingWriter", bool | None]):
    """Base of the incremental writers.

    Use it as `with Writer(path, ...) as writer: writer.add(building)`. The file appears when the
    block ends well; after an exception nothing is left and an older file stays. A format fills in
    `begin`, `add`, `put` and `finish`.
    """

    file: BinaryIO

    def __init__(self, path: str | os.PathLike[str], head: FileHead) -> None:
        self.path, self.head, self.units = path, head, head.units.gml
        self.names, self.gml_names = UniqueNames(), UniqueNames()

    def add_all(self, buildings: Iterable[Building]) -> None:
        """Write the file with all these buildings."""
        with self:
            for building in buildings:
                self.add(building)

    def begin(self, stack: ExitStack) -> None:
        """Write what precedes the first building; `stack` closes what is opened beside the file."""

    def add(
        self,
        building: Building,
        figures: RoofFigures | None = None,
        attributes: dict[str, Any] | None = None,
    ) -> None:
        """Write one building, its solid's `figures` and its `attributes` if they are known."""
        figures = figures or measure_figures(building)
        if attributes is None:
            osm = self.head.write.osm_tags
            attributes = building_attributes(building, figures, self.head.prefix, self.units, osm)
        name = self.names.take(plain_text(building.id))
        in_gml = self.gml_names.take(gml_name(building.id))
        self.add_sheet(Sheet(building, figures, attributes, name, in_gml, self.head))

    def add_sheet(self, sheet: Sheet) -> None:
        """Write one building with all from which its text is made."""
        raise NotImplementedError

    @abstractmethod
    def put(self, fragment: Fragment) -> None:
        """Write a building whose text `fragment` made, here or in another process."""

    def finish(self) -> None:
        """Write what comes after the last building."""

    def open(self, stack: ExitStack) -> None:
        self.file = stack.enter_context(atomic_file(self.path))

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self.open(stack)
            self.begin(stack)
            stack.push(lambda kind, error, trace: self.finish() if kind is None else None)
            self.stack = stack.pop_all()
        return self

    def __exit__(self, *failure: Any) -> bool | None:
        return self.stack.__exit__(*failure)
