"""A small finished run written by hand, not by our writers: a gable, a block with a courtyard, one
without model.
"""

import json
from dataclasses import replace
from functools import partial

import numpy as np

from handmade import courtyard, gable_house
from hiproof.model import GROUND, ROOF, WALL, Solid
from hiproof.write.meshes.viewed import ViewedModel

ORIGIN = np.array([85000.0, 446000.0, 0.0])


gable_solid = partial(gable_house, eave=4.0)
courtyard_solid = partial(courtyard, side=20.0, yard=8.0, height=9.0)


def two_parts(id="pair"):
    """A model whose roof faces belong to a gable and a hip."""
    solid = gable_solid()
    roofs = solid.select_faces(ROOF)
    faces = [replace(f, part=roofs.index(f)) if f in roofs else f for f in solid.faces]
    return ViewedModel(
        id, "gable", Solid(solid.vertices + ORIGIN, tuple(faces)), {}, {0: "gable", 1: "hip"}
    )


SOLIDS = {
    "house-1": ("gable", gable_solid()),
    "block 2": ("flat", courtyard_solid().move(np.array([30.0, 0, 0]))),
}


def write_sample_run(folder):
    """Write the sample as `buildings.city.jsonl` and `run.json`; the solids in world coordinates by
    id.
    """
    folder.mkdir(parents=True, exist_ok=True)
    transform = {"scale": [0.0001] * 3, "translate": ORIGIN.tolist()}
    metadata = {"referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/7415"}
    head = {"type": "CityJSON", "version": "2.0", "transform": transform, "metadata": metadata}
    lines = [{**head, "CityObjects": {}, "vertices": []}]
    lines += [feature(id, kind, solid) for id, (kind, solid) in SOLIDS.items()]
    empty = {
        "type": "Building",
        "attributes": {"hiproof_status": "no_points", "hiproof_roof_type": None},
    }
    lines.append(
        {"type": "CityJSONFeature", "id": "bare", "CityObjects": {"bare": empty}, "vertices": []}
    )
    (folder / "buildings.city.jsonl").write_text("\n".join(map(json.dumps, lines)) + "\n")
    run = {
        "version": "0.1.0",
        "settings": {"fit": {"objective": "likelihood"}},
        "counts": {"modelled": 2, "no_points": 1},
    }
    (folder / "run.json").write_text(json.dumps(run))
    return {id: solid.move(ORIGIN) for id, (_, solid) in SOLIDS.items()}


def feature(id, kind, solid):
    surfaces = [{"type": name} for name in (ROOF, WALL, GROUND)]
    values = [[(ROOF, WALL, GROUND).index(face.kind) for face in solid.faces]]
    geometry = {
        "type": "Solid",
        "lod": "2.2",
        "boundaries": [[[list(ring) for ring in face.rings] for face in solid.faces]],
        "semantics": {"surfaces": surfaces, "values": values},
    }
    attributes = {
        "hiproof_status": "modelled",
        "hiproof_roof_type": kind,
        "rf_volume_lod22": 1.0,
        "note": None,
    }
    city_object = {"type": "Building", "attributes": attributes, "geometry": [geometry]}
    vertices = np.round(solid.vertices / 0.0001).astype(int).tolist()
    return {
        "type": "CityJSONFeature",
        "id": id,
        "CityObjects": {id: city_object},
        "vertices": vertices,
    }


def sample_points(seed=0, noise=0.02, density=4.0):
    """Points (n, 3) in the world on the roofs of both sample solids, with vertical noise."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 8, int(96 * density)), rng.uniform(0, 12, int(96 * density))
    gable = np.column_stack([x, y, 7 - 0.75 * np.abs(x - 4)])
    x, y = rng.uniform(0, 20, int(400 * density)), rng.uniform(0, 20, int(400 * density))
    block = np.column_stack([x + 30, y, np.full(len(x), 9.0)])[
        (np.abs(x - 10) > 4) | (np.abs(y - 10) > 4)
    ]
    points = np.concatenate([gable, block])
    points[:, 2] += rng.normal(0, noise, len(points))
    return points + ORIGIN


def write_scanned_run(folder):
    """Write the sample and its points; return the folder."""
    write_sample_run(folder)
    np.savetxt(folder / "points.xyz", sample_points(), fmt="%.3f")
    return folder
