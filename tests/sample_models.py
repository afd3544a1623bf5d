"""A small finished run written by hand, not by our writers: a gable, a block with a courtyard, one
without model.
"""

import json
from dataclasses import replace

import numpy as np

from hiproof.model import GROUND, ROOF, WALL, Face, Solid
from hiproof.write.meshes.viewed import ViewedModel

ORIGIN = np.array([85000.0, 446000.0, 0.0])


def gable_solid(width=8.0, length=12.0, eave=4.0, ridge=7.0):
    """A gable whose ridge runs along y, standing on z = 0 at the origin."""
    w, l = width, length
    xyz = [(0, 0, 0), (w, 0, 0), (w, l, 0), (0, l, 0)]
    xyz += [
        (0, 0, eave),
        (w, 0, eave),
        (w, l, eave),
        (0, l, eave),
        (w / 2, 0, ridge),
        (w / 2, l, ridge),
    ]
    roof = [(4, 8, 9, 7), (8, 5, 6, 9)]
    walls = [(0, 1, 5, 8, 4), (1, 2, 6, 5), (2, 3, 7, 9, 6), (3, 0, 4, 7)]
    faces = [Face((ring,), ROOF, 0) for ring in roof] + [Face((ring,), WALL) for ring in walls]
    return Solid(np.array(xyz, float), (*faces, Face(((3, 2, 1, 0),), GROUND)))


def courtyard_solid(side=20.0, yard=8.0, height=9.0):
    """A flat-roofed block around a square courtyard."""
    a, b = (side - yard) / 2, (side + yard) / 2
    plan = [(0, 0), (side, 0), (side, side), (0, side), (a, a), (b, a), (b, b), (a, b)]
    xyz = np.array([(x, y, z) for z in (0.0, height) for x, y in plan])
    outer = [Face(((i, (i + 1) % 4, (i + 1) % 4 + 8, i + 8),), WALL) for i in range(4)]
    inner = [Face(((i + 4, i + 12, (i + 1) % 4 + 12, (i + 1) % 4 + 4),), WALL) for i in range(4)]
    roof = Face(((8, 9, 10, 11), (15, 14, 13, 12)), ROOF, 0)
    return Solid(xyz, (roof, *outer, *inner, Face(((3, 2, 1, 0), (4, 5, 6, 7)), GROUND)))


def two_parts(id="pair"):
    """A model whose roof faces belong to a gable and a hip."""
    solid = gable_solid()
    faces = [
        replace(face, part=index) if face.kind == ROOF else face
        for index, face in enumerate(solid.faces)
    ]
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
    """Points (n, 3) in world coordinates on the roofs of both sample solids, with vertical
    noise.
    """
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
