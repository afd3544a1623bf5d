"""A gable, of 12 by 8 m unless it is asked for otherwise, built of its parameters."""

import shapely
from shapely import affinity

import hiproof


def gable_house(rotation=0.0, width=8.0, length=12.0, eave=5.0):
    """The house, its ridge turned by `rotation` (degrees) from the x axis; lengths in metres."""
    box = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    ring = shapely.get_coordinates(affinity.rotate(box, rotation)).tolist()
    part = {
        "type": "gable",
        "parameters": {"width": width, "length": length, "height": 3},
        "position": [0, 0, eave],
    }
    part |= {"rotation": rotation}
    place = {"origin": [85000, 446000, 2], "outline": [ring], "z_ground": 2}
    return hiproof.build({"id": "a", **place, "parts": [part]})
