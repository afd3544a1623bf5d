"""A building's texts, kept until they are joined into the files of a run.

A work tile's buildings are one file of plain arrays: bytes one after the other with the ends of
each, and numbers. A file that somebody else could have written is only ever read as data.
"""

from __future__ import annotations

import functools
import itertools
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..data_files import Values
from ..errors import OutputError
from ..model import Building, Solid
from ..model.roof_figures import RoofFigures, roof_figures
from .building_attributes import building_attributes
from .head import FileHead
from .shapes import Shapes, make_shapes

NOTHING = (np.nan,) * 6
EXTENT, ENDS = ".extent", ".ends"


@dataclass(frozen=True)
class Sheet:
    """A building with all from which its texts are made.

    It has the `figures` of its solid (None without one), its `attributes`, what the files of its
    run have in common, and its names in CityJSON and in GML. `surfaces` are further attributes of
    the solid's faces, by face; `extension` is what ends the building in CityGML 2.0.
    """

    building: Building
    figures: RoofFigures | None
    attributes: Values
    head: FileHead
    name: str = ""
    gml_name: str = ""
    surfaces: dict[int, Values] = field(default_factory=dict)
    extension: str = ""

    @functools.cached_property
    def shapes(self) -> Shapes:
        """What is drawn of the building beside its own solid."""
        return make_shapes(self.building, self.figures, self.head.write, self.head.prefix)

    @functools.cached_property
    def finest(self) -> tuple[Solid, RoofFigures]:
        """The solid of LoD2.3 with its figures; those of LoD2.2 where they are the same."""
        solid = self.building.model.finest_solid
        if self.figures is not None and solid is self.building.solid:
            return solid, self.figures
        return solid, roof_figures(solid)

    @functools.cached_property
    def boxes(self) -> tuple[Solid, ...]:
        """The building's installations as solids of LoD2, in the world."""
        model = self.building.built
        if model is None or not model.installations or not self.head.write.has_lod2:
            return ()
        from ..compose.blocks import make_box

        origin = model.roof.frame.origin
        return tuple(make_box(installation).move(origin) for installation in model.installations)


def describe(
    building: Building,
    figures: RoofFigures | None,
    head: FileHead,
    name: str = "",
    gml_name: str = "",
) -> Sheet:
    """Return the sheet of a building with the `figures` of its solid, and its attributes."""
    attributes = building_attributes(
        building, figures, head.prefix, head.units.gml, head.write.osm_tags
    )
    return Sheet(building, figures, attributes, head, name, gml_name)


@dataclass(frozen=True)
class Fragment:
    """A building's bytes in a run's file, and their extent (low x y z, high x y z) or None."""

    text: bytes
    extent: tuple[float, ...] | None = None


Fragments = dict[str, Fragment]  # one building's texts by the module that made them


def save_fragments(file: BinaryIO, parts: Sequence[Fragments]) -> None:
    """Write the buildings `parts` to `file`, without compression."""
    arrays: Values = {}
    for kind in parts[0] if parts else ():
        items = [part[kind] for part in parts]
        arrays[kind] = np.frombuffer(b"".join(fragment.text for fragment in items), np.uint8)
        arrays[kind + ENDS] = np.cumsum([len(fragment.text) for fragment in items], dtype=np.int64)
        arrays[kind + EXTENT] = np.array([fragment.extent or NOTHING for fragment in items], float)
    np.savez(file, **arrays)


def load_fragments(path: Path) -> Iterator[Fragments]:
    """Load buildings of `save_fragments`; raises OutputError for a file that is not whole."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            kinds = [name for name in arrays.files if not name.endswith((ENDS, EXTENT))]
            columns = [
                column(arrays[kind], arrays[kind + ENDS], arrays[kind + EXTENT]) for kind in kinds
            ]
            for items in zip(*columns, strict=True):
                yield dict(zip(kinds, items, strict=True))
    except (OSError, EOFError, ValueError, TypeError, KeyError, zipfile.BadZipFile) as error:
        raise OutputError(
            f"expected a work tile's buildings in {path}, got: {error}; begin anew with --restart"
        ) from error


def column(joined: np.ndarray, ends: np.ndarray, extents: np.ndarray) -> list[Fragment]:
    """Split joined texts (n,) at their `ends`, each with its extent (b, 6)."""
    content, starts = joined.tobytes(), [0, *ends.tolist()]
    texts = [content[start:end] for start, end in itertools.pairwise(starts)]
    extents_or_none = [
        None if np.isnan(extent[0]) else tuple(extent) for extent in extents.tolist()
    ]
    return [Fragment(text, extent) for text, extent in zip(texts, extents_or_none, strict=True)]
