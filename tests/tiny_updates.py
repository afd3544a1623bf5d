"""Updates of a run over the tiny town."""

import dataclasses

import numpy as np
import shapely

from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.update.request import UpdateRequest
from hiproof.update.run import update_area
from run_records import by_id
from tiny_town import ORIGIN, make_town, write_cloud, write_footprints


def make_run(folder):
    """Return the folder of a run over the tiny town."""
    town = make_town(density=8.0)
    cloud = write_cloud(folder / "first.laz", town.xyz, town.classification)
    outlines = write_footprints(folder / "outlines.geojson", town.footprints)
    reconstruct_area(Request((str(cloud),), folder / "models", str(outlines), id_attribute="id"))
    return folder / "models"


def update(run, out, town, changes=None, **options):
    cloud = str(write_cloud(out.with_suffix(".laz"), town.xyz, town.classification))
    parameters = str(run / "parameters.jsonl")
    request = UpdateRequest((cloud,), out, run=run, run_parameters=parameters, date="2024-05-01")
    update_area(dataclasses.replace(request, **options), changes)
    return by_id(out)


def lay_bare(town, id, kept, code=2):
    """Pull down the eastern end of a house, now ground of a class; return its area."""
    x0, y0, x1, y1 = town.footprints[id].bounds
    end = shapely.box(x0 + kept * (x1 - x0), y0, x1, y1)
    gone = shapely.intersects_xy(end, *town.xyz[:, :2].T)
    rng = np.random.default_rng(3)
    town.xyz[gone, 2] = ORIGIN[2] + 0.01 * (town.xyz[gone, 0] - ORIGIN[0])
    town.xyz[gone, 2] += rng.normal(0, 0.03, gone.sum())
    town.classification[gone] = code
    return end.area


def take_kind(row):
    change = row.get("change")
    return "unchanged" if change is None else (change["places"] or [{"kind": None}])[0]["kind"]
