"""The solar cadastre: the sun on roofs and walls, and what panels would yield."""

from __future__ import annotations

import functools
from collections.abc import Collection
from typing import Any

import numpy as np

from ..errors import InputError
from ..model import ROOF, Solid
from ..settings import EnrichSettings
from ..write.attribute_list import OWN
from ..write.values import round_value
from .areas import measure_faces
from .far import TerrainHorizon, open_terrain, read_horizon
from .horizon import SECTORS
from .panels import estimate_yield, measure_panels
from .place import locate
from .records import Records
from .shade import ShadingEdges, list_objects
from .sky import Sky, make_sky
from .sun import Irradiation, irradiate, sample_face, sample_wall
from .town import Town
from .walls import find_walls
from .weather import import_pvlib, name_sky

SKY_CELL_M = 10_000.0  # side (m) of a square that has one sky: its sun differs by 0.1 degrees
LEVEL_ROOF = 1e-3  # least share of a roof face that plan shows: steeper ones are walls
FOR_SUN = {
    "weather": "--weather",
    "horizon": "--horizon",
    "shading_terrain": "--terrain",
    "sun_on_walls": "--sun-on-walls",
}
"""Settings that say something of the sun alone, and their options."""

Surfaces = dict[int, dict[str, Any]]
"""Attributes of faces by number."""


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
        """Return attributes of building `number`, and of its faces.

        These are by number in its `solid`, of which the faces `party` are party walls.
        """
        attributes, surfaces = self.describe_roofs(number, solid)
        attributes[f"{OWN}sun_sky"] = name_sky(self.settings.weather)
        if self.settings.sun_on_walls:
            sums, walls = self.describe_walls(number, solid, party)
            attributes, surfaces = attributes | sums, surfaces | walls
        return attributes, surfaces

    def describe_roofs(self, number: int, solid: Solid) -> tuple[dict[str, Any], Surfaces]:
        """Return attributes of building `number`, and of its roof faces."""
        size, normals = measure_faces(solid)
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
            power = estimate_yield(panels, year)
            totals += (size[face] * year, panels, power)
            surfaces[face] = round_values(
                {**name_values(sun), "pv_area_m2": panels, "pv_kwh": power}, 3
            )
        names = ("roof_sun_kwh", "pv_area_m2", "pv_kwh")
        return round_values(dict(zip(names, totals.tolist(), strict=True)), 1), surfaces

    def describe_walls(
        self, number: int, solid: Solid, party: Collection[int]
    ) -> tuple[dict[str, Any], Surfaces]:
        """Return attributes of building `number`, and of its outer walls."""
        size, normals = measure_faces(solid)
        walls = [wall for wall in find_walls(solid) if wall.face not in party]
        places = {wall.face: sample_wall(wall, normals[wall.face]) for wall in walls}
        suns = self.irradiate_faces(number, places, normals)
        total = sum(size[face] * sun.by_month.sum() for face, sun in suns.items())
        surfaces = {face: round_values(name_values(sun), 3) for face, sun in suns.items()}
        return round_values({"wall_sun_kwh": float(total)}, 1), surfaces

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
    return {OWN + name: round_value(value, digits) for name, value in values.items()}


def refuse_unusable(settings: EnrichSettings) -> None:
    """Raise InputError where no run can be answered.

    pvlib is missing, an option lacks another, or the horizon cannot be read.
    """
    if settings.sun:
        import_pvlib()
        if settings.horizon:
            read_horizon(settings.horizon)
        return
    for name, option in FOR_SUN.items():
        if getattr(settings, name):
            raise InputError(f"expected {option} with --sun, got it alone; add --sun")


def refuse_unfit(records: Records, settings: EnrichSettings) -> None:
    """Raise InputError where the sun of this run cannot be answered.

    It has no CRS, or its weather or its terrain does not fit.
    """
    modelled = np.flatnonzero(records.index.modelled)
    if settings.sun and len(modelled):
        Cadastre(Town(records), settings).find_sky(int(modelled[0]))
        if settings.shading_terrain:
            open_terrain(records, settings.shading_terrain)
