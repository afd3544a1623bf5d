"""A building's answers as texts for the files of a run."""

from __future__ import annotations

import dataclasses
import json
from typing import NamedTuple

from ..errors import HiproofError, report_error
from ..formats import import_format, requested_fragments
from ..log import LOGGER
from ..model import Building
from ..settings import EnrichSettings, WriteSettings
from ..status import Status
from ..write.attribute_list import OWN
from ..write.building_attributes import building_attributes, measure_figures
from ..write.fragments import Fragment, Fragments, Sheet
from ..write.head import FileHead
from ..write.values import plain_text
from .answer import Answers, answer
from .cadastre import Cadastre
from .energy import write_energy
from .town import Town

NOT_MADE = ("parameters",)
"""Modules of files that enriched folders do not have: parameters stay the run's."""

FAILURE = "failure"
"""Where a building's fragments say why it has no answers, empty where it has."""


class EnrichFailure(NamedTuple):
    """A building that has no answers, with the reason.

    `is_internal` is whether hiproof is to blame rather than the input.
    """

    id: str
    reason: str
    is_internal: bool


def list_kinds(write: WriteSettings) -> list[str]:
    """Return the modules that make a building's part of the enriched files."""
    return [kind for kind in requested_fragments(write) if kind not in NOT_MADE]


def make_fragments(
    town: Town,
    number: int,
    head: FileHead,
    settings: EnrichSettings,
    cadastre: Cadastre | None = None,
) -> Fragments:
    """Return the texts of building `number`, with all answers about it.

    A building that fails stays as it was, and has the reason as an attribute.
    """
    result, failure = answer_or_fail(town, number, settings, cadastre)
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
    if settings.energy_ade:
        sheet = dataclasses.replace(sheet, extension=write_energy(sheet))
    texts = {kind: import_format(kind).fragment(sheet) for kind in list_kinds(head.write)}
    return {**texts, FAILURE: Fragment(json.dumps(failure).encode() if failure else b"")}


def answer_or_fail(
    town: Town, number: int, settings: EnrichSettings, cadastre: Cadastre | None
) -> tuple[Answers, EnrichFailure | None]:
    """Answer all questions about building `number`, or say why not."""
    building = town.read(number)
    if building.built is None and town.records.index.modelled[number]:
        is_internal = building.status is Status.INTERNAL_ERROR
        return leave(building, building.detail, is_internal)
    try:
        return answer(town, number, settings.use_attribute, cadastre), None
    except HiproofError as error:
        return leave(building, str(error), False)
    except Exception as error:
        report = report_error(error)
        LOGGER.debug("building %s was not enriched: %s", building.id, report.trace)
        return leave(building, report.detail, True)


def leave(building: Building, reason: str, is_internal: bool) -> tuple[Answers, EnrichFailure]:
    """Return a building as it was, with the reason why it has no answers."""
    failure = EnrichFailure(plain_text(building.id), reason, is_internal)
    return Answers(building, {f"{OWN}not_enriched": reason}, {}), failure


def read_failure(fragments: Fragments) -> EnrichFailure | None:
    """Return the failure of a building by its fragments, None where it has answers."""
    text = fragments[FAILURE].text
    return EnrichFailure(*json.loads(text)) if text else None
