"""The solar cadastre: the sun on roofs and walls, and what panels would yield."""

from __future__ import annotations

import functools
from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from ..city.work.ground import OTHER_GROUND_M
from ..compose.blocks import make_box
from ..compose.settle import round_number
from ..errors import InputError
from ..model import ROOF, Building, Solid
from ..read.crs import find_units, horizontal_crs, parse_crs
from ..read.terrain import read_terrain
from ..settings import EnrichSettings
from ..write.attribute_list import OWN
from ..write.head import FileHead
from .far import SECTORS, TerrainHorizon, open_terrain, read_horizon
from .party import Town
from .records import MOST_KEPT, Records
from .sun import Irradiation, Sky, irradiate, make_sky, sample_face, sample_wall
from .walls import find_walls, measure_faces
from .weather import import_pvlib, name_sky, read_year

SHADE_REACH_M = 200.0  # distance (m) up to which buildings shade
# Elevation (degrees) below which buildings count as none: the sun is weak there, and trees and
# terrain hide it.
LOWEST_HORIZON_DEG = 1.0


class ShadingEdges:
    """The roof edges of every building of a town, found once."""

    def __init__(self, town: Town) -> None:
        self.town = town
        self.list_edges = functools.lru_cache(MOST_KEPT)(self.find_edges)

    def find_edges(self, number: int) -> np.ndarray:
        building = self.town.read(number)
        if building.built is None:
            return np.empty((0, 2, 3))
        return np.concatenate([*map(roof_edges, (building.solid, *list_objects(building)))])

    def find_shading_edges(self, number: int, z_low: float) -> np.ndarray:
        """Find edges (m, 2, 3) that shade places, `z_low` or higher, of building `number`."""
        numbers = [number, *self.town.records.find_near(number, SHADE_REACH_M)]
        edges = np.concatenate([self.list_edges(k) for k in numbers])
        low_x, low_y, high_x, high_y = self.town.records.index.boxes[number]
        start, end = edges[:, 0], edges[:, 1]
        low, high = np.minimum(start, end), np.maximum(start, end)
        aside = [
            np.maximum(np.maximum(low[:, axis] - upper, lower - high[:, axis]), 0.0)
            for axis, lower, upper in ((0, low_x, high_x), (1, low_y, high_y))
        ]
        distance = np.hypot(*aside)
        rise = high[:, 2] - z_low
        return edges[rise > np.tan(np.radians(LOWEST_HORIZON_DEG)) * distance]


def list_objects(building: Building) -> list[Solid]:
    """Return the chimneys and other objects on a building's roof, in the world."""
    origin = building.roof.frame.origin
    return [make_box(item).move(origin) for item in building.model.installations]


def roof_edges(solid: Solid) -> np.ndarray:
    """Return the edges (m, 2, 3) of a solid's roof faces, each once."""
    pairs = {
        (min(start, end), max(start, end))
        for face in solid.faces
        if face.kind == ROOF
        for ring in face.rings
        for start, end in pairwise((*ring, ring[0]))
    }
    return solid.vertices[np.array(sorted(pairs), int).reshape(-1, 2)]


PANEL_MARGIN_M = 0.3  # width (m) that panels leave free along the edges of a roof face
PANEL_WIDTH_M = 1.0  # width (m) of a panel: where less is free none fits
# Share of the irradiation that becomes electricity: modules of 20 %, and 0.8 for heat, cables and
# inverters.
PANEL_EFFICIENCY, PERFORMANCE_RATIO = 0.20, 0.80


def measure_panels(
    solid: Solid, face: int, normal: np.ndarray, objects: Sequence[Solid] = ()
) -> float:
    """Return the area (m2) of a roof face that panels may cover.

    It is PANEL_MARGIN_M or more from its edges and from `objects` on the roof, and nowhere narrower
    than PANEL_WIDTH_M. The face is laid flat: plan coordinates are stretched along its slope.
    """
    covered = [item.project_face(top) for item in objects for top in item.select_faces(ROOF)]
    free = shapely.difference(solid.project_face(solid.faces[face]), shapely.union_all(covered))
    flat = float(np.hypot(normal[0], normal[1]))
    down = normal[:2] / flat if flat > 0 else np.array([1.0, 0.0])
    axes = np.column_stack([down / normal[2], (-down[1], down[0])])
    outline = shapely.transform(free, lambda xy: xy @ axes)
    half = PANEL_WIDTH_M / 2
    core = shapely.buffer(outline, -(PANEL_MARGIN_M + half), join_style="mitre")
    grown = shapely.buffer(core, half, join_style="mitre")
    inner = shapely.buffer(outline, -PANEL_MARGIN_M, join_style="mitre")
    return float(shapely.intersection(grown, inner).area)


def locate(head: FileHead, x: float, y: float) -> tuple[float, float, float]:
    """Return longitude, latitude and true north at a place, in degrees.

    The place is in world metres, the direction clockwise from the axis that points north. Raises
    InputError where the run has no CRS.
    """
    from pyproj import Transformer

    crs = parse_crs(head.crs)
    if crs is None:
        raise InputError(
            "expected a run with a CRS for --sun, got one without; run `hiproof reconstruct` with "
            "--crs"
        )
    to_globe = Transformer.from_crs(horizontal_crs(crs), "EPSG:4326", always_xy=True)
    there = find_units(crs, unit_name=head.unit).from_metres(np.array([[x, y]]))[0]
    longitude, latitude = to_globe.transform(*there)
    step = to_globe.transform(longitude, latitude + 1e-3, direction="INVERSE")
    north = np.degrees(np.arctan2(step[0] - there[0], step[1] - there[1]))
    return float(longitude), float(latitude), float(north)


SKY_CELL_M = 10_000.0  # side (m) of a square that has one sky: its sun differs by 0.1 degrees
LEVEL_ROOF = 1e-3  # least share of a roof face that plan shows: steeper ones are walls
# Settings that say something of the sun alone, and their options.
FOR_SUN = {
    "weather": "--weather",
    "horizon": "--horizon",
    "shading_terrain": "--terrain",
    "sun_on_walls": "--sun-on-walls",
}

MOST_ASKED = 60  # buildings whose ground is compared with a terrain model

Surfaces = dict[int, dict[str, Any]]  # attributes of faces by number


class Cadastre:
    """The sun on the roofs and walls of a town."""

    def __init__(self, town: Town, settings: EnrichSettings) -> None:
        self.town, self.settings = town, settings
        self.edges = ShadingEdges(town)
        self.locate = functools.lru_cache(16)(functools.partial(locate, town.records.head))
        self.read_horizon = functools.lru_cache(16)(read_horizon)

    @functools.cached_property
    def terrain(self) -> TerrainHorizon | None:
        """The horizon of the terrain model, None without one."""
        path = self.settings.shading_terrain
        return TerrainHorizon(self.town.records, path) if path else None

    def find_sky(self, number: int) -> Sky:
        """Return the sky over a building: that of the middle of its square of SKY_CELL_M."""
        longitude, latitude, north = self.locate_cell(number)
        # clear skies change little in 100 m of height
        altitude = max(round(self.town.records.read(number).z_ground, -2), 0.0)
        return make_sky(latitude, longitude, altitude, -north, self.settings.weather)

    def locate_cell(self, number: int) -> tuple[float, float, float]:
        """Return longitude, latitude and true north of a building's square."""
        x, y = (self.town.records.index.boxes[number, :2] // SKY_CELL_M + 0.5) * SKY_CELL_M
        return self.locate(float(x), float(y))

    def find_far_horizon(self, number: int, z: float) -> np.ndarray:
        """Return the tangents (SECTORS,) of the far horizon, seen from a height."""
        horizon = np.zeros(SECTORS)
        if self.settings.horizon:
            north = self.locate_cell(number)[2]
            horizon = np.maximum(horizon, self.read_horizon(self.settings.horizon, -north))
        if self.terrain is not None:
            x, y = self.town.records.index.boxes[number].reshape(2, 2).mean(axis=0).tolist()
            horizon = np.maximum(horizon, self.terrain.find_horizon(x, y, z))
        return horizon

    def describe(
        self, number: int, solid: Solid, party: Collection[int] = ()
    ) -> tuple[dict[str, Any], Surfaces]:
        """Return attributes of a building and of faces of its `solid`; `party` are party walls."""
        size, normals = measure_faces(solid)
        attributes, surfaces = self.describe_roofs(number, solid, size, normals)
        attributes[f"{OWN}sun_sky"] = name_sky(self.settings.weather)
        if self.settings.sun_on_walls:
            walls = [wall for wall in find_walls(solid) if wall.face not in party]
            places = {wall.face: sample_wall(wall, normals[wall.face]) for wall in walls}
            suns = self.irradiate_faces(number, places, normals)
            total = sum(float(size[face] * sun.by_month.sum()) for face, sun in suns.items())
            attributes |= round_values({"wall_sun_kwh": total}, 1)
            surfaces |= {face: round_values(name_values(sun), 3) for face, sun in suns.items()}
        return attributes, surfaces

    def describe_roofs(
        self, number: int, solid: Solid, size: np.ndarray, normals: np.ndarray
    ) -> tuple[dict[str, Any], Surfaces]:
        """Return attributes of building `number`, and of its roof faces."""
        faces = [
            face
            for face, item in enumerate(solid.faces)
            if item.kind == ROOF and normals[face, 2] > LEVEL_ROOF
        ]
        places = {face: sample_face(solid, face, normals[face]) for face in faces}
        suns = self.irradiate_faces(number, places, normals)
        objects = list_objects(self.town.read(number))
        surfaces, totals = {}, np.zeros(3)
        for face, sun in suns.items():
            year = float(sun.by_month.sum())
            panels = measure_panels(solid, face, normals[face], objects)
            power = panels * year * PANEL_EFFICIENCY * PERFORMANCE_RATIO
            totals += (size[face] * year, panels, power)
            surfaces[face] = round_values(
                {**name_values(sun), "pv_area_m2": panels, "pv_kwh": power}, 3
            )
        names = ("roof_sun_kwh", "pv_area_m2", "pv_kwh")
        return round_values(dict(zip(names, totals.tolist(), strict=True)), 1), surfaces

    def irradiate_faces(
        self, number: int, places: dict[int, np.ndarray], normals: np.ndarray
    ) -> dict[int, Irradiation]:
        """Return the sun on faces of building `number` with sample points `places`."""
        if not places:
            return {}
        z_low = min(float(xyz[:, 2].min()) for xyz in places.values())
        edges = self.edges.find_shading_edges(number, z_low)
        sky = self.find_sky(number)
        return {
            face: irradiate(
                normals[face],
                xyz,
                edges,
                sky,
                self.settings.albedo,
                self.find_far_horizon(number, float(xyz[:, 2].mean())),
            )
            for face, xyz in places.items()
        }


def name_values(sun: Irradiation) -> dict[str, float]:
    """Return the values of a face's sun by name."""
    values = {"sun_kwh_m2": float(sun.by_month.sum())}
    values |= {f"sun_kwh_m2_{m:02}": v for m, v in enumerate(sun.by_month.tolist(), 1)}
    return values | {"sun_shaded_share": sun.shaded_share}


def round_values(values: dict[str, float], digits: int) -> dict[str, Any]:
    """Return rounded values under our own names."""
    return {OWN + name: round_number(value, digits) for name, value in values.items()}


def refuse_unusable(settings: EnrichSettings) -> None:
    """Raise InputError where pvlib, another option or a file is missing or unreadable."""
    if settings.sun:
        import_pvlib()
        if settings.horizon:
            read_horizon(settings.horizon)
        if settings.weather:
            read_year(settings.weather)
        if settings.shading_terrain:
            read_terrain(settings.shading_terrain)
        return
    for name, option in FOR_SUN.items():
        if getattr(settings, name):
            raise InputError(f"expected {option} with --sun, got it alone; add --sun")


def refuse_unfit(records: Records, settings: EnrichSettings) -> None:
    """Raise InputError where this run has no CRS, or its weather or terrain does not fit."""
    modelled = np.flatnonzero(records.index.modelled)
    if settings.sun and len(modelled):
        Cadastre(Town(records), settings).find_sky(int(modelled[0]))
        if settings.shading_terrain:
            refuse_other_heights(records, modelled, settings.shading_terrain)


def refuse_other_heights(records: Records, modelled: np.ndarray, path: str) -> None:
    """Raise InputError where a terrain model lies far above or below the ground of buildings.

    In another height system, another unit or with the buildings in it, it would shade them all.
    """
    terrain, _, _ = open_terrain(records, path)
    chosen = np.unique(modelled[np.linspace(0, len(modelled) - 1, MOST_ASKED).astype(int)])
    ground = np.array([records.read(number).z_ground for number in chosen])
    boxes = records.index.boxes[chosen]
    gaps = terrain.height_at((boxes[:, :2] + boxes[:, 2:]) / 2) - ground
    gap = float(np.median(gaps[np.isfinite(gaps)])) if np.isfinite(gaps).any() else 0.0
    if abs(gap) > OTHER_GROUND_M:
        raise InputError(
            f"expected a terrain model at the ground of the buildings, got {terrain.source} in "
            f"{path}, which lies {gap:+.1f} m from it; check its height system and its unit, and "
            "that it is a model of the terrain without buildings"
        )
