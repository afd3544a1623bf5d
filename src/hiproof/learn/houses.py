"""Houses for training, closer to real ones: annexes, rows, sheds, cut corners, hips."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from ..frames import turn_points
from ..model import Part
from ..primitives.catalogue import ROUND
from ..simulate.roofs import SimBuilding, assemble, make_part, random_building, random_parameters

ANNEX_TYPES = ("flat", "monopitch", "gable", "hip")
LENGTHS = ("length", "ridge_length", "top_length")
HEIGHTS = ("height", "neck_height", "hip_height", "break_height", "eave_step")
COUNTS = ("teeth",)
AS_LONG_AS_WIDE = ("pyramid", *ROUND)  # A longer one is not built.
LOWEST_EAVE_M = 2.2  # m above the ground; a door fits below
OVERLAP_M = 0.05  # m that an annex reaches into the house, so that no gap opens between them


def training_house(rng: np.random.Generator, type: str, annex_share: float) -> SimBuilding:
    """Draw a building of roof `type`: small, long, low or cut as real ones are.

    A party wall may cut it. `annex_share` of them have one or two smaller parts (porch, extension,
    cross wing) at their sides. The type stays the main roof's.
    """
    building = random_building(rng, type)
    main = building.roof.parts[0]
    if type == "gable" and rng.random() < 0.1:
        main = hip_one_end(rng, main)
    else:
        if type == "hip" and rng.random() < 0.3:
            main = with_short_ridge(rng, main)
        elif type not in AS_LONG_AS_WIDE and rng.random() < 0.2:
            main = lengthen(rng, main)
        if rng.random() < 0.3:
            main = resize(rng, main)
    count = 1 + int(rng.random() < 0.3) if rng.random() < annex_share else 0
    annexes = tuple(annex(rng, main) for _ in range(count))
    if type != "shed" and not annexes and rng.random() < 0.15:
        main = without_a_corner(rng, main)
    return assemble(
        (main, *annexes), "annexed" if annexes else "single", building.roof.frame.origin
    )


def with_short_ridge(rng: np.random.Generator, hip: Part) -> Part:
    """Return a hip whose ridge is a sixteenth to a quarter of its width."""
    ridge = hip.parameters["width"] * rng.uniform(0.06, 0.25)
    length = hip.parameters["length"] - hip.parameters["ridge_length"] + ridge
    parameters = hip.parameters | {"length": length, "ridge_length": ridge}
    return make_part("hip", parameters, hip.kappa, hip.translation)


def lengthen(rng: np.random.Generator, part: Part) -> Part:
    """Make a part as long as a row or a barn, by half a width to three widths."""
    additions = part.parameters["width"] * rng.uniform(0.5, 3.0)
    parameters = {
        name: value + additions * (name in LENGTHS) for name, value in part.parameters.items()
    }
    return make_part(part.type, parameters, part.kappa, part.translation)


def resize(rng: np.random.Generator, part: Part) -> Part:
    """Shrink a part to a shed or garage, down to two fifths, and lower it by up to a half."""
    size = rng.uniform(0.4, 1.0)
    lower = size * rng.uniform(0.5, 1.0)
    factors = dict.fromkeys(HEIGHTS, lower) | dict.fromkeys(COUNTS, 1.0)
    parameters = {name: value * factors.get(name, size) for name, value in part.parameters.items()}
    return make_part(part.type, parameters, part.kappa, part.translation)


def without_a_corner(rng: np.random.Generator, part: Part) -> Part:
    """Cut a corner off a part of one piece, by an oblique plot border."""
    angle = part.kappa + rng.integers(4) * math.pi / 2 + math.radians(rng.uniform(25.0, 65.0))
    normal = np.array([math.cos(angle), math.sin(angle)])
    along = np.array([-math.sin(angle), math.cos(angle)])
    piece = part.pieces[0]
    corners = np.asarray(piece.outline.exterior.coords) @ normal
    middle = np.array(piece.outline.centroid.coords[0])
    reach = corners.max() - middle @ normal
    border, distant = middle + normal * reach * rng.uniform(0.55, 0.9), 100.0
    polygon = shapely.Polygon(
        [
            border - distant * along,
            border + distant * (normal - along),
            border + distant * (normal + along),
            border + distant * along,
        ]
    )
    return replace(part, pieces=(replace(piece, outline=piece.outline.difference(polygon)),))


def hip_one_end(rng: np.random.Generator, gable: Part) -> Part:
    """Return a hip at one end, a gable at the other: a gable, as RoofN3D's hips have two."""
    hip = make_part("hip", random_parameters(rng, "hip"), gable.kappa, gable.translation)
    piece = hip.pieces[0]
    rise_along_ridge = piece.planes[:, :2] @ (math.cos(hip.kappa), math.sin(hip.kappa))
    planes = np.delete(piece.planes, np.argmax(rise_along_ridge), axis=0)
    return replace(hip, type="gable", pieces=(replace(piece, planes=planes),))


def annex(rng: np.random.Generator, main: Part) -> Part:
    """Place a part against a side of `main`, under its eave, or level and under its roof."""
    length, width = main.parameters["length"], main.parameters["width"]
    quarters = int(rng.integers(4))
    reach, side = (length / 2, width) if quarters % 2 == 0 else (width / 2, length)
    across = side * rng.uniform(0.3, 0.7)
    depth = rng.uniform(1.5, 0.4 * 2 * reach + 1.5)
    level = rng.random() < 0.4
    inside = reach * rng.uniform(0.3, 1.0) if level else OVERLAP_M
    if main.type in ROUND:  # Its walls are round, and lie further in beside.
        inside = reach
    eave = main.translation[2] - (0.0 if level else rng.uniform(0.3, 2.8))
    type = "gable" if level else str(rng.choice(ANNEX_TYPES))
    parameters = annex_parameters(
        rng, type, depth + inside, across, main.parameters.get("height", 0.0)
    )
    along, perpendicular = reach + (depth - inside) / 2, rng.uniform(-0.5, 0.5) * (side - across)
    angle = main.kappa + quarters * math.pi / 2
    xy = main.translation[:2] + turn_points(np.array([along, perpendicular]), angle)
    turn = math.pi / 2 if type == "monopitch" else 0.0
    if turn:
        parameters["length"], parameters["width"] = parameters["width"], parameters["length"]
    return make_part(type, parameters, angle + turn, np.append(xy, max(eave, LOWEST_EAVE_M)))


def annex_parameters(
    rng: np.random.Generator, type: str, length: float, width: float, limit: float
) -> dict[str, float]:
    """Return theta_p of an annex, `length` outwards, no higher than `limit` unless low."""
    slope = math.tan(math.radians(rng.uniform(15.0, 45.0)))
    parameters = {"length": length, "width": width}
    if type in ("gable", "hip"):
        parameters["height"] = min(width / 2 * slope, max(limit, 1.0))
    if type == "hip":
        parameters["ridge_length"] = length - min(width, length) * rng.uniform(0.6, 0.9)
    if type == "monopitch":
        parameters["height"] = length * math.tan(math.radians(rng.uniform(5.0, 20.0)))
    return parameters
