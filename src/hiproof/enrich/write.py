"""A building's answers as texts for the files of a run."""

from __future__ import annotations

import shapely

from ..formats import import_format, requested_fragments
from ..log import LOGGER
from ..settings import WriteSettings
from ..write.building_attributes import building_attributes, measure_figures
from ..write.fragments import Fragments, Sheet
from ..write.head import FileHead
from ..write.values import plain_text
from .answer import Answers, answer
from .cadastre import Cadastre
from .town import Town

NOT_MADE = ("parameters",)
"""Modules of files that enriched folders do not have: parameters stay the run's."""


def list_kinds(write: WriteSettings) -> list[str]:
    """Return the modules that make a building's part of the enriched files."""
    return [kind for kind in requested_fragments(write) if kind not in NOT_MADE]


def make_fragments(
    town: Town,
    number: int,
    head: FileHead,
    use_attribute: str = "",
    cadastre: Cadastre | None = None,
) -> Fragments:
    """Return the texts of building `number`, with all answers about it.

    A building whose geometry defeats a library stays as it was, and the log says so.
    """
    building = town.read(number)
    try:
        result = answer(town, number, use_attribute, cadastre)
    except (ValueError, shapely.GEOSException) as error:
        LOGGER.warning("building %s was not enriched: %s", building.id, error)
        result = Answers(building, {}, {})
    building, figures = result.building, measure_figures(result.building)
    attributes = building_attributes(
        building, figures, head.prefix, head.units.gml, head.write.osm_tags
    )
    sheet = Sheet(
        building,
        figures,
        attributes | result.attributes,
        plain_text(building.id),
        town.records.name_in_gml(number),
        head,
        result.surfaces,
    )
    return {kind: import_format(kind).fragment(sheet) for kind in list_kinds(head.write)}
