"""The finished models of a run's folder with all that is told of them: attributes, parameters, the
CRS."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..evaluate.models import read_models, run_models
from ..evaluate.run import run_crs, run_out_crs, run_record, run_units
from ..formats import FORMATS
from ..parametric.file import DAMAGED, opened_parameters
from ..parametric.record import refuse_other_kinds
from ..read.cityjson import documents, reference_system
from ..read.damage import Damaged, refuse
from ..write.meshes.viewed import ViewedModel, merge_values
from ..write.parameters import crs_text
from ..write.reprojected import choose_file_crs

SHOWN_PART_KEYS = ("type", "parameters", "position", "rotation")


def run_crs_text(folder: Path) -> str | None:
    """The CRS of the run in `folder`, heights included where they are known; None where it has
    none."""
    header, _ = next(documents(run_models(folder)))
    record = run_record(folder)
    return crs_text(choose_file_crs(run_crs(record), run_out_crs(record))) or reference_system(
        header
    )


def run_buildings(folder: Path, damaged: Damaged = refuse) -> Iterator[ViewedModel]:
    """The run's buildings that have a solid.

    Among the attributes are the `parameters` of the roof as JSON, where the folder has them. A
    building that is damaged in either file is told to `damaged`, which refuses the run by default,
    and left out. Raises InputError for what cannot be read.
    """
    path, records = Path(folder) / FORMATS["parameters"].file, None
    units = run_units(run_record(folder))
    with ExitStack() as stack:
        if path.is_file():
            _, records = stack.enter_context(opened_parameters(path, damaged))
        for model in read_models(run_models(folder), units, damaged=damaged, must_be_valid=True):
            attributes = model.attributes
            if records is not None:  # a line a building, in the order of the models
                record = next(records, {})
                if model.is_damaged or record is DAMAGED:
                    continue
                refuse_other_run(record, model.id, path)
                try:
                    attributes = merge_values({"parameters": parameters_text(record)}, attributes)
                except InputError as error:
                    damaged(InputError(f"building {model.id:.80} in {path}: {error}"))
                    continue
            if model.solid is not None:
                yield ViewedModel(
                    model.id, model.roof_type, model.solid, attributes, model.part_types
                )


def refuse_other_run(record: dict[str, Any], id: str, path: Path) -> None:
    """Raise InputError where `record` of the parameters is of another building than `id`, whose
    model stands in its place."""
    record_id = str(record.get("id"))
    if id != record_id and not id.startswith(
        f"{record_id}.."
    ):  # where an id comes twice, models number it
        raise InputError(
            f"expected {path} of the same run as the models, got {record_id!r} where these have "
            f"{id!r}; "
            "make both anew with `hiproof build`"
        )


def parameters_text(record: dict[str, Any]) -> str | None:
    """What the parameters say of a building as JSON, its parts without outlines; None where it has
    no parts."""
    refuse_other_kinds(record)
    parts = [
        {name: part.get(name) for name in SHOWN_PART_KEYS} for part in record.get("parts") or ()
    ]
    return (
        json.dumps({"origin": record.get("origin"), "parts": parts}, separators=(",", ":"))
        if parts
        else None
    )
