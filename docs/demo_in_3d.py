"""The site's page of a finished run in 3D, as `hiproof view` shows it.

The run is that of the bundled neighbourhood, updated with a second survey and then under the sun.
Between the surveys nine houses change, each in another way.
"""

from __future__ import annotations

import dataclasses
import math
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from hiproof import Request, reconstruct_area
from hiproof.cli.convert import convert_models
from hiproof.enrich.run import enrich_run
from hiproof.progress import ignore_progress
from hiproof.settings import EnrichSettings
from hiproof.simulate import demo_files
from hiproof.simulate.neighbourhood import DEMO_SEED, ORIGIN_XY, SCAN, neighbourhood
from hiproof.simulate.scene import building_bodies
from hiproof.simulate.survey import Flight, divide_into_patches, survey, write_laz
from hiproof.update.request import UpdateRequest
from hiproof.update.run import update_area
from hiproof.view.server import render_page

SECOND_SURVEY, HEADING_DEG = "2024-05-01", 20.0  # its day, and the direction of its flight lines
DEMO_PAGE = "demo/index.html"


def on_files(files: Any, config: Any) -> Any:
    """Add the page and its tiles; mkdocs calls this."""
    from mkdocs.structure.files import File

    with tempfile.TemporaryDirectory() as folder:
        tiles = make_tiles(Path(folder))
        found = {
            f"{Path(DEMO_PAGE).parent}/{path.relative_to(tiles).as_posix()}": path.read_bytes()
            for path in tiles.rglob("*.*")
        }
    found[DEMO_PAGE] = render_page("hiproof demo: a simulated neighbourhood").encode()
    for name, content in found.items():
        files.append(File.generated(config, name, content=content))
    return files


def make_tiles(folder: Path) -> Path:
    """Run everything in `folder`; returns the 3D Tiles of the result."""
    files, before, after, second = demo_files(), *(folder / name for name in ("1", "2", "2.laz"))
    reconstruct_area(Request((str(files["cloud"]),), before, str(files["footprints"])))
    scan_later(second)
    parameters = str(before / "parameters.jsonl")
    clouds = (str(second),)
    update_area(
        UpdateRequest(clouds, after, run=before, run_parameters=parameters, date=SECOND_SURVEY)
    )
    enrich_run(after, folder / "sun", EnrichSettings(sun=True))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # heights over the globe matter to no picture
        convert_models(folder / "sun", folder / "tiles", "3dtiles", None, ignore_progress)
    return folder / "tiles"


def scan_later(path: Path) -> None:
    """Write the cloud of the second survey."""
    sys.path.append(str(Path(__file__).parents[1]))
    from benchmarks.building_changes import CHANGES, change_building

    lots, terrain = neighbourhood()
    rng, waiting = np.random.default_rng(DEMO_SEED), list(CHANGES)
    for place in rng.permutation(len(lots)):
        lot = lots[place]
        for kind in waiting:
            building = change_building(rng, lot.building, kind)
            if building is not None:
                bodies = tuple(building_bodies(building))
                lots[place] = dataclasses.replace(lot, building=building, bodies=bodies)
                waiting.remove(kind)
                break
    bounds = np.array([lot.building.footprint.bounds for lot in lots])
    lower, upper = bounds[:, :2].min(axis=0) - 8.0, bounds[:, 2:].max(axis=0) + 8.0
    flight = Flight(math.radians(HEADING_DEG), ORIGIN_XY - 250.0)
    patches = divide_into_patches((*lower, *upper))
    clouds = survey(patches, lots, terrain, flight, DEMO_SEED + 1, SCAN)
    write_laz(path, clouds, np.array([*lower, 0.0]))
