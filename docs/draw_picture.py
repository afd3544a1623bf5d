"""Draw the README's picture: the bundled neighbourhood's points, and the models made of them.

python docs/draw_picture.py [OUT.png]
"""

import sys
import tempfile
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from hiproof import Request, read_points, reconstruct_area
from hiproof.evaluate.models import read_models
from hiproof.model import ROOF
from hiproof.simulate import demo_files

WALL_COLOUR, ROOF_COLOUR, GROUND_COLOUR = "#e8e2d6", "#b3563f", "#c9d3bf"


def shaded(colour: str, normal: np.ndarray) -> np.ndarray:
    """A colour under light from the south-west."""
    light = np.array([-0.45, -0.35, 0.82])
    return np.array(matplotlib.colors.to_rgb(colour)) * (0.62 + 0.38 * max(float(normal @ light), 0.0))


def draw_points(axes, xyz: np.ndarray, classes: np.ndarray) -> None:
    for wanted, colour, size in ((2, "#b9b09c", 0.25), (6, "#b3563f", 0.6)):
        points = xyz[classes == wanted][:: 2 if wanted == 2 else 1]
        axes.scatter(*points.T, s=size, c=colour, linewidths=0)


def draw_models(axes, folder: Path, origin: np.ndarray) -> None:
    polygons, colours = [], []
    for model in read_models(folder / "buildings.city.jsonl"):
        vertices = model.solid.vertices - origin
        for face in model.solid.faces:
            ring = vertices[list(face.rings[0])]
            normal = np.cross(ring - ring[0], np.roll(ring, -1, axis=0) - ring[0]).sum(axis=0)
            normal /= np.linalg.norm(normal) or 1.0
            polygons.append(ring)
            colours.append(shaded(ROOF_COLOUR if face.kind == ROOF else WALL_COLOUR, normal))
    axes.add_collection3d(Poly3DCollection(polygons, facecolors=colours, edgecolors="#5a5348", linewidths=0.25))


def main(path: Path) -> None:
    files = demo_files()
    with tempfile.TemporaryDirectory() as folder:
        inputs = (str(files["cloud"]),), Path(folder), str(files["footprints"]), str(files["terrain"])
        reconstruct_area(Request(*inputs))
        cloud = read_points(files["cloud"])
        origin = np.array([*cloud.xyz[:, :2].mean(axis=0), 0.0])
        xyz = cloud.xyz - origin
        figure, both = plt.subplots(1, 2, figsize=(14, 5), subplot_kw={"projection": "3d"})
        draw_points(both[0], xyz, cloud.classification)
        draw_models(both[1], Path(folder), origin)
    low, high = xyz.min(axis=0), xyz.max(axis=0)
    for axes in both:
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect(high - low, zoom=1.45)
        axes.view_init(elev=38, azim=-62)
        axes.set_axis_off()
    figure.subplots_adjust(0, 0, 1, 1, wspace=0)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_name("picture.png")))
