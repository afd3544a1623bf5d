"""A gable of 12 by 8 m, built of its parameters."""

import shapely
from shapely import affinity

import hiproof


def gable_house(rotation=0.0):
    """The house, its ridge turned by `rotation` (degrees) from the x axis."""
    ring = shapely.get_coordinates(affinity.rotate(shapely.box(-6, -4, 6, 4), rotation)).tolist()
    part = {
        "type": "gable",
        "parameters": {"width": 8, "length": 12, "height": 3},
        "position": [0, 0, 5],
    }
    part |= {"rotation": rotation}
    place = {"origin": [85000, 446000, 2], "outline": [ring], "z_ground": 2}
    return hiproof.build({"id": "a", **place, "parts": [part]})
