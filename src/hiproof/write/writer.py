"""The life of an output file: opened, given building after building, finished, then seen."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Iterable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from typing import Any, BinaryIO, Self

import numpy as np

from ..model import Building
from .building_attributes import measure_figures
from .files import atomic_file
from .fragments import Fragment, Sheet, describe
from .head import FileHead
from .naming import UniqueNames, gml_name
from .values import plain_text


class BuildingWriter(AbstractContextManager["BuildingWriter", bool | None]):
    """Base of the incremental writers.

    Use it as `with Writer(path, head) as writer: writer.add(sheet)`. The file appears when the
    block ends well; after an exception nothing is left and an older file stays. A format fills in
    `begin`, `fragment`, `put` and `finish`.
    """

    file: BinaryIO

    def __init__(self, path: str | os.PathLike[str], head: FileHead) -> None:
        self.path, self.head = path, head
        self.names, self.gml_names = UniqueNames(), UniqueNames()
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)

    def add_all(self, buildings: Iterable[Building]) -> None:
        """Write the file with all these buildings."""
        with self:
            for building in buildings:
                self.add(describe(building, measure_figures(building), self.head))

    def begin(self, stack: ExitStack) -> None:
        """Write what precedes the first building; `stack` closes what is opened beside the file."""

    def add(self, sheet: Sheet) -> None:
        """Write one building, under a name that no earlier one has."""
        id = sheet.building.id
        name, in_gml = self.names.take(plain_text(id)), self.gml_names.take(gml_name(id))
        self.put(self.fragment(replace(sheet, head=self.head, name=name, gml_name=in_gml)))

    @staticmethod
    @abstractmethod
    def fragment(sheet: Sheet) -> Fragment:
        """Return a building's part of the file, made here or in another process."""

    def extend(self, fragment: Fragment) -> None:
        """Take a building's part into the extent of the file, from `low` to `high` (3,)."""
        if fragment.extent is not None:
            self.low = np.minimum(self.low, fragment.extent[:3])
            self.high = np.maximum(self.high, fragment.extent[3:])

    @abstractmethod
    def put(self, fragment: Fragment) -> None:
        """Write a building's part."""

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
