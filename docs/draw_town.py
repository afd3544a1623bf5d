"""Draw the README's picture: a real town's points beside its models.

The town is Delft (AHN3).

python docs/draw_town.py [RUN] [OUT.png]

RUN is the output folder of `hiproof reconstruct` on ../shared/data/delft; without it the script
makes one. Both halves show the same view from the south-west, from the same height.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import PolyCollection
from PIL import Image

from hiproof import Request, read_points, reconstruct_area
from hiproof.evaluate.models import read_models
from hiproof.model import ROOF

DELFT = Path(__file__).resolve().parents[2] / "shared/data/delft"
AZIMUTH_DEG, ELEVATION_DEG = 24.0, 34.0  # of the view: where it is turned to, and how steeply down
ROOF_COLOUR, WALL_COLOUR, GROUND_COLOUR = "#b3563f", "#e8e2d6", "#a9a08c"
LIGHT = np.array([-0.5, -0.4, 0.77])  # towards the sun
COLOURS = 48  # in the file's palette
MARGIN_M = 6.0  # of points drawn around the buildings
# of the town's width and height in the picture, from the lower left
SHOWN = (0.22, 0.95, 0.22, 0.86)


def project(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Project points (n, 3) onto the picture.

    Returns their places (n, 2) and how near they are (n,).
    """
    a, e = np.radians(AZIMUTH_DEG), np.radians(ELEVATION_DEG)
    right = np.array([np.cos(a), np.sin(a), 0.0])
    forward = np.array([-np.sin(a), np.cos(a), 0.0])
    upward = np.array([*(np.sin(e) * forward[:2]), np.cos(e)])
    toward = np.array([*(-np.cos(e) * forward[:2]), np.sin(e)])
    return np.column_stack([xyz @ right, xyz @ upward]), xyz @ toward


def shade(colour: str, brightness: np.ndarray) -> np.ndarray:
    """Return colours (n, 3) of one hue under `brightness` (n,) from 0 to 1."""
    base = np.array(matplotlib.colors.to_rgb(colour))
    return np.clip(base * (0.55 + 0.5 * brightness)[:, None], 0.0, 1.0)


def draw_points(axes, xyz: np.ndarray, is_roof: np.ndarray) -> None:
    """Draw points (n, 3), far ones first; roofs are lighter the higher they are."""
    places, depth = project(xyz)
    order = np.argsort(depth)
    height = (xyz[:, 2] - xyz[:, 2].min()) / 12.0
    roofs, others_colour = (
        shade(c, np.clip(height, 0.0, 1.0)) for c in (ROOF_COLOUR, GROUND_COLOUR)
    )
    colours = np.where(is_roof[:, None], roofs, others_colour)
    axes.scatter(*places[order].T, s=0.7, c=colours[order], linewidths=0)


def draw_models(axes, models: Path, origin: np.ndarray) -> None:
    """Draw all faces of a run's solids, far ones first."""
    polygons, colours, nearness = [], [], []
    for model in read_models(models):
        vertices = model.solid.vertices - origin
        for face in model.solid.faces:
            ring = vertices[list(face.rings[0])]
            normal = np.cross(ring - ring[0], np.roll(ring, -1, axis=0) - ring[0]).sum(axis=0)
            normal /= np.linalg.norm(normal) or 1.0
            places, depth = project(ring)
            colour = ROOF_COLOUR if face.kind == ROOF else WALL_COLOUR
            polygons.append(places)
            colours.append(shade(colour, np.clip(normal @ LIGHT, 0.0, 1.0)[None])[0])
            nearness.append(depth.mean())
    order = np.argsort(nearness)
    faces = [polygons[k] for k in order]
    shades = [colours[k] for k in order]
    axes.add_collection(
        PolyCollection(faces, facecolors=shades, edgecolors="#5a5348", linewidths=0.2)
    )


def draw(
    run: Path,
    path: Path,
    clouds: Iterable[Path],
    shown_part: tuple[float, float, float, float],
    dpi: int = 100,
) -> None:
    """Draw the points of `clouds` beside the models of `run`.

    They are shown as far as they lie in a part of the picture: left, right, bottom and top as
    shares of its size.
    """
    clouds = [read_points(file) for file in sorted(clouds)]
    xyz = np.concatenate([cloud.xyz for cloud in clouds])
    classes = np.concatenate([cloud.classes for cloud in clouds])
    corners = np.concatenate(
        [model.solid.vertices for model in read_models(run / "buildings.city.jsonl")]
    )
    lower, upper = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
    is_shown = ((xyz[:, :2] >= lower[:2]) & (xyz[:, :2] <= upper[:2])).all(axis=1)
    is_shown &= np.isin(classes, (1, 2, 6)) & (xyz[:, 2] < upper[2])
    origin = np.array([*corners[:, :2].mean(axis=0), corners[:, 2].min()])
    figure, pair = plt.subplots(1, 2, figsize=(16, 7.2))
    draw_points(pair[0], xyz[is_shown] - origin, classes[is_shown] == 6)
    draw_models(pair[1], run / "buildings.city.jsonl", origin)
    places, _ = project(corners - origin)
    start, size = places.min(axis=0), np.ptp(places, axis=0)
    limits = [start[k // 2] + share * size[k // 2] for k, share in enumerate(shown_part)]
    for axes in pair:
        left, right, bottom, top = limits
        axes.set(xlim=(left, right), ylim=(bottom, top))
        axes.set_aspect("equal")
        axes.set_axis_off()
    figure.subplots_adjust(0, 0, 1, 1, wspace=0.02)
    figure.savefig(path, dpi=dpi, bbox_inches="tight", pad_inches=0.05)
    with Image.open(path) as picture:  # a palette is a third of the size
        small = picture.convert("RGB").quantize(COLOURS)
    small.save(path, optimize=True)


def main(arguments: list[str]) -> None:
    path = Path(arguments[1]) if len(arguments) > 1 else Path(__file__).with_name("picture.png")
    if arguments:
        return draw(Path(arguments[0]), path, DELFT.glob("*.laz"), SHOWN)
    with tempfile.TemporaryDirectory() as folder:
        clouds = tuple(str(file) for file in sorted(DELFT.glob("*.laz")))
        reconstruct_area(Request(clouds, Path(folder) / "run", str(DELFT / "footprints.gpkg")))
        draw(Path(folder) / "run", path, DELFT.glob("*.laz"), SHOWN)


if __name__ == "__main__":
    main(sys.argv[1:])
