"""A finished run with its points, for `hiproof evaluate` and `report`."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..data_files import read_data_file
from ..errors import InputError, InputWarning, SettingsError
from ..frames import Units
from ..read.crs import find_units, parse_crs
from ..read.models.cityjson import parse_object, read_text
from ..read.models.damage import Damaged, excerpt, refuse
from ..settings import Settings
from ..status import Attention
from ..write.attribute_list import OWN
from ..write.naming import FileUnits
from .evaluation import (
    BuildingFigures,
    evaluate_building,
    match_by_id_or_overlap,
    points_by_outline,
)
from .inputs import RunSurvey, found_inputs, refuse_other_surveys
from .metrics import plan_outline
from .models import BuildingModel, read_models, run_models

NUMBER = (int, float)
# What data/run.toml says of values of run.json.
KINDS: dict[str, Any] = {
    "an object": dict,
    "a list": list,
    "text": str,
    "text or a number": (str, int),
    "a finite number": NUMBER,
}


@dataclass(frozen=True)
class EvaluatedRun:
    """Models in the run's order, with their points and figures.

    Points (n, 3) are in world metres; `record` is run.json. `footprints` are plan polygons in world
    metres, None where a building has none; `clouds` the files measured against.
    """

    models: tuple[BuildingModel, ...]
    points: tuple[np.ndarray, ...]
    figures: tuple[BuildingFigures, ...]
    record: dict[str, Any]
    footprints: tuple[shapely.Geometry | None, ...]
    clouds: tuple[str, ...] = ()

    def only(self, indices: Sequence[int]) -> EvaluatedRun:
        """Return the same run with only these buildings."""
        columns: tuple[Any, ...] = (self.models, self.points, self.figures, self.footprints)
        models, points, figures, footprints = (tuple(c[i] for i in indices) for c in columns)
        return EvaluatedRun(models, points, figures, self.record, footprints, self.clouds)


def evaluate_run(
    folder: Path,
    clouds: Sequence[str] = (),
    footprints: str | None = None,
    reference: str | None = None,
    layer: str | int | None = None,
    damaged: Damaged = refuse,
    must_be_valid: bool = False,
) -> EvaluatedRun:
    """Measure the models of `folder` against `clouds` and `footprints`.

    Where none are named, they are those that the run was made from, as far as they exist. Without
    any clouds there are no residual figures.

    The building classes, the CRS and the units are those the run was made with; `layer` is that of
    the footprints. A damaged building, with `must_be_valid` one with an invalid solid too, is told
    to `damaged`, which refuses the run by default, and has no solid. Raises InputError for what
    cannot be read.
    """
    record = run_record(folder)
    inputs = found_inputs(record)
    if not clouds and inputs.gone:
        text = (
            "measured against the others alone"
            if inputs.local_surveys
            else "nothing to measure against"
        )
        warnings.warn(
            f"{folder}: {inputs.told_gone}, {text}; name them after the folder", InputWarning
        )
    surveys = inputs.local_surveys
    if clouds:
        surveys = [RunSurvey("", tuple(clouds), np.zeros(3))]
    options: dict[str, Any] = {}
    if footprints is None:
        footprints, layer = inputs.footprint_file, layer or inputs.layer
        options = {"id_attribute": inputs.id_attribute, "where": inputs.where, "bbox": inputs.bbox}
    models = tuple(
        read_models(
            run_models(folder), run_units(record), way_to_models(record), damaged, must_be_valid
        )
    )
    outlines = match_footprints(models, footprints, layer, record, options)
    areas = [
        outline if outline is not None else outline_of_solid(m)
        for m, outline in zip(models, outlines, strict=True)
    ]
    if surveys and any(area is not None for area in areas):
        points = collect_points(surveys, record, models, areas)
    else:
        points = [np.empty((0, 3))] * len(models)
    references = match_references(models, reference)
    figures = [
        evaluate_building(*row) for row in zip(models, points, outlines, references, strict=True)
    ]
    clouds = tuple(cloud for survey in surveys for cloud in survey.clouds)
    return EvaluatedRun(models, tuple(points), tuple(figures), record, tuple(outlines), clouds)


def run_record(folder: Path) -> dict[str, Any]:
    """Read run.json, empty without one; raises InputError where it is no record of a run."""
    path = Path(folder) / "run.json"
    record = parse_object(read_text(path), f"the record of a run, {path}") if path.is_file() else {}
    try:
        refuse_other_kinds(record)
        run_settings(record)
        run_crs(record)
        parse_crs(run_out_crs(record))
    except (InputError, SettingsError) as error:
        raise InputError(
            f"{path}: {error!s:.400}; mend it there, or run `hiproof reconstruct` again"
        ) from error
    return record


def list_run_inputs(run: Path) -> list[str]:
    """Return the files that a run was made of, by its folder or a file in it."""
    try:
        inputs = found_inputs(run_record(run if run.is_dir() else run.parent))
    except InputError:
        return []  # of another program, or damaged, which those who read it say
    files = (*inputs.clouds, inputs.footprints, inputs.terrain, inputs.overrides)
    return [file for file in files if file]


def refuse_other_kinds(record: dict[str, Any]) -> None:
    """Raise InputError where a value of the record is no such as data/run.toml says."""
    kinds = read_data_file("run")["record"] | {
        f"summary.needs_attention.{kind.code}": "a finite number" for kind in Attention
    }
    for place, text in kinds.items():
        value: Any = record
        for name in place.split("."):
            value = value.get(name) if value is not None else None
        is_odd = isinstance(value, bool) or (isinstance(value, float) and not math.isfinite(value))
        if value is not None and (is_odd or not isinstance(value, KINDS[text])):
            text = text.removesuffix(" or a number")
            raise InputError(f"expected {text} as {place}, got {excerpt(value)}")
    refuse_other_surveys(record)
    bbox = (record.get("inputs") or {}).get("bbox")
    if bbox and (len(bbox) != 4 or not all(type(side) in NUMBER for side in bbox)):
        raise InputError(f"expected four numbers as inputs.bbox, got {excerpt(bbox)}")


def run_settings(record: dict[str, Any]) -> Settings:
    """Return the settings of a run, as far as this version has them."""
    read = (record.get("settings") or {}).get("read") or {}
    overrides = {name: read[name] for name in ("building_classes", "crs", "unit") if read.get(name)}
    return Settings.from_dict({"read": overrides})


def run_crs(record: dict[str, Any]) -> Any:
    """Return the pyproj CRS of a run, None where it has none."""
    return parse_crs(record.get("crs"))


def collect_points(
    surveys: Sequence[RunSurvey],
    record: dict[str, Any],
    models: Sequence[BuildingModel],
    areas: Sequence[Any],
) -> list[np.ndarray]:
    """Return points (n, 3) of each model, of the surveys it names, their shifts taken off."""
    result = [[np.empty((0, 3))] for _ in models]
    for survey in surveys:
        xyz = building_points(survey.clouds, record, areas) - survey.shift
        found = points_by_outline(xyz, areas)
        for model, points, chosen in zip(models, found, result, strict=True):
            used = model.text(f"{OWN}epochs_used").split()
            if not (used and survey.name) or survey.name in used:
                chosen.append(points)
    return [np.concatenate(chosen) for chosen in result]


def building_points(
    clouds: Sequence[str], record: dict[str, Any], areas: Sequence[Any]
) -> np.ndarray:
    """Return points (n, 3) around `areas`: of building classes, or all without classes."""
    from ..read.points.pointcloud import expand_paths, read_points, refuse_other_crs

    settings = run_settings(record)
    if not settings.read.crs:
        refuse_other_crs(expand_paths(tuple(clouds)), run_crs(record), "the run")
        settings = settings.replace({"read": {"crs": record.get("crs") or ""}})
    box = shapely.total_bounds(np.array([area for area in areas if area is not None], dtype=object))
    cloud = read_points(
        *clouds, settings=settings, box=tuple(box) if np.isfinite(box).all() else None
    )
    if cloud.classification is None or not cloud.classification.any():
        return cloud.xyz
    return cloud.xyz[np.isin(cloud.classification, settings.read.building_classes)]


def match_footprints(
    models: Sequence[BuildingModel],
    path: str | None,
    layer: str | int | None,
    record: dict[str, Any],
    options: dict[str, Any],
) -> list[Any]:
    """Return the footprint of each model, or None; `options` go to `read_footprints`."""
    if path is None:
        return [None] * len(models)
    from ..read.outlines.footprints import read_footprints

    footprints = read_footprints(
        path, layer, target_crs=run_crs(record), settings=run_settings(record), **options
    )
    areas = [(f.id, shapely.make_valid(f.polygon)) for f in footprints]
    matches = match_by_id_or_overlap(models, areas)
    return [None if match is None else areas[match][1] for match in matches]


def run_units(record: dict[str, Any]) -> Units:
    """Return the units of a run's coordinates; metres where they are unknown."""
    return find_units(run_crs(record), "the run", run_settings(record).read.unit)


def way_to_models(record: dict[str, Any]) -> Units | None:
    """Return the units that lead from a run's metres to its models, None for the same CRS."""
    out_crs = run_out_crs(record)
    return FileUnits.of(run_crs(record), run_units(record), out_crs).cityjson if out_crs else None


def run_out_crs(record: dict[str, Any]) -> str:
    """Return the CRS in which the run wrote, empty where it is that of its clouds."""
    return ((record.get("settings") or {}).get("write") or {}).get("out_crs") or ""


def match_references(
    models: Sequence[BuildingModel], path: str | None
) -> list[BuildingModel | None]:
    """Return the reference building of each model; logs one line where there is none."""
    if path is None:
        return [None] * len(models)
    neighbours = [
        (model, outline)
        for model in read_models(path)
        if (outline := outline_of_solid(model)) is not None
    ]
    matches = match_by_id_or_overlap(models, [(other.id, outline) for other, outline in neighbours])
    if models and not any(match is not None for match in matches):
        warnings.warn(
            f"{path}: no building of it stands where one of the run does; check its CRS",
            InputWarning,
        )
    return [None if match is None else neighbours[match][0] for match in matches]


def outline_of_solid(model: BuildingModel) -> shapely.Geometry | None:
    return None if model.solid is None else plan_outline(model.solid)
