"""Draw reconstructed roofs in plan over their points, on sheets of twelve.

A view from the south stands beside each.

python docs/draw_roofs.py RUN|delft|amsterdam_west|stbarth|ctview [--worst 24] [--chance 24] [--ids
A B] [--seed 0]
                          [--truth CITYJSON] [--colour height|residual] [--out FOLDER]

RUN is the output folder of `hiproof reconstruct` whose clouds are still in their place; a name
stands for a set in ../shared/data, which is modelled first. The sheets `worst-1.png`, ... show the
buildings with the smallest share of points within 0.2 m of the roof, `chance-1.png`, ... some drawn
by chance.

In plan: points by height, or by residual; those more than 0.2 m off the roof as black (above it)
and grey (below) crosses. Each part's outline in its type's colour and its type; ridges and hips
red, valleys blue, steps black, seams in one plane dotted, the footprint dashed, roof edges of the
true models dashed green. In the view: roofs in the types' colours.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
import shapely

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib import patheffects

from hiproof import Request, read_parameters, reconstruct_area
from hiproof.errors import HiproofError, InputError
from hiproof.evaluate.models import read_models
from hiproof.evaluate.run import evaluate_run
from hiproof.model import ROOF, Face, Part, Piece, Solid
from hiproof.parametric.record import read_building
from hiproof.read.models.damage import SkippedBuildings
from hiproof.write.colours import type_colour

SETS = Path(__file__).resolve().parents[1].parent / "shared" / "data"
NAMED = ("delft", "amsterdam_west", "stbarth", "ctview")
NEAR_M, WALL_M, COLUMNS, ROWS = 0.2, 1.5, 3, 4
LINES = {
    "ridge": {"color": "#d0021b", "linewidth": 1.6},
    "valley": {"color": "#0b5fd6", "linewidth": 1.8},
    "step": {"color": "black", "linewidth": 1.6},
    "eave": {"color": "#333333", "linewidth": 0.9},
    "seam": {"color": "#444444", "linewidth": 0.9, "linestyle": ":"},
}
LABELLED_CELLS = 18  # of 3,600: a part that covers less gets no label
HALO = [patheffects.withStroke(linewidth=2.5, foreground="white")]
VIEW_PIXELS, VIEW_TILT, VIEW_TURN = 260, math.radians(42), math.radians(-28)


@dataclass(frozen=True)
class DrawnPart:
    """One part of a roof: its type and its pieces in world coordinates."""

    type: str
    pieces: tuple[Piece, ...]

    @property
    def colour(self) -> str:
        return type_colour(self.type)

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the height (n,) at plan points (n, 2).

        It is minus infinity beside the part.
        """
        z = np.full(len(xy), -np.inf)
        for piece in self.pieces:
            inside = shapely.intersects_xy(piece.outline, xy[:, 0], xy[:, 1])
            z[inside] = np.maximum(z[inside], piece.height_at(xy[inside]))
        return z


@dataclass(frozen=True)
class Drawn:
    """A building to draw, all in world metres.

    `gap` (n,) is each point's signed height over the roof, NaN beside it.
    """

    id: str
    status: str
    solid: Solid
    parts: tuple[DrawnPart, ...]
    points: np.ndarray
    footprint: shapely.Geometry | None
    gap: np.ndarray
    truth: Solid | None = None

    @property
    def share(self) -> float:
        """Share of the points within 0.2 m of the roof.

        Those with no roof over or under them count as off.
        """
        return float(np.mean(np.abs(self.gap) < NEAR_M)) if len(self.gap) else 0.0


def run_set(name: str, out: Path) -> Path:
    """Run the set `name` now, and return the folder.

    Raises InputError where the set is not there.
    """
    data = SETS / name
    clouds, footprints = sorted(map(str, data.glob("*.laz"))), sorted(map(str, data.glob("*.gpkg")))
    if not clouds:
        raise InputError(
            f"expected a run's folder or one of {', '.join(NAMED)} under {SETS}, got {name!r}"
        )
    summary = reconstruct_area(
        Request(tuple(clouds), out / name, footprints[0] if footprints else None, restart=True)
    )
    print(f"{name}: {summary.buildings} buildings")
    return out / name


def read_run(folder: Path, truth: Path | None = None) -> list[Drawn]:
    """Read the buildings of a run that have a model and points.

    The models of `truth` come with them under the same ids.
    """
    run = evaluate_run(folder)
    if not run.clouds:
        raise InputError(
            f"expected the clouds of the run in {folder} where run.json says, got none; make the "
            "run again"
        )
    roofs = {r["id"]: read_building(r)[1] for r in read_parameters(folder / "parameters.jsonl")}
    # a true model with an invalid solid is not drawn; the others are
    true_models = read_models(truth, damaged=SkippedBuildings()) if truth else ()
    true_solids = {model.id: model.solid for model in true_models}
    buildings = []
    for model, points, footprint in zip(run.models, run.points, run.footprints, strict=True):
        if model.solid is not None and len(points):
            roof = roofs[model.id]
            parts = tuple(make_part(part, roof.frame.origin) for part in roof.parts)
            gap = measure_gaps(model.solid, points)
            true_solid = true_solids.get(model.id)
            buildings.append(
                Drawn(
                    model.id, model.status, model.solid, parts, points, footprint, gap, true_solid
                )
            )
    return buildings


def make_part(part: Part, shift: np.ndarray) -> DrawnPart:
    """Return a part in world coordinates, its polygons made valid."""
    pieces = (piece.move(shift) for piece in part.pieces)
    return DrawnPart(
        part.type, tuple(Piece(shapely.make_valid(piece.outline), piece.planes) for piece in pieces)
    )


def measure_gaps(solid: Solid, points: np.ndarray) -> np.ndarray:
    """Return the height (n,) of points (n, 3) over the nearest roof face.

    It is above or below them, NaN where there is none.
    """
    nearest = np.full(len(points), np.nan)
    for face in solid.select_faces(ROOF):
        a, b, c = compute_plane(solid.vertices, face)
        inside = shapely.intersects_xy(
            make_outline(solid.vertices, face), points[:, 0], points[:, 1]
        )
        gap = points[inside, 2] - (points[inside, :2] @ (a, b) + c)
        nearest[inside] = np.where(
            np.abs(gap) < np.nan_to_num(np.abs(nearest[inside]), nan=np.inf), gap, nearest[inside]
        )
    return nearest


def make_outline(vertices: np.ndarray, face: Face) -> shapely.Polygon:
    outer, *holes = (vertices[list(ring), :2] for ring in face.rings)
    return shapely.make_valid(shapely.Polygon(outer, holes))


def compute_normal(vertices: np.ndarray, face: Face) -> np.ndarray:
    """Return the unit normal (3,) of a face, outwards."""
    ring = vertices[list(face.rings[0])]
    ring = ring - ring.mean(axis=0)
    normal = np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)
    return normal / max(np.linalg.norm(normal), 1e-12)


def compute_plane(vertices: np.ndarray, face: Face) -> tuple[float, float, float]:
    """Return (a, b, c) of z = a x + b y + c through a roof face."""
    normal, centre = compute_normal(vertices, face), vertices[list(face.rings[0])].mean(axis=0)
    a, b = -normal[:2] / normal[2]
    return a, b, centre[2] - a * centre[0] - b * centre[1]


def list_edges(face: Face) -> list[tuple[int, int]]:
    return [(a, b) for ring in face.rings for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]


def list_roof_lines(solid: Solid) -> list[tuple[str, np.ndarray]]:
    """Return (kind, ends (2, 2) in plan) of every edge of a roof face.

    Kinds are those of LINES.
    """
    faces = solid.select_faces(ROOF)
    owner = {edge: face for face in faces for edge in list_edges(face)}
    border = shapely.union_all([make_outline(solid.vertices, face) for face in faces]).boundary
    lines = []
    for (a, b), face in owner.items():
        other, ends = owner.get((b, a)), solid.vertices[[a, b]]
        if other is None:
            middle = shapely.Point(ends[:, :2].mean(axis=0))
            lines.append(("eave" if border.distance(middle) < 0.02 else "step", ends[:, :2]))
        elif a < b:
            along, n, m = (
                ends[1] - ends[0],
                compute_normal(solid.vertices, face),
                compute_normal(solid.vertices, other),
            )
            bend = np.cross(n, m) @ along / max(np.linalg.norm(along), 1e-9)
            lines.append(
                ("seam" if abs(bend) < 0.02 else "ridge" if bend > 0 else "valley", ends[:, :2])
            )
    return lines


def draw_plan(axes: plt.Axes, building: Drawn, colour: str) -> None:
    origin = np.array(building.solid.vertices[:, :2].min(axis=0))
    xy, gap = building.points[:, :2] - origin, building.gap
    values = building.points[:, 2] if colour == "height" else gap
    limits = np.percentile(values, (2, 98)) if colour == "height" else (-0.4, 0.4)
    size = float(np.clip(220 / math.sqrt(len(xy)), 2.0, 12.0))
    axes.scatter(
        *xy.T,
        s=size,
        c=values,
        cmap="viridis" if colour == "height" else "coolwarm",
        vmin=limits[0],
        vmax=limits[1],
        linewidths=0,
        alpha=0.9,
    )
    for is_off, shade in ((~(gap < NEAR_M), "black"), (gap <= -NEAR_M, "#999999")):
        axes.scatter(*xy[is_off].T, s=size + 7, c=shade, marker="x", linewidths=0.7)
    if building.footprint is not None:
        for polygon in shapely.get_parts(building.footprint):
            axes.plot(
                *(shapely.get_coordinates(polygon.exterior) - origin).T,
                color="#666666",
                linewidth=0.8,
                linestyle="--",
            )
    for face in building.truth.select_faces(ROOF) if building.truth else ():
        for ring in face.rings:
            corners = building.truth.vertices[[*ring, ring[0]], :2] - origin
            axes.plot(*corners.T, color="#00a651", linewidth=1.3, linestyle=(0, (4, 2)), zorder=4)
    for kind, ends in list_roof_lines(building.solid):
        axes.plot(*(ends - origin).T, **LINES[kind], solid_capstyle="round", zorder=3)
    draw_parts(axes, building, origin)
    lower, upper = shapely.bounds(
        shapely.MultiPoint(building.solid.vertices[:, :2] - origin)
    ).reshape(2, 2)
    draw_scale(axes, lower - 0.6)
    axes.set(
        xlim=(lower[0] - 1.0, upper[0] + 1.0), ylim=(lower[1] - 1.6, upper[1] + 1.0), aspect="equal"
    )
    axes.set_axis_off()


def draw_parts(axes: plt.Axes, building: Drawn, origin: np.ndarray) -> None:
    """Draw each part's outline, and its type where it is on top.

    Outlines are a little inside so that common edges stay apart.
    """
    x0, y0, x1, y1 = shapely.total_bounds(
        [p.outline for part in building.parts for p in part.pieces]
    )
    grid = np.stack(np.meshgrid(np.linspace(x0, x1, 60), np.linspace(y0, y1, 60)), axis=-1).reshape(
        -1, 2
    )
    z = np.stack([part.height_at(grid) for part in building.parts])
    top = np.where(np.isfinite(z.max(axis=0)), z.argmax(axis=0), -1)
    for k, part in enumerate(building.parts):
        for piece in part.pieces:
            inner = piece.outline.buffer(-0.12, join_style="mitre")
            for polygon in shapely.get_parts(inner)[shapely.area(shapely.get_parts(inner)) > 0]:
                ring = shapely.get_coordinates(polygon.exterior) - origin
                axes.plot(*ring.T, color=part.colour, linewidth=2.6, alpha=0.8, zorder=2)
        values = grid[top == k]
        if len(values) > LABELLED_CELLS:
            place = (
                values[np.argmin(((values - np.median(values, axis=0)) ** 2).sum(axis=1))] - origin
            )
            label = part.type.replace("asymmetric_", "asym. ").replace("_", " ")
            axes.text(
                *place, label, fontsize=8, ha="center", va="center", zorder=5, path_effects=HALO
            )


def draw_scale(axes: plt.Axes, corner: np.ndarray) -> None:
    """Draw a bar of five metres below the plan."""
    axes.plot([corner[0], corner[0] + 5.0], [corner[1], corner[1]], color="black", linewidth=2)
    axes.text(corner[0] + 5.3, corner[1], "5 m", fontsize=7, va="center")


def draw_view(axes: plt.Axes, building: Drawn) -> None:
    """Draw the solid from the south-south-west, hidden surfaces removed.

    Roofs are in the colours of their parts' types.
    """
    solid, (right, upward, back) = lower_walls(building.solid), compute_view_axes()
    projected = solid.vertices @ np.column_stack([right, upward])
    lower, upper = projected.min(axis=0), projected.max(axis=0)
    step = (upper - lower).max() / VIEW_PIXELS
    x, y = (
        np.arange(lower[0] - 2 * step, upper[0] + 2 * step, step),
        np.arange(lower[1] - 2 * step, upper[1] + 2 * step, step),
    )
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    depth, owner = np.full(len(pixels), -np.inf), np.full(len(pixels), -1)
    colours = [(1.0, 1.0, 1.0)]
    for k, face in enumerate(solid.faces):
        normal = compute_normal(solid.vertices, face)
        colours.append(apply_light(choose_colour(building, face, normal), normal))
        if normal @ back < 1e-6:
            continue
        outer, *holes = (projected[list(ring)] for ring in face.rings)
        inside = np.flatnonzero(
            shapely.intersects_xy(shapely.make_valid(shapely.Polygon(outer, holes)), *pixels.T)
        )
        # A pixel is the line right x + up y + back t: where it meets the face's plane is how near
        # it is.
        distance = normal @ solid.vertices[face.rings[0][0]]
        nearby = (distance - pixels[inside] @ (normal @ right, normal @ upward)) / (normal @ back)
        nearer = nearby > depth[inside] + 1e-6
        depth[inside[nearer]], owner[inside[nearer]] = nearby[nearer], k
    image = np.array(colours)[owner + 1].reshape(len(y), len(x), 3)
    image[find_contours(owner.reshape(len(y), len(x)))] = 0.15
    axes.imshow(image, origin="lower", interpolation="antialiased")
    axes.set_axis_off()


def lower_walls(solid: Solid) -> Solid:
    """Cut the solid off a little below its lowest eave.

    So the view shows roofs.
    """
    vertices = solid.vertices.copy()
    roof = np.unique(
        [index for face in solid.select_faces(ROOF) for ring in face.rings for index in ring]
    )
    vertices[:, 2] = np.maximum(vertices[:, 2], vertices[roof, 2].min() - WALL_M)
    return Solid(vertices, solid.faces)


def compute_view_axes() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unit vectors right, up and towards the eye.

    The first two are those of the picture.
    """
    right = np.array([math.cos(VIEW_TURN), math.sin(VIEW_TURN), 0.0])
    back = np.array(
        [
            math.sin(VIEW_TURN) * math.cos(VIEW_TILT),
            -math.cos(VIEW_TURN) * math.cos(VIEW_TILT),
            math.sin(VIEW_TILT),
        ]
    )
    return right, np.cross(back, right), back


def choose_colour(building: Drawn, face: Face, normal: np.ndarray) -> tuple[float, float, float]:
    """Return the colour of the type on top at a roof face's middle.

    Walls are light.
    """
    if face.kind != ROOF:
        return (0.93, 0.91, 0.87)
    inside = shapely.get_coordinates(
        make_outline(building.solid.vertices, face).representative_point()
    )
    top = int(np.argmax([part.height_at(inside)[0] for part in building.parts]))
    return matplotlib.colors.to_rgb(building.parts[top].colour)


def apply_light(colour: tuple[float, float, float], normal: np.ndarray) -> tuple[float, ...]:
    """Return a colour under light from the south-west."""
    light = 0.6 + 0.4 * max(float(normal @ (-0.5, -0.4, 0.77)), 0.0)
    return tuple(light * channel for channel in colour)


def find_contours(owner: np.ndarray) -> np.ndarray:
    """Return pixels (h, w) whose neighbour shows another face.

    The neighbour is above or to the right.
    """
    differs = np.zeros(owner.shape, bool)
    differs[:, :-1] |= owner[:, :-1] != owner[:, 1:]
    differs[:-1] |= owner[:-1] != owner[1:]
    return differs


def draw_sheet(path: Path, buildings: list[Drawn], colour: str) -> None:
    """Draw one page of up to twelve buildings."""
    rows = -(-len(buildings) // COLUMNS)
    figure, axes = plt.subplots(
        rows,
        2 * COLUMNS,
        figsize=(7.0 * COLUMNS, 4.6 * rows),
        squeeze=False,
        width_ratios=[1.6, 1.0] * COLUMNS,
    )
    for pair in axes.reshape(-1, 2)[len(buildings) :]:
        pair[0].set_axis_off(), pair[1].set_axis_off()
    for (plan, view), building in zip(axes.reshape(-1, 2), buildings, strict=False):
        draw_plan(plan, building, colour)
        draw_view(view, building)
        faces = len(building.solid.select_faces(ROOF))
        status = "" if building.status == "modelled" else f", {building.status}"
        plan.set_title(
            f"{building.id[-18:]}: {building.share:.3f} within 0.2 m, {len(building.points)} "
            "points",
            fontsize=9,
        )
        view.set_title(f"{len(building.parts)} parts, {faces} faces{status}", fontsize=9)
    figure.subplots_adjust(0.01, 0.01, 0.99, 0.97, wspace=0.04, hspace=0.12)
    figure.savefig(path, dpi=90)
    plt.close(figure)
    print(path)


def draw_sheets(out: Path, name: str, buildings: list[Drawn], colour: str) -> None:
    size = COLUMNS * ROWS
    for k in range(0, len(buildings), size):
        draw_sheet(out / f"{name}-{k // size + 1}.png", buildings[k : k + size], colour)


def main(words: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "run", help=f"output folder of `hiproof reconstruct`, or {', '.join(NAMED)}"
    )
    parser.add_argument(
        "--worst", type=int, default=COLUMNS * ROWS, help="buildings with the smallest share"
    )
    parser.add_argument(
        "--chance", type=int, default=COLUMNS * ROWS, help="buildings drawn by chance"
    )
    parser.add_argument(
        "--ids", nargs="+", default=[], help="these buildings, by id or the end of it"
    )
    parser.add_argument("--truth", type=Path, help="CityJSON with true models under the same ids")
    parser.add_argument("--seed", type=int, default=0, help="of the draw by chance")
    parser.add_argument(
        "--colour",
        choices=("height", "residual"),
        default="height",
        help="what points are coloured by",
    )
    parser.add_argument("--out", type=Path, default=Path("roofs"), help="folder of the sheets")
    a = parser.parse_args(words)
    a.out.mkdir(parents=True, exist_ok=True)
    try:
        buildings = read_run(
            Path(a.run) if Path(a.run).is_dir() else run_set(a.run, a.out), a.truth
        )
    except HiproofError as error:
        sys.exit(str(error))
    order = np.random.default_rng(a.seed).permutation(len(buildings))[: a.chance]
    draw_sheets(
        a.out, "worst", sorted(buildings, key=lambda building: building.share)[: a.worst], a.colour
    )
    draw_sheets(a.out, "chance", [buildings[k] for k in order], a.colour)
    draw_sheets(
        a.out, "asked", [b for b in buildings if any(b.id.endswith(id) for id in a.ids)], a.colour
    )


if __name__ == "__main__":
    main(sys.argv[1:])
