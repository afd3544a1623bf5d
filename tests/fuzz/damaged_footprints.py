"""Footprints as they should not be, each with the status that its building must come to; a sound
one lies beside each.
"""

import json
from pathlib import Path

import numpy as np
import shapely

from tiny_town import ORIGIN

# the tiny town's second house
SOUND_IN_THE_WORLD = shapely.box(*ORIGIN[:2] + [38, 12], *ORIGIN[:2] + [51, 21])
CORNERS = [(8, 12), (20, 12), (20, 20), (8, 20), (8, 12)]  # its first


def wavy(vertices: int, seed: int = 0) -> np.ndarray:
    """A valid ring (n, 2) about the first house, rough by two centimetres."""
    angle = np.linspace(0, 2 * np.pi, vertices, endpoint=False)
    radius = (
        5 + 0.3 * np.sin(8 * angle) + np.random.default_rng(seed).uniform(-0.02, 0.02, vertices)
    )
    return np.array([14, 16]) + np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def zigzag(crossings: int) -> np.ndarray:
    """A ring (n, 2) whose two sides cross so often."""
    x, side = np.linspace(8, 20, crossings + 1), np.where(np.arange(crossings + 1) % 2, 1.0, -1.0)
    return np.concatenate([np.column_stack([x, 16 + side]), np.column_stack([x, 16 - side])[::-1]])


def star(points: int) -> np.ndarray:
    """A ring (n, 2) every edge of which crosses nearly every other."""
    angle = np.pi * (points - 1) / points * np.arange(points)
    return np.array([14, 16]) + 4 * np.column_stack([np.cos(angle), np.sin(angle)])


def stretch(place: int, x: float) -> list:
    """The first house with one corner's x moved."""
    return [
        (x, y) if number in (place, (place + 4) % 8) else (x0, y)
        for number, (x0, y) in enumerate(CORNERS)
    ]


ODD = {
    "1e15 m wide": (stretch(1, 1e15), "bad_footprint"),
    "1e300 m wide": (stretch(1, 1e300), "bad_footprint"),
    "10 km wide": (stretch(1, 10_000.0), "bad_footprint"),
    "one point": (CORNERS[:1] * 4, "bad_footprint"),
    "two points": ([*CORNERS[:2], CORNERS[0]], "bad_footprint"),
    "on a line": ([(8, 12), (20, 12), (14, 12), (8, 12)], "bad_footprint"),
    "2,000 crossings": (zigzag(2000), "bad_footprint"),
    "80,000 crossings": (star(401), "bad_footprint"),
    "10,000 vertices": (wavy(10_000), "modelled"),
}
"""(ring about the town's origin, status) by name."""


def write_beside_a_sound_one(path: Path) -> Path:
    """A GeoJSON file of all odd footprints and one called "sound"."""
    sound = shapely.get_coordinates(SOUND_IN_THE_WORLD)
    rings = {name: np.asarray(ring, float) + ORIGIN[:2] for name, (ring, _) in ODD.items()}
    rings["sound"] = sound
    features = [
        {
            "type": "Feature",
            "properties": {"id": id},
            "geometry": {"type": "Polygon", "coordinates": [xy.tolist()]},
        }
        for id, xy in rings.items()
    ]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::28992"}}
    path.write_text(
        json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}),
        encoding="utf-8",
    )
    return path
