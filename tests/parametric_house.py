"""A gable of 12 by 8 m, built of its parameters."""

import hiproof


def gable_house():
    ring = [[-6, -4], [6, -4], [6, 4], [-6, 4], [-6, -4]]
    part = {"type": "gable", "parameters": {"width": 8, "length": 12, "height": 3}, "position": [0, 0, 5]}
    place = {"origin": [85000, 446000, 2], "outline": [ring], "z_ground": 2}
    return hiproof.build({"id": "a", **place, "parts": [part]})
