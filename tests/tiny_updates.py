"""Updates of runs over the tiny town."""

import dataclasses
import json
import shutil

import numpy as np
import shapely

from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.update.request import UpdateRequest
from hiproof.update.run import update_area
from run_records import by_id
from tiny_town import ORIGIN, write_footprints

DATE = "2024-05-01"


def run_over(folder, town, shift=0.0):
    """Return the folder of a run over a town."""
    cloud = town.write(folder / "first.laz", shift)
    outlines = write_footprints(folder / "outlines.gpkg", town.footprints)
    reconstruct_area(Request((cloud,), folder / "models", str(outlines), id_attribute="id"))
    return folder / "models"


def lose_clouds(run, folder):
    """Return a copy of a run whose clouds are gone."""
    run = shutil.copytree(run, folder / "run")
    record = json.loads((run / "run.json").read_text())
    record["inputs"]["clouds"] = ["gone.laz"]
    (run / "run.json").write_text(json.dumps(record))
    return run


def make_request(run, cloud, out, **options):
    """Return the request of an update of a run by a cloud."""
    parameters = str(run / "parameters.jsonl")
    request = UpdateRequest((cloud,), out, run=run, run_parameters=parameters, date=DATE)
    return dataclasses.replace(request, **options)


def update(run, out, town, changes=None, **options):
    """Update a run by a town's points; return the rows by id."""
    cloud = town.write(out.with_suffix(".laz"))
    update_area(make_request(run, cloud, out, **options), changes)
    return by_id(out)


def lay_bare(town, id, kept, code=2):
    """Pull down the eastern end of a house, now ground of a class; return its area."""
    x0, y0, x1, y1 = town.footprints[id].bounds
    end = shapely.box(x0 + kept * (x1 - x0), y0, x1, y1)
    gone = town.lie_in(end)
    rng = np.random.default_rng(3)
    town.xyz[gone, 2] = ORIGIN[2] + 0.01 * (town.xyz[gone, 0] - ORIGIN[0])
    town.xyz[gone, 2] += rng.normal(0, 0.03, gone.sum())
    town.classification[gone] = code
    return end.area


def raise_house(town, id, rise):
    """Raise the roof of a house."""
    town.xyz[town.lie_in(town.footprints[id]) & (town.classification == 6), 2] += rise


def take_kind(row):
    change = row.get("change")
    return "unchanged" if change is None else (change["places"] or [{"kind": None}])[0]["kind"]


def take_class(row):
    return (row.get("change") or {"class": "unchanged"})["class"]
