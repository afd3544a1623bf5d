"""The life of an output file.

It is opened, given one building after another, finished, and only then seen.
"""

from __future__ import annotations

import os
from abc import abstractmethod
from contextlib import AbstractContextManager, ExitStack
from typing import Any, BinaryIO, Self

from ..model import Building
from ..model.roof_figures import RoofFigures
from .files import atomic_file
from .fragments import Fragment


class BuildingWriter(AbstractContextManager["BuildingWriter", bool | None]):
    """Base of the incremental writers.

    Use it as `with Writer(path, ...) as writer: writer.add(building)`.

    The file appears when the block ends well; after an exception nothing is left and an older file
    stays. A format fills in `begin`, `add`, `put` and `finish`.
    """

    file: BinaryIO

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path

    def begin(self, stack: ExitStack) -> None:
        """Write what comes before the first building.

        `stack` closes what the format opens beside the file.
        """

    @abstractmethod
    def add(
        self,
        building: Building,
        figures: RoofFigures | None = None,
        attributes: dict[str, Any] | None = None,
    ) -> None:
        """Write one building.

        `figures` are those of its solid, and `attributes` its own, if the caller has them already.
        """

    @abstractmethod
    def put(self, fragment: Fragment) -> None:
        """Write a building whose text the format's `fragment` made.

        It was made here or in another process.
        """

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
