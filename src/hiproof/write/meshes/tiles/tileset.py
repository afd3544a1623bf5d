"""The tileset of a city, and the tile in which each building is drawn.

Buildings wait in a file as they come; when all are known, each tile is written once.

All coordinates are turned one by one into the plane's east, north, up about the first building, so
that nothing is lost by the Earth's curvature; the root's transform puts that frame on the globe.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from .... import __version__
from ....data_files import Values
from ....errors import InputError, InputWarning, OutputError
from ...files import output_error, scratch, whole_folder
from ..viewed import ViewedModel, merge_values
from .content import Found, TileMesh, make_mesh, tile_glb
from .globe import Globe, make_local_frame

MOST_TRIANGLES = 20_000  # about two megabytes: one draw call, loaded in a moment
WIDEST_M = 20_000.0  # beyond, coordinates about a tile's middle lose millimetres as float32
TILESET = "tileset.json"
# a building left out is an error of so many times its size: at Cesium's 16 pixels, one of eight is
# missed
MISSED = 2.0
SLACK_M = 0.01  # boxes are wider by so much, for coordinates rounded to float32


def write_models(
    folder: Path,
    buildings: Iterable[ViewedModel],
    crs: Any = None,
    geoid_height_m: float | None = None,
    most: int = MOST_TRIANGLES,
) -> int:
    """Write `buildings` as 3D Tiles 1.1 to `folder`; returns how many.

    `crs` is anything pyproj understands; without one the tiles keep the plane's axes about the
    first building, for viewers that need no place on the Earth. `geoid_height_m` is added to
    heights, else pyproj's grid is asked. A tile draws about `most` triangles. An older tileset in
    `folder` is replaced when all is written. Warns of heights and places that are guessed; raises
    InputError where no building has a solid or `crs` is of no use, OutputError where `folder`
    cannot be written or holds something else.
    """
    folder, globe = Path(folder), None if crs is None else Globe.of(crs, geoid_height_m)
    make_room(folder)
    with scratch(folder) as file:
        if globe is None:
            warnings.warn(
                InputWarning(
                    "no CRS is known, so the tiles stand nowhere on the globe; say it with --crs"
                )
            )
        elif not globe.is_known:
            warnings.warn(InputWarning(globe.heights))
        city = WaitingCity(file, globe)
        for model in buildings:
            city.add(model)
        if not city.offsets:
            raise InputError(
                "expected buildings with solids, got none; their `hiproof_status` says what became "
                "of them"
            )
        with whole_folder(folder) as temporary:
            tiles = TileFiles(city, temporary)
            tree = quadtree(
                tiles.boxes.mean(axis=1)[:, :2], tiles.sizes, np.array(city.triangles), most
            )
            text = json.dumps(tiles.tileset(tree), separators=(",", ":"), allow_nan=False)
            (temporary / TILESET).write_text(text)
    return len(city.offsets)


class WaitingCity:
    """Buildings in a file, with the triangles and boxes (east, north, up) of each."""

    def __init__(self, file: BinaryIO, globe: Globe | None) -> None:
        self.file, self.globe, self.found = file, globe, Found()
        # from east, north, up to the globe; without one, to world metres
        self.transform = np.eye(4)
        self.offsets: list[int] = []
        self.triangles: list[int] = []
        self.boxes: list[np.ndarray] = []

    def add(self, model: ViewedModel) -> None:
        """Keep a building: its mesh, and a row of the table that tells of it."""
        local = self.local(model.solid.vertices)
        row = merge_values({"id": model.id, "type": model.roof_type}, model.attributes)
        mesh = make_mesh(model, local)
        self.found.add(row)
        self.offsets.append(self.file.tell())
        self.triangles.append(mesh.triangles)
        self.boxes.append(np.array([local.min(axis=0) - SLACK_M, local.max(axis=0) + SLACK_M]))
        self.file.write(json.dumps(row).encode() + b"\n")
        mesh.save(self.file)

    def local(self, world: np.ndarray) -> np.ndarray:
        """Return east, north, up (n, 3) of world metres from the first building's corner."""
        if not self.offsets:
            self.transform = frame_at(np.floor(world.min(axis=0)), self.globe)
        places = world if self.globe is None else self.globe.to_earth(world)
        return (places - self.transform[:3, 3]) @ self.transform[:3, :3]

    def at(self, index: int) -> tuple[Values, TileMesh]:
        """Return the row and the mesh of a building that was added."""
        self.file.seek(self.offsets[index])
        return json.loads(self.file.readline()), TileMesh.load(self.file)


class TileFiles:
    """The files of all tiles in `folder`, made of a city that is complete."""

    def __init__(self, city: WaitingCity, folder: Path) -> None:
        self.city, self.folder = city, folder
        self.boxes = np.array(city.boxes)
        self.sizes = np.linalg.norm(self.boxes[:, 1] - self.boxes[:, 0], axis=1)
        self.properties = city.found.properties()
        (folder / "tiles").mkdir()

    def tileset(self, tree: Tile) -> Values:
        """Write the files of all tiles, and return the content of tileset.json."""
        globe, transform, root = self.city.globe, self.city.transform, self.write_tile(tree)
        if globe is None:
            extras = {
                "crs": None,
                "origin": transform[:3, 3].tolist(),
                "unit": "metre",
                "axes": "east, north, up",
            }
        else:
            extras = {"crs": globe.name, "heights": globe.heights, "accuracy_m": globe.accuracy_m}
            root = {"transform": transform.T.ravel().tolist(), **root}
        return {
            "asset": {"version": "1.1", "generator": f"hiproof {__version__}", "extras": extras},
            "geometricError": MISSED * float(self.sizes.max()),
            "root": root,
        }

    def write_tile(self, tile: Tile) -> Values:
        """Write a tile and all below, and return it as the tileset names it."""
        below = tile.list_below()
        description: Values = {
            "boundingVolume": bound_boxes(self.boxes[np.append(tile.items, below)]),
            "geometricError": MISSED * float(self.sizes[below].max(initial=0.0)),
            "refine": "ADD",
        }
        if len(tile.items):
            rows, meshes = zip(*map(self.city.at, tile.items), strict=True)
            uri = f"tiles/{tile.name}.glb"
            (self.folder / uri).write_bytes(tile_glb(meshes, rows, self.properties))
            box = bound_boxes(self.boxes[tile.items])
            description["content"] = {"uri": uri, "boundingVolume": box}
        if tile.children:
            description["children"] = [self.write_tile(child) for child in tile.children]
        return description


def frame_at(origin: np.ndarray, globe: Globe | None) -> np.ndarray:
    """Return the transform (4, 4) of the frame at `origin` (3,) to the globe or the world."""
    if globe is None:
        frame = np.eye(4)
        frame[:3, 3] = origin
        return frame
    longitude, latitude, _ = globe.geographic(origin[None])[0]
    return make_local_frame(longitude, latitude, globe.to_earth(origin[None])[0])


def bound_boxes(boxes: np.ndarray) -> dict[str, list[float]]:
    """Return the bounding volume around `boxes` (n, 2, 3): middle, half of each axis."""
    smallest, largest = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    return {
        "box": [
            *((smallest + largest) / 2).tolist(),
            *np.diag((largest - smallest) / 2).ravel().tolist(),
        ]
    }


def make_room(folder: Path) -> None:
    """Make the parent of `folder`; OutputError where it holds more than a tileset of ours."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        files = (file.relative_to(folder) for file in folder.rglob("*") if not file.is_dir())
        is_ours = not folder.exists() or (
            folder.is_dir() and all(f == Path(TILESET) or f.match("tiles/*.glb") for f in files)
        )
    except OSError as error:
        raise output_error(folder, error) from error
    if not is_ours:
        raise OutputError(
            "expected a new folder or one with a tileset alone for the tiles, got "
            f"{folder}; choose another name"
        )


@dataclass(frozen=True)
class Tile:
    """A tile: its way from the root ("r", a digit a level), and indices (k,) of its items."""

    name: str
    items: np.ndarray
    children: tuple[Tile, ...] = ()

    def list_below(self) -> np.ndarray:
        """Return the indices drawn by the tiles below this one."""
        return np.concatenate(
            [
                np.empty(0, int),
                *(np.append(child.items, child.list_below()) for child in self.children),
            ]
        )


def quadtree(
    centres: np.ndarray,
    sizes: np.ndarray,
    triangles: np.ndarray,
    limit: int = MOST_TRIANGLES,
    widest: float = WIDEST_M,
) -> Tile:
    """Return the root of the tree of buildings.

    They have `centres` (n, 2), `sizes` (n,) and numbers of `triangles` (n,), in metres. A tile
    holds the largest buildings of its square, at least one and else at most `limit` triangles, the
    rest goes to its four quarters; squares wider than `widest` hold none. Indices in a tile are in
    the order given.

    >>> tree = quadtree(np.array([[0.0, 0], [1, 1], [9, 9]]), np.array([3.0, 2, 1]), np.array([10,
    ...     10, 10]), limit=10)
    >>> tree.items.tolist(), [(child.name, child.items.tolist()) for child in tree.children]
    ([0], [('r0', [1]), ('r3', [2])])
    """

    def grow(name: str, items: np.ndarray, lower: np.ndarray, side: float) -> Tile:
        """Return the tile of `items` in the square from `lower` (2,) over `side` metres."""
        largest = items[np.argsort(-sizes[items], kind="stable")]
        fits = np.cumsum(triangles[largest]) <= limit
        fits[0] = True
        selection = largest[fits] if side <= widest else largest[:0]
        remainder, half = np.setdiff1d(items, selection), side / 2
        quarter = (centres[remainder] >= lower + half) @ [1, 2]
        children = [
            grow(
                f"{name}{q}",
                remainder[quarter == q],
                lower + half * np.array([q % 2, q // 2]),
                half,
            )
            for q in range(4)
            if (quarter == q).any()
        ]
        return Tile(name, np.sort(selection), tuple(children))

    smallest, largest = centres.min(axis=0), centres.max(axis=0)
    return grow("r", np.arange(len(centres)), smallest, float((largest - smallest).max()))
