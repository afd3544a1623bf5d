"""Every attribute and table that hiproof writes, with unit and meaning.

The formats name them, and the documents list them.
"""

from __future__ import annotations

from typing import NamedTuple

from ..formats import FORMATS
from ..primitives.catalogue import CATALOGUE

PREFIX = "rf_"
OWN = "hiproof_"


class Attribute(NamedTuple):
    """A named value of the `kind` text, number or count.

    `unit` is empty where there is none.
    """

    name: str
    kind: str
    unit: str
    meaning: str


class AttributeTable(NamedTuple):
    """Attributes that stand together; `prefix` precedes their names in files."""

    title: str
    where: str
    attributes: tuple[Attribute, ...]
    prefix: str = ""


ROOFER = (
    Attribute(
        "h_ground", "number", "m", "height of the ground: the lowest terrain along the outline"
    ),
    Attribute("h_roof_min", "number", "m", "lowest height of the roof"),
    Attribute("h_roof_50p", "number", "m", "height that half of the roof's area lies below"),
    Attribute("h_roof_70p", "number", "m", "height that seven tenths of the roof's area lie below"),
    Attribute("h_roof_max", "number", "m", "highest height of the roof"),
    Attribute(
        "h_roof_ridge", "number", "m", "height of the longest level ridge, null where there is none"
    ),
    Attribute("volume_lod22", "number", "m3", "volume of the solid"),
    Attribute(
        "roof_type",
        "text",
        "",
        "roofer's type: horizontal, multiple horizontal, slanted, no points, unknown",
    ),
    Attribute("roof_n_surfaces", "count", "", "roof faces of the solid"),
    Attribute("slope", "number", "deg", "slope of the largest roof face"),
    Attribute(
        "azimuth",
        "number",
        "deg",
        "compass direction in which the largest roof face falls, of two equal ones either; null "
        "where level",
    ),
    Attribute(
        "rmse_lod22",
        "number",
        "m",
        "root mean square distance of the points from the roof, facade points included",
    ),
    Attribute("pt_density", "number", "1/m2", "points by area of the outline"),
    Attribute("nodata_frac", "number", "", "share of the outline's 1 m cells that hold no point"),
    Attribute(
        "extrusion_mode", "text", "", "standard, lod11_fallback (a flat block) or skip (no model)"
    ),
)

OF_PARTS = (
    "h_roof_min",
    "h_roof_50p",
    "h_roof_70p",
    "h_roof_max",
    "h_roof_ridge",
    "volume_lod22",
    "roof_type",
    "roof_n_surfaces",
)
"""Those that building parts have of their own."""

QUALITY = Attribute(
    "quality",
    "text",
    "",
    "how good the model is by its points: good, fair or poor; null where it was not measured",
)

HIPROOF = (
    Attribute(
        "status", "text", "", "what came of the building: modelled, simplified, flat_fallback, ..."
    ),
    QUALITY,
    Attribute(
        "detail",
        "text",
        "",
        "the status as a sentence about this building, and what speaks against the model",
    ),
    Attribute(
        "roof_type",
        "text",
        "",
        "type of the part that shows the largest area: a name of the catalogue, or free",
    ),
    Attribute("roof_type_probability", "number", "", "probability of that type after the fits"),
    Attribute("network_type", "text", "", "type that the network names, where it was asked"),
    Attribute("network_type_probability", "number", "", "probability that the network gives it"),
    Attribute(
        "h_eave", "number", "m", "height that half of the length of the roof's eaves lies below"
    ),
    Attribute("parts", "count", "", "roof parts"),
    Attribute("points", "count", "", "points that the building was judged by"),
    Attribute(
        "psd_mean",
        "number",
        "m",
        "mean distance of the points from the roof, facade points included",
    ),
    Attribute("psd_std", "number", "m", "standard deviation of those distances"),
    Attribute("p95", "number", "m", "distance that 95 of 100 points stay below"),
    Attribute(
        "share_within_20cm",
        "number",
        "",
        "share of the points 0.3 m or more inside the outline that lie within 0.2 m over or under "
        "the roof; null where"
        " fewer than ten lie there",
    ),
    Attribute(
        "outline_iou",
        "number",
        "",
        "intersection over union of the roof's outline with the footprint",
    ),
    Attribute(
        "unexplained_area_m2",
        "number",
        "m2",
        "area most of whose points lie over 0.5 m off the roof",
    ),
    Attribute("ground_source", "text", "", "where the ground's height came from"),
    Attribute(
        "ground_low",
        "number",
        "m",
        "lowest height of the terrain along the outline; null where no terrain is known",
    ),
    Attribute("ground_high", "number", "m", "highest height of the terrain along the outline"),
    Attribute("ground_mean", "number", "m", "mean height of the terrain along the outline"),
    Attribute(
        "shift_x",
        "number",
        "m",
        "how far east the footprint was moved onto its roof; 0 where it was not",
    ),
    Attribute("shift_y", "number", "m", "the same north"),
    Attribute(
        "iso19107_lod22",
        "text",
        "",
        "ISO 19107 codes of our own check of the solid; [] is valid, none without a model",
    ),
    Attribute(
        "installations",
        "count",
        "",
        "only where there are some (`--installations`): chimneys and other objects on the roof",
    ),
    Attribute(
        "passages",
        "count",
        "",
        "only where there are some (`--underpasses`): passages below the building",
    ),
    Attribute(
        "volume_lod23",
        "number",
        "m3",
        "only with LoD2.3: volume of the solid with overhangs",
    ),
    Attribute(
        "survey_date",
        "text",
        "",
        "only in a run of several surveys (`--epoch`): name of the survey that shows the building",
    ),
    Attribute("epochs_used", "text", "", "names of all surveys of whose points its model is made"),
    Attribute("units", "text", "", "only where coordinates are not metres: which unit is which"),
    Attribute(
        "change", "text", "", "only after an update, where not unchanged: changed, new, gone, ..."
    ),
    Attribute("change_kind", "text", "", "what changed most, such as part_raised"),
    Attribute("change_m", "number", "m", "new height minus the earlier one there"),
    Attribute("change_sigma_m", "number", "m", "standard deviation of that difference"),
    Attribute("valid_from", "text", "", "date of the survey that first shows the roof as it is"),
    Attribute("valid_to", "text", "", "date of the survey that no longer shows the building"),
)

ENRICHED = (
    Attribute(
        "ground_area_m2",
        "number",
        "m2",
        "area of the ground surface, and of ceilings over passages",
    ),
    Attribute("flat_roof_area_m2", "number", "m2", "area of roof faces that slope less than 3 deg"),
    Attribute("sloped_roof_area_m2", "number", "m2", "area of all other roof faces"),
    Attribute("outer_wall_area_m2", "number", "m2", "area of walls that touch no other building"),
    Attribute("party_wall_area_m2", "number", "m2", "area of walls that touch another building"),
    Attribute(
        "party_walls",
        "text",
        "m2",
        "area of the party wall with each neighbour by id, as JSON; either neighbour has the same",
    ),
    Attribute(
        "house_type",
        "text",
        "",
        "detached, semi_detached, end_terrace, mid_terrace or apartment_block; null where it is no "
        "house",
    ),
    Attribute("tabula_class", "text", "", "TABULA's class: SFH, TH, MFH or AB"),
    Attribute("storeys_min", "count", "", "least number of full storeys below the eaves"),
    Attribute("storeys_max", "count", "", "greatest number of them"),
    Attribute(
        "gross_floor_area_min_m2", "number", "m2", "least area of all floors, attics included"
    ),
    Attribute("gross_floor_area_max_m2", "number", "m2", "greatest area of them"),
    Attribute("heated_volume_m3", "number", "m3", "volume of the solid, the attic included"),
    Attribute(
        "envelope_area_m2", "number", "m2", "area of outer walls, roof and ground, which lose heat"
    ),
    Attribute("compactness", "number", "1/m", "A/V: area of the envelope by the volume"),
    Attribute(
        "ridge_direction_deg",
        "number",
        "deg",
        "compass direction of the longest level ridge, 0 to 180; null without one",
    ),
    Attribute(
        "neighbours_unknown",
        "flag",
        "",
        "whether a neighbour may lack a model: one that touches the outline has none, or the "
        "building stands at the border of the run",
    ),
    Attribute(
        "not_enriched",
        "text",
        "",
        "only where `hiproof enrich` failed on the building: the reason; it has none of the other "
        "attributes then",
    ),
)
"""What `hiproof enrich` adds to a building."""

ENRICHED_SUN = (
    Attribute(
        "sun_sky",
        "text",
        "",
        "the sky of all these values: the name of the weather file, or `clear sky`",
    ),
    Attribute("roof_sun_kwh", "number", "kWh", "irradiation of all roof surfaces in a year"),
    Attribute(
        "wall_sun_kwh",
        "number",
        "kWh",
        "irradiation of all outer walls in a year, only with `--sun-on-walls`",
    ),
    Attribute(
        "pv_area_m2",
        "number",
        "m2",
        "area for panels: 0.3 m and more from roof edges and objects on the roof, and nowhere "
        "narrower than 1 m",
    ),
    Attribute(
        "pv_kwh",
        "number",
        "kWh",
        "yield of such panels in a year: modules of 20 %, performance ratio 0.8",
    ),
)

ENRICHED_SUN_SURFACE = (
    Attribute(
        "sun_kwh_m2",
        "number",
        "kWh/m2",
        "irradiation in a year, shaded by buildings, terrain and the horizon file",
    ),
    *(
        Attribute(f"sun_kwh_m2_{month:02}", "number", "kWh/m2", f"the same in month {month}")
        for month in range(1, 13)
    ),
    Attribute("sun_shaded_share", "number", "", "share of the direct light that these take"),
    Attribute("pv_area_m2", "number", "m2", "of a roof: area for panels, as of a building"),
    Attribute("pv_kwh", "number", "kWh", "of a roof: yield of such panels in a year"),
)

ENRICHED_3DBAG = (
    Attribute("b3_opp_grond", "number", "m2", "as hiproof_ground_area_m2"),
    Attribute("b3_opp_dak_plat", "number", "m2", "as hiproof_flat_roof_area_m2"),
    Attribute("b3_opp_dak_schuin", "number", "m2", "as hiproof_sloped_roof_area_m2"),
    Attribute("b3_opp_buitenmuur", "number", "m2", "as hiproof_outer_wall_area_m2"),
    Attribute("b3_opp_scheidingsmuur", "number", "m2", "as hiproof_party_wall_area_m2"),
)

ENRICHED_SURFACE = (
    Attribute(
        f"{OWN}party_with",
        "text",
        "",
        "of a wall: id of the building that it touches; walls are cut along party walls",
    ),
)

OSM = (
    Attribute(
        "roof:shape",
        "text",
        "",
        "of the part that shows the largest area, as OpenStreetMap names it",
    ),
    Attribute(
        "roof:height",
        "number",
        "m",
        "from the lowest edge of that part's roof to the top of the building",
    ),
    Attribute(
        "roof:direction",
        "number",
        "deg",
        "compass direction that its largest face, or its hipped end, looks in",
    ),
    Attribute("roof:angle", "number", "deg", "slope of its largest face"),
    Attribute("height", "number", "m", "from the ground to the top"),
)

ROOF_SURFACE = (
    Attribute(
        "rf_slope",
        "number",
        "deg",
        "slope of the surface, of a curved one the mean by area (in CityGML: slope)",
    ),
    Attribute(
        "rf_azimuth",
        "number",
        "deg",
        "compass direction in which it falls, null where level or where it falls to all sides "
        "(in CityGML: azimuth)",
    ),
    Attribute("hiproof_part", "count", "", "number of its roof part, from 0"),
    Attribute("hiproof_part_type", "text", "", "type of its roof part"),
)

BUILDING_PART = (
    *(Attribute(PREFIX + a.name, *a[1:]) for a in ROOFER if a.name in OF_PARTS),
    Attribute(f"{OWN}h_eave", "number", "m", "as of a building"),
    Attribute(f"{OWN}roof_type", "text", "", "type of the largest roof part"),
    Attribute(
        f"{OWN}primitives",
        "list",
        "m, deg",
        "its roof parts, each with part, type, area_m2, x, y, z_eave, rotation, parameters and "
        "deviations as in the table Parts"
        " (in CityGML: attribute sets hiproof_primitive_0, ...)",
    ),
)

PARAMETERS = (
    Attribute("id", "text", "", "the building's id"),
    Attribute("status", "text", "", "as hiproof_status"),
    Attribute("quality", "text", "", "as hiproof_quality"),
    Attribute("detail", "text", "", "as hiproof_detail"),
    Attribute(
        "type",
        "text",
        "",
        "type of the part that shows the largest area; `hiproof build` reads those of the parts",
    ),
    Attribute(
        "origin",
        "list",
        "m",
        "origin x, y, z of the building's frame in the world; null without a model",
    ),
    Attribute("parts", "list", "", "every part of the roof, as below"),
    Attribute(
        "outline",
        "list",
        "m",
        "rings of the outline, the outer first, about the origin; the footprint's without a model",
    ),
    Attribute(
        "shift",
        "list",
        "m",
        "x, y by which the footprint was moved onto its roof to become the outline",
    ),
    Attribute("z_ground", "number", "m", "height of the ground in the world"),
    Attribute("ground_source", "text", "", "where it came from"),
    Attribute(
        "terrain_line",
        "list",
        "m",
        "closed lines of x, y, z in the world where the walls meet the terrain",
    ),
    Attribute(
        "installations",
        "list",
        "",
        "objects on the roof, as below; left out where there are none",
    ),
    Attribute(
        "walls",
        "text",
        "",
        "terrain, where walls reach down to terrain_line; left out: they end at z_ground",
    ),
    Attribute(
        "passages",
        "list",
        "",
        "passages below the building, as below; left out where there are none",
    ),
    Attribute(
        "overhangs",
        "list",
        "",
        "edges at which the roof reaches beyond the walls, as below; left out without LoD2.3",
    ),
    Attribute(
        "roof_thickness",
        "number",
        "m",
        "thickness of the roof beyond the walls, measured upright; only with overhangs",
    ),
    Attribute(
        "footprint_kind",
        "text",
        "",
        "walls, where the roof reaches beyond the outline, or roof, where walls stand within it; "
        "only with overhangs",
    ),
    Attribute("attributes", "object", "", "the input's own"),
    Attribute("points", "count", "", "points that the building was judged by"),
    Attribute(
        "residuals",
        "object",
        "m",
        "psd_mean, psd_std, rmse, p95, share_within_20cm, outline_iou as above",
    ),
    Attribute("density", "number", "1/m2", "points by area of the outline"),
    Attribute("nodata_share", "number", "", "as rf_nodata_frac"),
    Attribute("unexplained_area_m2", "number", "m2", "as hiproof_unexplained_area_m2"),
    Attribute("objective", "number", "", "value of what was minimised"),
    Attribute(
        "recognised", "object", "", "probability by roof type, from the network where it was asked"
    ),
    Attribute("types", "object", "", "probability by roof type, after the fits"),
    Attribute(
        "survey_date",
        "text",
        "",
        "only in a run of several surveys: name of the survey that shows the building",
    ),
    Attribute("epochs_used", "list", "", "names of all surveys of whose points its model is made"),
    Attribute(
        "change",
        "object",
        "",
        "what `hiproof update` found last, as below; only where the building was not unchanged",
    ),
)

CHANGE = (
    Attribute("class", "text", "", "changed, new, gone, not_covered or uncertain"),
    Attribute("survey", "text", "", "date of the survey that shows it, as 2014-02-09"),
    Attribute(
        "chance", "number", "", "bound on the probability that an unchanged building looks like it"
    ),
    Attribute("places", "list", "", "every place that changed, the largest first, as below"),
    Attribute(
        "lineage",
        "list",
        "",
        "number of the earlier part that each part continues, null for a new part",
    ),
    Attribute(
        "predecessors", "list", "", "ids of the earlier buildings, where footprints were replaced"
    ),
    Attribute("valid_from", "text", "", "date of the survey that first shows the roof as it is"),
    Attribute("valid_to", "text", "", "date of the survey that no longer shows the building"),
    Attribute("history", "list", "", "only with `--history`: earlier models that ended, as below"),
)

ENDED_MODEL = (
    Attribute("id", "text", "", "id of the building that ended, or had that model"),
    Attribute("valid_from", "text", "", "date of the survey that first shows it, null if unknown"),
    Attribute("valid_to", "text", "", "date of the survey that no longer shows it"),
    Attribute("type", "text", "", "roof type of its largest part"),
    Attribute("z_ground", "number", "m", "height of its ground in the world"),
    Attribute("z_top", "number", "m", "height of its highest point in the world"),
    Attribute("outline", "list", "m", "its outline in the world"),
    Attribute("origin", "list", "m", "origin of its parts"),
    Attribute("parts", "list", "", "its parts"),
)

CHANGE_PLACE = (
    Attribute("kind", "text", "", "what changed there, such as part_raised"),
    Attribute("difference", "number", "m", "new height of the roof minus the earlier one"),
    Attribute("sigma", "number", "m", "standard deviation of that difference"),
    Attribute("area", "number", "m2", "area in plan"),
    Attribute("parts", "list", "", "numbers of the earlier and the new part there, null for none"),
    Attribute("outlines", "list", "m", "polygons in the world"),
)

PART = (
    Attribute("type", "text", "", "a name of the catalogue"),
    Attribute(
        "parameters",
        "object",
        "m, deg",
        "by name; `hiproof build --shapes` lists those of every type",
    ),
    Attribute(
        "position",
        "list",
        "m",
        "x, y of the rectangle's centre and z of the lowest eave, about the origin",
    ),
    Attribute(
        "rotation", "number", "deg", "from the x axis to the rectangle's length, counter-clockwise"
    ),
    Attribute(
        "sigma",
        "object",
        "m, deg",
        "standard deviations by name; t_x, t_y, t_z are those of the position",
    ),
    Attribute(
        "outlines",
        "list",
        "m",
        "polygons that the part roofs, about the origin; left out: its rectangle's share",
    ),
)

PASSAGE = (
    Attribute("outline", "list", "m", "rings of its outline, the outer first, about the origin"),
    Attribute("ceiling", "number", "m", "height of its ceiling in the world"),
)

OVERHANG = (
    Attribute(
        "edge",
        "count",
        "",
        "number of an edge of the outline, counted from 0 along its rings as they are written",
    ),
    Attribute("length", "number", "m", "distance in plan from the roof's edge to the wall"),
    Attribute("sigma", "number", "m", "its standard deviation; null where it was assumed"),
)

INSTALLATION = (
    Attribute("type", "text", "", "chimney or roof_object"),
    Attribute("parameters", "object", "m", "length, width and height of its box"),
    Attribute("position", "list", "m", "x, y, z of the middle of its base, about the origin"),
    Attribute("rotation", "number", "deg", "from the x axis to its length, counter-clockwise"),
)

SIZES = {
    "width": ("m", "of the rectangle, across the ridge"),
    "length": ("m", "of the rectangle, along the ridge"),
    "height": ("m", "of the ridge or the level top over the lowest eave; of a saw-tooth's tooth"),
    "ridge_length": ("m", "of a hip or half-hip"),
    "hip_height": ("m", "of a half-hip's end, from its eave to the ridge"),
    "end_height": (
        "m",
        "of a corner, to which its end would rise at the other; its height is that of the front at "
        "the back",
    ),
    "top_width": ("m", "of a level top between slopes"),
    "top_length": ("m", "of a level top between slopes"),
    "teeth": ("", "of a saw-tooth"),
    "ridge_offset": ("m", "of a gable's ridge from the middle, to the back"),
    "eave_step": ("m", "of an asymmetric gable: the back eave over the front eave"),
    "break_width": ("m", "of a gambrel, between the lines where its slopes break"),
    "break_height": ("m", "of these lines over the eave"),
    "neck_height": ("m", "of an onion: the end of its bulge over the eave"),
}
OF_SIDES = {
    "pitch": ("deg", "slope of the plane from this side"),
    "eave": ("m", "height of this side's eave over the lowest"),
    "skew": ("deg", "how far this side's plane faces off its axis"),
}
SHAPE = {
    **SIZES,
    **{
        name: ("m", f"of a {kind}")
        for kind, shape in CATALOGUE.items()
        for name in shape.parameters
        if name not in SIZES
    },
    **{
        f"{what}_{side}": told
        for side in ("front", "back", "left", "right")
        for what, told in OF_SIDES.items()
    },
}
"""Every parameter of a part by name, but for those of cants: unit and meaning."""

ANGLES = tuple(f"{what}_" for what in ("pitch", "skew", "facing"))
"""Beginnings of the names of parameters in degrees; all others but a number of teeth
are in metres.
"""

PARTS_LAYER = (
    Attribute("building_id", "text", "", "id of the building"),
    Attribute("part", "count", "", "number of the part within its building, from 0"),
    Attribute("type", "text", "", "roof type of the part"),
    Attribute("area_m2", "number", "m2", "in plan, where it shows"),
    Attribute("x", "number", "m", "of its rectangle's centre in the world"),
    Attribute("y", "number", "m", "of its rectangle's centre in the world"),
    Attribute(
        "z_eave",
        "number",
        "m",
        "height of its lowest eave in the world; of its ridge or top: z_eave + height",
    ),
    Attribute("rotation", "number", "deg", "from the x axis to its length, counter-clockwise"),
    *(Attribute(name, "number", unit, meaning) for name, (unit, meaning) in SHAPE.items()),
    Attribute(
        "cants",
        "text",
        "deg, m, m, deg",
        "planes over walls that cut a corner off, as JSON: a list of facing, distance, eave, pitch "
        "for each",
    ),
    *(
        Attribute(f"{name}_sigma", "number", unit, f"standard deviation of {name}")
        for name, unit in {
            "z_eave": "m",
            "rotation": "deg",
            **{name: unit for name, (unit, _) in SHAPE.items()},
        }.items()
        if name != "teeth"
    ),
)

SURFACES_LAYER = (
    Attribute("building_id", "text", "", "id of the building"),
    Attribute(
        "number",
        "count",
        "",
        "number of the surface within its building, from 0; the facets of a curved surface, a row "
        "each, have one number",
    ),
    Attribute("part", "count", "", "number of its roof part, as in the layer parts"),
    Attribute("type", "text", "", "roof type of that part"),
    Attribute("slope_deg", "number", "deg", "slope of the face"),
    Attribute(
        "azimuth_deg", "number", "deg", "compass direction in which it falls, null where level"
    ),
    Attribute("area_m2", "number", "m2", "true area of the face"),
)

HISTORY_LAYER = (
    *ENDED_MODEL[:6],
    Attribute("successor", "text", "", "id of the building that takes its place in the run"),
    Attribute("parts", "count", "", "number of its parts"),
)

HEAD = (
    Attribute("hiproof_parameters", "count", "", "version of the file"),
    Attribute("crs", "text", "", "CRS of the files built, as EPSG code or WKT"),
    Attribute("unit", "text", "", "unit of their coordinates where there is no CRS, as read.unit"),
    Attribute("cityjson_offset", "list", "of the CRS", "offset of the CityJSON file"),
    Attribute("compose", "object", "", "the settings [compose]"),
    Attribute("write", "object", "", "the settings [write]"),
    Attribute("update", "object", "", "only in an update: its survey and roofs, as below"),
)

UPDATE_HEAD = (
    Attribute("survey", "text", "", "date of the new survey, as 2014-02-09"),
    Attribute("roofs_outside", "list", "", "roofs outside all outlines, as below"),
)

ROOF_OUTSIDE = (
    Attribute("id", "text", "", "id of the building that the roof extends, null for none"),
    Attribute("kind", "text", "", "built, extended, demolished or unmapped"),
    Attribute("area", "number", "m2", "area in plan"),
    Attribute("outlines", "list", "m", "polygons in the world"),
)

EVALUATION = (
    Attribute("id", "text", "", "the building's id"),
    Attribute("type", "text", "", "its roof type"),
    Attribute("status", "text", "", "as hiproof_status"),
    Attribute("quality", "text", "", "as hiproof_quality"),
    Attribute("points", "count", "", "points of the clouds given inside the outline"),
    Attribute("density", "number", "1/m2", "points by area of the outline"),
    Attribute(
        "psd_mean",
        "number",
        "m",
        "mean distance of the points from the roof, facade points included",
    ),
    Attribute("psd_std", "number", "m", "standard deviation of those distances"),
    Attribute("rmse", "number", "m", "root mean square of those distances"),
    Attribute("p95", "number", "m", "distance that 95 of 100 points stay below"),
    Attribute(
        "share_within_20cm",
        "number",
        "",
        "as hiproof_share_within_20cm, of the points given; 0 without a model",
    ),
    Attribute(
        "outline_iou",
        "number",
        "",
        "intersection over union of the roof's outline with the footprint",
    ),
    Attribute("nodata_share", "number", "", "as rf_nodata_frac"),
    Attribute("unexplained_area_m2", "number", "m2", "as hiproof_unexplained_area_m2"),
    Attribute("volume_m3", "number", "m3", "volume of the solid"),
    Attribute("ref_id", "text", "", "with --reference: the building of the other model"),
    Attribute("ref_ridge_height_m", "number", "m", "ridge height minus the other's"),
    Attribute("ref_slope_deg", "number", "deg", "slope minus the other's"),
    Attribute("ref_azimuth_deg", "number", "deg", "smaller angle between the azimuths"),
    Attribute("ref_volume_m3", "number", "m3", "volume minus the other's"),
    Attribute("ref_volume_relative", "number", "", "that difference by the other's volume"),
    Attribute("ref_plan_iou", "number", "", "intersection over union of the outlines in plan"),
)

POSTGIS = (
    Attribute("run", "text", "", "the run's name, in all three tables"),
    Attribute(
        "geom",
        "geometry",
        "of the CRS",
        "the solid as a polyhedral surface of triangles; of a part where it shows, of a roof "
        "surface the face",
    ),
)

EVERY_FORMAT = (
    "`buildings.gml`, `buildings.city.jsonl`, the layer `buildings` of `buildings.gpkg`, "
    "`buildings.parquet`, `buildings.fgb`, PostGIS: PREFIX_buildings"
)
ENRICHED_FILES = "all files of the folder `enriched`"
TABLES = (
    AttributeTable("Buildings, under roofer's names", EVERY_FORMAT, ROOFER, PREFIX),
    AttributeTable("Buildings, our own", EVERY_FORMAT, HIPROOF, OWN),
    AttributeTable("Buildings, as OpenStreetMap tags them (`--osm-tags`)", EVERY_FORMAT, OSM),
    AttributeTable("Buildings, added by `hiproof enrich`", ENRICHED_FILES, ENRICHED, OWN),
    AttributeTable(
        "Buildings, added by `hiproof enrich` under 3DBAG's names", ENRICHED_FILES, ENRICHED_3DBAG
    ),
    AttributeTable(
        "Surfaces, added by `hiproof enrich`",
        "`buildings.gml` and `buildings.city.jsonl` of the folder `enriched`",
        ENRICHED_SURFACE,
    ),
    AttributeTable("Buildings, added by `hiproof enrich --sun`", ENRICHED_FILES, ENRICHED_SUN, OWN),
    AttributeTable(
        "Surfaces, added by `hiproof enrich --sun`",
        f"{ENRICHED_FILES}; walls, only with `--sun-on-walls`, in `buildings.gml` and "
        "`buildings.city.jsonl` alone",
        ENRICHED_SUN_SURFACE,
        OWN,
    ),
    AttributeTable(
        "Building parts (`--parts-as buildingparts`)",
        "`buildings.gml`, `buildings.city.jsonl`",
        BUILDING_PART,
    ),
    AttributeTable("Roof surfaces", "`buildings.city.jsonl`", ROOF_SURFACE),
    AttributeTable(
        "Parameters: the first line",
        "`parameters.jsonl`; its schema: `hiproof build --schema`",
        HEAD,
    ),
    AttributeTable(
        "Parameters: an update", "`update` of the first line of `parameters.jsonl`", UPDATE_HEAD
    ),
    AttributeTable(
        "Parameters: a roof outside all outlines",
        "`roofs_outside` of an update in `parameters.jsonl`",
        ROOF_OUTSIDE,
    ),
    AttributeTable("Parameters: a line a building", "`parameters.jsonl`", PARAMETERS),
    AttributeTable("Parameters: a part", "`parts` of a building in `parameters.jsonl`", PART),
    AttributeTable(
        "Parameters: an installation",
        "`installations` of a building in `parameters.jsonl`",
        INSTALLATION,
    ),
    AttributeTable(
        "Parameters: a passage", "`passages` of a building in `parameters.jsonl`", PASSAGE
    ),
    AttributeTable(
        "Parameters: an overhang", "`overhangs` of a building in `parameters.jsonl`", OVERHANG
    ),
    AttributeTable("Parameters: a change", "`change` of a building in `parameters.jsonl`", CHANGE),
    AttributeTable(
        "Parameters: a place that changed",
        "`places` of a change in `parameters.jsonl`",
        CHANGE_PLACE,
    ),
    AttributeTable(
        "Parameters: a model that ended",
        "`history` of a change in `parameters.jsonl`",
        ENDED_MODEL,
    ),
    AttributeTable(
        "Models that ended",
        "the layer `history` of `buildings.gpkg`, PostGIS: PREFIX_history; only after `hiproof "
        "update --history`",
        HISTORY_LAYER,
    ),
    AttributeTable(
        "Parts",
        "the layer `parts` of `buildings.gpkg`, `parts.parquet`, PostGIS: PREFIX_parts; where each "
        "shows, in plan",
        PARTS_LAYER,
    ),
    AttributeTable(
        "Roof surfaces as polygons",
        "the layer `roof_surfaces` of `buildings.gpkg`, `roof_surfaces.parquet`, PostGIS: "
        "PREFIX_roofs",
        SURFACES_LAYER,
    ),
    AttributeTable("Evaluation", "`evaluation.csv`, `evaluation.json`", EVALUATION),
    AttributeTable("PostGIS, beside the columns of all tables", "`hiproof load`", POSTGIS),
)

PREFACE = """# Attributes

What stands in the files of a run, beside the attributes of the input, which are kept under
their own names. Lengths are metres also where coordinates are not. Made by `hiproof attributes`.
"""


def attributes_text() -> str:
    """Return all tables as Markdown.

    `hiproof attributes` prints them, and docs/attributes.md holds them.
    """
    return "\n".join([PREFACE, files_text(), *map(table_text, TABLES)])


def files_text() -> str:
    """Return every kind of file as Markdown."""
    rows = [
        f"| `{format.file}` | {format.what} | `hiproof "
        f"{'reconstruct' if format.fragment else f'convert --format {name}'}` |"
        for name, format in FORMATS.items()
    ]
    return "\n".join(
        ["## Files", "", "| file | what | written by |", "| --- | --- | --- |", *rows, ""]
    )


def table_text(table: AttributeTable) -> str:
    rows = [
        f"| `{table.prefix}{name}` | {kind} | {unit} | {meaning} |"
        for name, kind, unit, meaning in table.attributes
    ]
    head = ["| name | kind | unit | meaning |", "| --- | --- | --- | --- |"]
    return "\n".join([f"## {table.title}", "", f"In {table.where}.", "", *head, *rows, ""])
