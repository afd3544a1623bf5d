"""The solar cadastre: the sun on roof faces, and what panels would yield."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import shapely

from ..errors import InputError
from ..model import ROOF, Solid
from ..read.crs import find_units, horizontal_crs, parse_crs
from ..settings import EnrichSettings
from ..write.attribute_list import OWN
from ..write.head import FileHead
from ..write.values import round_value
from .areas import area_vectors
from .records import Records
from .shade import ShadingEdges
from .sky import Sky, import_pvlib, make_sky
from .sun import irradiate, sample_face
from .town import Town

SKY_CELL_M = 10_000.0  # side (m) of a square that has one sky: its sun differs by 0.1 degrees
PANEL_MARGIN_M = 0.3  # width (m) that panels leave free along the edges of a roof face
# Share of the irradiation that becomes electricity: modules of 20 %, and 0.8 for heat, cables and
# inverters.
PANEL_EFFICIENCY, PERFORMANCE_RATIO = 0.20, 0.80


class Cadastre:
    """The sun on the roofs of a town."""

    def __init__(self, town: Town, settings: EnrichSettings) -> None:
        self.town, self.settings = town, settings
        self.edges = ShadingEdges(town)
        self.locate = functools.lru_cache(16)(functools.partial(locate, town.records.head))

    def find_sky(self, number: int) -> Sky:
        """Return the sky over a building: that of the middle of its square of SKY_CELL_M."""
        records = self.town.records
        x, y = (np.floor(records.index.boxes[number, :2] / SKY_CELL_M) + 0.5) * SKY_CELL_M
        longitude, latitude, north = self.locate(float(x), float(y))
        # clear skies change little in 100 m of height
        altitude = max(round(records.read(number).z_ground, -2), 0.0)
        return make_sky(latitude, longitude, altitude, -north, self.settings.weather)

    def describe(
        self, number: int, solid: Solid
    ) -> tuple[dict[str, Any], dict[int, dict[str, Any]]]:
        """Return attributes of building `number`, and of its roof faces.

        These are by number in its `solid`.
        """
        vectors = area_vectors(solid)
        size = np.linalg.norm(vectors, axis=1)
        normals = vectors / np.maximum(size, 1e-12)[:, None]
        faces = [
            k for k, face in enumerate(solid.faces) if face.kind == ROOF and normals[k, 2] > 1e-3
        ]
        places = {face: sample_face(solid, face, normals[face]) for face in faces}
        z_low = min(float(xyz[:, 2].min()) for xyz in places.values())
        edges = self.edges.find_shading_edges(number, z_low)
        sky = self.find_sky(number)
        surfaces = {}
        totals = np.zeros(3)
        for face in faces:
            sun = irradiate(normals[face], places[face], edges, sky, self.settings.albedo)
            year = float(sun.by_month.sum())
            panels = measure_panels(solid, face, normals[face])
            power = panels * year * PANEL_EFFICIENCY * PERFORMANCE_RATIO
            totals += (size[face] * year, panels, power)
            values = {"sun_kwh_m2": year}
            values |= {f"sun_kwh_m2_{m:02}": v for m, v in enumerate(sun.by_month.tolist(), 1)}
            values |= {"sun_shaded_share": sun.shaded_share}
            values |= {"pv_area_m2": panels, "pv_kwh": power}
            surfaces[face] = {OWN + name: round_value(value, 3) for name, value in values.items()}
        names = ("roof_sun_kwh", "pv_area_m2", "pv_kwh")
        attributes = {
            OWN + name: round_value(value, 1) for name, value in zip(names, totals, strict=True)
        }
        return attributes, surfaces


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


def measure_panels(solid: Solid, face: int, normal: np.ndarray) -> float:
    """Return the area (m2) of a roof face that panels may cover.

    It is PANEL_MARGIN_M or more from its edges. The face is laid flat:
    plan coordinates are stretched along its slope.
    """
    flat = float(np.hypot(normal[0], normal[1]))
    down = normal[:2] / flat if flat > 0 else np.array([1.0, 0.0])
    axes = np.column_stack([down / normal[2], (-down[1], down[0])])
    outline = shapely.transform(solid.project_face(solid.faces[face]), lambda xy: xy @ axes)
    return float(shapely.buffer(outline, -PANEL_MARGIN_M, join_style="mitre").area)


def refuse_unusable(settings: EnrichSettings) -> None:
    """Raise InputError where no run can be answered.

    pvlib is missing, or an option lacks another.
    """
    if settings.sun:
        import_pvlib()
    elif settings.weather:
        raise InputError("expected --weather with --sun, got it alone; add --sun")


def refuse_unfit(records: Records, settings: EnrichSettings) -> None:
    """Raise InputError where the sun of this run cannot be answered.

    It has no CRS, or its weather file does not fit.
    """
    modelled = np.flatnonzero(records.index.modelled)
    if settings.sun and len(modelled):
        Cadastre(Town(records), settings).find_sky(int(modelled[0]))
