"""The attributes of a building and its parts: roofer's, our own, those of the input."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import shapely

from ..compose.settle import round_number
from ..data_files import Values
from ..frames import METRES, Units
from ..model import ROOF, Building, Solid
from ..model.roof_figures import RoofFigures, find_ground_height, roof_figures
from ..primitives.cants import CANTED, MEASURES, list_cants
from ..primitives.catalogue import CATALOGUE
from ..status import Status
from .attribute_list import OWN, PREFIX, SHAPE, TABLES
from .reprojected import Reprojected
from .values import metres, plain, plain_text

ROW_ENCODER = json.JSONEncoder(check_circular=False)  # a row cannot hold itself


def measure_terrain(lines: tuple[np.ndarray, ...]) -> tuple[float, float, float] | None:
    """Return the lowest, highest and mean height of terrain `lines` (m, 3).

    The mean is by length. None where no line is known.

    >>> line = np.array([[0, 0, 1], [3, 0, 1], [3, 1, 3], [0, 0, 1]], float)
    >>> measure_terrain((line[:3],))
    (1.0, 3.0, 1.25)
    """
    lines = tuple(line for line in lines if len(line) > 1 and np.isfinite(line).all())
    if not lines:
        return None
    z = np.concatenate([line[:, 2] for line in lines])
    middle = np.concatenate([0.5 * (line[1:, 2] + line[:-1, 2]) for line in lines])
    length = np.concatenate([np.hypot(*np.diff(line[:, :2], axis=0).T) for line in lines])
    mean = np.average(middle, weights=length) if length.any() else z.mean()
    return float(z.min()), float(z.max()), float(mean)


ONE_ENDED = ("side_hip", "side_half_hip")


def osm_tags(building: Building, figures: RoofFigures | None) -> Values:
    """Return the tags by name, in the order of their table.

    None what cannot be told or, of a flat roof, has no meaning.

    >>> import hiproof
    >>> from hiproof.model.roof_figures import roof_figures
    >>> x, y = np.meshgrid(np.arange(0, 10, 0.5), np.arange(0, 6, 0.5))
    >>> house = hiproof.reconstruct(np.column_stack([x.ravel(), y.ravel(),
    ...     5 - 0.5 * abs(y.ravel() - 2.75)]))
    >>> tags = osm_tags(house, roof_figures(house.solid))
    >>> tags["roof:shape"], round(tags["roof:angle"])
    ('gabled', 27)
    """
    if figures is None or not building.parts:
        return dict.fromkeys(TABLES["osm"].names)
    main = building.model.main
    roof = [i for i, face in enumerate(building.solid.faces) if face.kind == ROOF]
    visible = [i for i in roof if building.solid.faces[i].part == main] or roof
    largest = max(visible, key=lambda i: figures.face_area_m2[i])
    lowest = min(
        building.solid.vertices[list(ring), 2].min()
        for i in visible
        for ring in building.solid.faces[i].rings
    )
    ground = min(find_ground_height(building, figures), figures.h_base)
    part = building.parts[main]
    values = (
        osm_shape(part.type),
        figures.h_max - lowest,
        math.degrees(0.5 * math.pi - part.kappa) % 360.0
        if part.type in ONE_ENDED
        else figures.face_azimuth_deg[largest],
        figures.face_slope_deg[largest],
        figures.h_max - ground,
    )
    return dict(zip(TABLES["osm"].names, map(format_number, values), strict=True))


def osm_shape(name: str) -> str | None:
    """Return the value of roof:shape of a roof type, None if it has none."""
    return CATALOGUE[name].osm_shape if name in CATALOGUE else None


def format_number(value: Any) -> Any:
    """Round a number to the centimetre or hundredth of a degree; NaN is None."""
    if isinstance(value, (float, np.floating)):
        return round_number(float(value), 2) if math.isfinite(value) else None
    return value


FALLBACKS = (Status.SIMPLIFIED, Status.FLAT_FALLBACK, Status.FROM_ATTRIBUTES)


def measure_figures(building: Building) -> RoofFigures | None:
    """Return the figures of the building's solid, None without one."""
    return None if building.built is None else roof_figures(building.solid)


def building_attributes(
    building: Building,
    figures: RoofFigures | None = None,
    prefix: str = PREFIX,
    units: Units = METRES,
    osm: bool = False,
) -> Values:
    """Return a building's attributes by name, in a fixed order.

    They are the input's own, roofer's (`prefix`), ours (`hiproof_`), and with `osm` the tags of
    OpenStreetMap. Values are str, int, float, bool or None; what cannot be told is None. Where
    names clash, what we computed wins. Lengths are metres, `volume` m3, `pt_density` points/m2 also
    in a file whose coordinates are in other `units`, which `hiproof_units` then says. What each is
    stands in data/attributes.toml.
    """
    further: Values = {}
    if building.built is not None:
        counts = {
            "installations": len(building.built.installations),
            "passages": len(building.built.underside.passages),
        }
        further |= {name: n for name, n in counts.items() if n}
        if building.built.eaves is not None:
            further["volume_lod23"] = round_number(building.built.finest_solid.volume, 4)
    if building.epochs_used:
        further["survey_date"] = building.survey_date
        further["epochs_used"] = " ".join(building.epochs_used)
    if building.change is not None:
        further |= change_attributes(building.change)
    if not units.are_metres:
        further["units"] = f"attributes in m, m2 and m3; plan coordinates in {units.plan_name}"
    computed = {
        **add_prefix(prefix, roofer_attributes(building, figures)),
        **add_prefix(OWN, hiproof_attributes(building, figures, units)),
        **(osm_tags(building, figures) if osm else {}),
        **add_prefix(OWN, further),
    }
    given = {plain_text(name): plain(value) for name, value in building.attributes.items()}
    return given | {name: plain(value) for name, value in computed.items()}


def add_prefix(prefix: str, values: Values) -> Values:
    return {prefix + name: value for name, value in values.items()}


ROOF_HEIGHTS = ("min", "50p", "70p", "max", "ridge")
QUALITY_FIGURES = (
    *("psd_mean", "psd_std", "p95", "share_within_20cm", "outline_iou", "unexplained_area_m2"),
)


def roofer_attributes(building: Building, figures: RoofFigures | None) -> Values:
    """Return the attributes that users of roofer and 3DBAG expect, unprefixed."""
    quality, values = building.quality, dict.fromkeys(TABLES["roofer"].names)
    values |= {
        "h_ground": metres(find_ground_height(building, figures)),
        "roof_type": "no points" if building.status is Status.NO_POINTS else "unknown",
        "rmse_lod22": round_number(quality.rmse),
        "pt_density": round_number(quality.density),
        "nodata_frac": round_number(quality.nodata_share),
        "extrusion_mode": "skip",
    }
    if figures is not None:
        is_block = building.status in FALLBACKS and len(building.parts) == 1
        values |= shape_attributes(figures) | {
            "roof_type": figures.roofer_type,
            "roof_n_surfaces": figures.roof_faces,
            "slope": round_number(figures.slope_deg, 4),
            "azimuth": round_number(figures.azimuth_deg, 4),
            "extrusion_mode": "lod11_fallback" if is_block else "standard",
        }
    return values


def shape_attributes(figures: RoofFigures) -> Values:
    """Return heights and volume, without prefix."""
    heights = {f"h_roof_{name}": metres(getattr(figures, f"h_{name}")) for name in ROOF_HEIGHTS}
    return {**heights, "volume_lod22": round_number(figures.volume_m3, 4)}


def hiproof_attributes(
    building: Building, figures: RoofFigures | None = None, units: Units = METRES
) -> Values:
    """Return our own attributes, without prefix."""
    quality, kind = building.quality, building.type
    recognised = max(building.recognised, key=building.recognised.__getitem__, default="")
    heights = measure_terrain(building.terrain_intersection) or (math.nan,) * 3
    names = ("ground_low", "ground_high", "ground_mean")
    return {
        "status": building.status.code,
        "quality": None if building.grade is None else building.grade.code,
        "detail": building.detail or building.status.value,
        "roof_type": kind,
        "roof_type_probability": round_number(building.types.get(kind or "", math.nan)),
        "network_type": recognised or None,
        "network_type_probability": round_number(building.recognised.get(recognised, math.nan)),
        "h_eave": None if figures is None else metres(figures.h_eave),
        "parts": len(building.parts),
        "points": int(quality.points),
        **{name: round_number(getattr(quality, name)) for name in QUALITY_FIGURES},
        "ground_source": building.ground_source or None,
        **dict(zip(names, map(metres, heights), strict=True)),
        "shift_x": round_number(building.shift[0]),
        "shift_y": round_number(building.shift[1]),
        "iso19107_lod22": None
        if building.built is None
        else check_as_written(building.solid, units),
    }


def change_attributes(change: Values) -> Values:
    """Return the attributes of a building's last change, without prefix."""
    place: Values = next(iter(change["places"]), {})
    return {
        "change": change["class"],
        "change_kind": place.get("kind"),
        "change_m": place.get("difference"),
        "change_sigma_m": place.get("sigma"),
        "valid_from": change.get("valid_from"),
        "valid_to": change.get("valid_to"),
    }


def check_as_written(solid: Solid, units: Units) -> str:
    """Return ISO 19107's codes as JSON against the solid as written, in another CRS, too."""
    if not isinstance(units, Reprojected):
        return "[]"
    from ..compose import check_solid

    there = Units(units.plan, units.height).to_metres(
        np.round(units.from_metres(solid.vertices), 4)
    )
    about_origin = Solid(there, solid.faces).move(-np.floor(there.min(axis=0)))
    return json.dumps(sorted({finding.code for finding in check_solid(about_origin)}))


def part_values(building: Building, number: int, visible: shapely.Geometry) -> Values:
    """Return a part's values: type, `visible` area, place, parameters, deviations."""
    part = building.parts[number]
    x, y, z = building.roof.frame.to_world(part.translation)
    # Cants share a column: thirty columns that hardly a part fills would hide the others.
    cants = list_cants(part.parameters)
    rows = [
        [round_number(part.parameters[f"{measure}_{cant}"]) for measure in MEASURES]
        for cant in cants
    ]
    columns = {"t_z": "z_eave_sigma", "kappa": "rotation_sigma"} | {
        name: f"{name}_sigma" for name in SHAPE
    }
    return {
        "part": number,
        "type": part.type,
        "area_m2": metres(visible.area),
        "x": metres(x),
        "y": metres(y),
        "z_eave": metres(z),
        "rotation": round_number(math.degrees(part.kappa)),
        **{
            name: round_number(value)
            for name, value in part.parameters.items()
            if name not in CANTED
        },
        **({"cants": ROW_ENCODER.encode(rows)} if cants else {}),
        **{
            columns[name]: round_number(math.degrees(value) if name == "kappa" else value)
            for name, value in part.sigma.items()
            if name in columns
        },
    }
