"""Draw the README's moving picture: a point cloud that turns into models, house by house.

The neighbourhood is the bundled one, which is simulated.

python docs/draw_moving.py [RUN] [OUT.gif]

RUN is the output folder of `hiproof demo`; without it the script makes one.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import shapely
from draw_town import LIGHT, project
from PIL import Image

from hiproof import Request, read_points, reconstruct_area
from hiproof.evaluate.models import BuildingModel, read_models
from hiproof.model import Solid
from hiproof.simulate import demo_files
from hiproof.write.colours import WALL_COLOUR, srgb, type_colour
from hiproof.write.meshes.triangles import solid_mesh

SIZE, FINER = np.array([840, 500]), 2  # pixels of the picture; drawn so many times finer
FRAMES, RISING, STILL = 40, 6, (900, 2600)  # of the film and of a house; ms of its first and last
FRAME_MS, COLOURS = 80, 48
GROUND_RGB, TREE_RGB, POINT_RGB = (0.86, 0.84, 0.80), (0.55, 0.66, 0.45), (0.50, 0.28, 0.20)
GROUND_SHARE = 3  # every so manieth point of the ground is drawn
EDGE_RGB, EDGE_STEP_M, LIFT_M = (0.2, 0.18, 0.15), 0.05, 0.08  # LIFT_M: edges before their faces

RGB = tuple[float, float, float]


class Canvas:
    """Pixels, each with the colour of the nearest thing drawn there."""

    def __init__(self, places: np.ndarray) -> None:
        self.low = places.min(axis=0)
        self.scale = (SIZE * FINER / np.ptp(places, axis=0)).min()
        self.margin = (SIZE * FINER - self.scale * np.ptp(places, axis=0)) / 2
        self.colour = np.ones((*(SIZE[::-1] * FINER), 3))
        self.depth = np.full(SIZE[::-1] * FINER, -np.inf)

    def find_pixels(self, xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return columns and rows (n, 2) of points (n, 3), and how near they are (n,)."""
        places, near = project(xyz)
        columns, rows = ((places - self.low) * self.scale + self.margin).T
        return np.column_stack([columns, SIZE[1] * FINER - 1 - rows]), near

    def draw_points(self, xyz: np.ndarray, colour: RGB, size: int = FINER) -> None:
        """Draw points (n, 3) as squares of a `size` in fine pixels."""
        pixels, near = self.find_pixels(xyz)
        for offset in np.ndindex(size, size):
            column, row = np.round(pixels + offset).astype(int).T
            inside = (column >= 0) & (row >= 0)
            inside &= (column < SIZE[0] * FINER) & (row < SIZE[1] * FINER)
            order = np.flatnonzero(inside)[np.argsort(near[inside])]
            order = order[near[order] > self.depth[row[order], column[order]]]
            self.colour[row[order], column[order]] = colour
            self.depth[row[order], column[order]] = near[order]

    def draw_triangle(self, corners: np.ndarray, colour: np.ndarray) -> None:
        """Draw a triangle (3, 3)."""
        (a, b, c), near = self.find_pixels(corners)
        area = cross(b - a, c - a)
        if abs(area) < 1e-9:
            return
        low, high = (np.array(f([a, b, c], axis=0)) for f in (np.min, np.max))
        (x0, y0), (x1, y1) = np.maximum(np.floor(low), 0).astype(int), np.ceil(high).astype(int)
        y, x = np.mgrid[y0 : min(y1 + 1, SIZE[1] * FINER), x0 : min(x1 + 1, SIZE[0] * FINER)]
        at = np.stack([x, y], axis=-1)
        v, w = cross(at - a, c - a) / area, cross(b - a, at - a) / area
        depth = near[0] + v * (near[1] - near[0]) + w * (near[2] - near[0])
        window = (slice(y0, y0 + y.shape[0]), slice(x0, x0 + x.shape[1]))
        visible = (v >= 0) & (w >= 0) & (v + w <= 1) & (depth > self.depth[window])
        self.colour[window][visible] = colour
        self.depth[window][visible] = depth[visible]

    def draw_model(self, model: BuildingModel, solid: Solid, height: float) -> None:
        """Draw a house that has risen to a share of its `height`."""
        mesh, ground = solid_mesh(solid), solid.vertices[:, 2].min()
        for corners, part in zip(mesh.corners, mesh.part, strict=True):
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            light = 0.72 + 0.28 * np.clip(normal @ LIGHT / (np.linalg.norm(normal) or 1), 0, 1)
            kind = model.part_types.get(int(part), model.roof_type)
            base = srgb(WALL_COLOUR if part < 0 else type_colour(kind))
            self.draw_triangle(raise_to(corners, ground, height), light * np.array(base))
        for a, b in raise_to(mesh.edges, ground, height) + [0, 0, LIFT_M]:
            steps = np.linspace(0, 1, 2 + int(np.linalg.norm(b - a) / EDGE_STEP_M))[:, None]
            self.draw_points(a + steps * (b - a), EDGE_RGB, 1)

    def to_image(self) -> Image.Image:
        picture = Image.fromarray((self.colour * 255).astype(np.uint8))
        return picture.resize(tuple(SIZE), Image.Resampling.BOX)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def raise_to(corners: np.ndarray, ground: float, height: float) -> np.ndarray:
    return corners * [1, 1, height] + [0, 0, ground * (1 - height)]


def draw(run: Path, path: Path) -> None:
    """Draw the cloud of the demo and the models of its `run` as one film."""
    cloud = read_points(demo_files()["cloud"])
    origin = np.floor(cloud.xyz.min(axis=0))
    points, classes = cloud.xyz - origin, cloud.classes
    ground = points[classes == 2][::GROUND_SHARE]
    trees, roofs = points[classes == 5], points[classes == 6]
    models = [(m, m.solid.move(-origin)) for m in read_models(run / "buildings.city.jsonl")]
    # from left to right
    models.sort(key=lambda pair: project(pair[1].vertices)[0][:, 0].mean())
    outlines = [shapely.MultiPoint(s.vertices[:, :2]).convex_hull.buffer(0.7) for _, s in models]
    house = np.full(len(roofs), -1)
    for k, outline in enumerate(outlines):
        house[shapely.contains_xy(outline, *roofs[:, :2].T)] = k
    corners = np.concatenate([solid.vertices for _, solid in models])
    frames = []
    for frame in range(FRAMES):
        starts = np.arange(len(models)) / len(models) * (FRAMES - RISING)
        heights = np.clip((frame - starts) / RISING, 0, 1)
        canvas = Canvas(project(corners)[0])
        canvas.draw_points(ground, GROUND_RGB)
        canvas.draw_points(trees, TREE_RGB)
        canvas.draw_points(roofs[(house < 0) | (heights[house] < 1)], POINT_RGB)
        for (model, solid), height in zip(models, heights, strict=True):
            if height:
                canvas.draw_model(model, solid, height)
        frames.append(canvas.to_image())
    palette = frames[-1].quantize(COLOURS)
    frames = [f.quantize(COLOURS, palette=palette, dither=Image.Dither.NONE) for f in frames]
    waits = [STILL[0], *[FRAME_MS] * (FRAMES - 2), STILL[1]]
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=waits, loop=0, optimize=True
    )


def main(arguments: list[str]) -> None:
    path = Path(arguments[1]) if len(arguments) > 1 else Path(__file__).with_name("moving.gif")
    with tempfile.TemporaryDirectory() as folder:
        run, files = Path(arguments[0] if arguments else folder), demo_files()
        if not arguments:
            reconstruct_area(Request((str(files["cloud"]),), run, str(files["footprints"])))
        draw(run, path)


if __name__ == "__main__":
    main(sys.argv[1:])
