"""Every setting once: default, unit, bounds, help.

Command line, TOML file and error texts derive from here.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field, fields
from numbers import Integral
from pathlib import Path
from typing import Any

from .errors import SettingsError

LARGEST_INTEGER = 10**15  # no number of a setting without bounds is larger


def setting(
    default: Any,
    help: str,
    unit: str = "",
    lower: float | None = None,
    upper: float | None = None,
    choices: tuple[Any, ...] = (),
    minimum: int = 0,
    option: str = "",
    names: str = "",
) -> Any:
    """Declare one setting of a section.

    `lower` and `upper` are inclusive bounds, `choices` the allowed values.

    Of a setting of several values they hold for each, and there are at least `minimum`. With an
    `option` (such as "--roofs") the command line has it, its help and default made of this. One
    that `names` "files" is another where other bytes stand in them.
    """
    metadata = {
        "help": help,
        "unit": unit,
        "low": lower,
        "high": upper,
        "choices": choices,
        "fewest": minimum,
    }
    return field(default=default, metadata=metadata | {"option": option, "names": names})


@dataclass(frozen=True)
class ReadSettings:
    """[read] which points count, units, surveys, passages, heights without points."""

    building_classes: tuple[int, ...] = setting(
        (6,),
        "LAS classes of roof points (ASPRS 6; IGN uses 67)",
        "",
        0,
        255,
        minimum=1,
        option="--building-class",
    )
    ground_classes: tuple[int, ...] = setting(
        (2,), "LAS classes of terrain points", "", 0, 255, option="--ground-class"
    )
    roofs: str = setting(
        "auto",
        "how roof points are found: class takes the building classes; shape looks for roofs among "
        "all points that may be roofs; alone takes all of these but leaves, for clouds cut to "
        "their roofs; auto takes class, or shape where no point has a building class, or alone "
        "where nothing looks like ground",
        choices=("auto", "class", "shape", "alone"),
        option="--roofs",
    )
    crs: str = setting(
        "",
        'CRS of the clouds, such as "EPSG:7415"; empty takes that of their files',
        option="--crs",
    )
    unit: str = setting(
        "auto",
        "unit of the clouds' coordinates; auto takes that of their CRS, or metres without a CRS",
        choices=("auto", "metre", "foot", "us-survey-foot"),
        option="--unit",
    )
    overture_catalogue: str = setting(
        "https://stac.overturemaps.org/catalog.json",
        "address of Overture Maps' STAC catalogue, whose latest release `--footprints overture` "
        "reads, or of the catalogue of one release",
    )
    override_columns: tuple[str, ...] = setting(
        (),
        'columns of the footprints that overrule the fit, as COLUMN=KEY such as "daktype=type" '
        "(docs/overrides.md)",
    )
    fallback_roof_height: str = setting(
        "",
        "column of the footprints with roof heights (m) for buildings without usable points; "
        "+COLUMN means above the ground",
        option="--fallback-roof-height",
    )
    fallback_ground_height: str = setting(
        "",
        "column of the footprints with ground heights (m) for these where no terrain is known",
        option="--fallback-ground-height",
    )
    clearance_column: str = setting(
        "clearance",
        "column of --underpasses that holds the height of the passage over the ground, in metres",
        option="--clearance-column",
    )
    raised_column: str = setting(
        "",
        "column of the footprints that holds how high a building stands over the ground, in "
        "metres, such as one on columns or over a road; empty for none",
        option="--raised-column",
    )
    shift: str = setting(
        "auto",
        "how far a new survey lies beside the earlier one, or of surveys (--epoch) each older one "
        "beside the newest: auto estimates it, off takes none off, EAST,NORTH,UP gives it in "
        "metres",
        option="--shift",
    )
    largest_shift_m: float = setting(
        1.0, "longest shift between surveys that is estimated and taken off", "m", 0.0, 100.0
    )
    year_column: str = setting(
        "",
        "column of the footprints that holds the year of construction; of surveys (--epoch), those "
        "before that year are not taken",
        option="--year-column",
    )
    split_gap_m: float = setting(
        0.0,
        "without footprints: clear space that separates buildings; 0 adapts it to the density",
        "m",
        0.0,
        20.0,
    )
    split_houses: bool = setting(
        True,
        "without footprints: split touching houses where a step or another ridge or eave runs "
        "across the block",
    )
    split_min_points: int = setting(
        30, "without footprints: groups of fewer points are not buildings", "", 3, 100000
    )

    @property
    def by_class(self) -> bool:
        """Whether roofs are the points of the building classes.

        They are those of whole clouds or, with "auto", of clouds that have such classes.
        """
        return self.roofs in ("auto", "class")


@dataclass(frozen=True)
class FitSettings:
    """[fit] roof types to choose among, and how they are fitted."""

    types: tuple[str, ...] = setting(
        (), "roof types to choose among; empty means the whole catalogue", option="--types"
    )
    objective: str = setting(
        "likelihood",
        "objective that the fit minimises",
        choices=("likelihood", "paper"),
        option="--objective",
    )
    side_softness_m: tuple[float, ...] = setting(
        (0.1, 0.04, 0.015, 0.006),
        "softness of the roof's sides tried at last, the most likely kept",
        "m",
        0.001,
        1.0,
        minimum=1,
    )
    parts: str = setting(
        "compound",
        "primitives of a building: compound fits as many as the points support, one fits a single "
        "one (extra `network`, unless --network never)",
        choices=("compound", "one"),
        option="--parts",
    )


@dataclass(frozen=True)
class CompoundSettings:
    """[compound] how much detail roofs of several parts have."""

    detail: str = setting(
        "full",
        "how much structure a model has: fine keeps small dormers and steps, main leaves out "
        "dormers and small parts, full lies between",
        choices=("fine", "full", "main"),
        option="--detail",
    )
    tolerance_m: float = setting(
        0.25, "height residual at which a point counts as unexplained", "m", 0.05, 1.0
    )
    evidence_points: float = setting(
        1.0, "points that one unit of structure must explain at least", "", 0.1, 100.0
    )
    evidence_area_m2: float = setting(
        0.25, "area of points that one unit of structure must explain", "m2", 0.01, 10.0
    )


@dataclass(frozen=True)
class SegmentSettings:
    """[segment] recognising roof types with the network."""

    network: str = setting(
        "auto",
        "buildings whose roof type the network recognises (extra `network`): auto, those to which "
        "one primitive is fitted; always, all buildings, and the types are written; never, none",
        choices=("auto", "always", "never"),
        option="--network",
    )
    weights: str = setting(
        "", "ONNX file with the network's weights; empty means the shipped ones", names="files"
    )
    device: str = setting("cpu", "where the network runs", choices=("cpu", "cuda"))


@dataclass(frozen=True)
class ComposeSettings:
    """[compose] from fitted roof to solid."""

    snap_m: float = setting(0.001, "plan vertices closer than this are one", "m", 0.001, 0.05)
    min_face_area_m2: float = setting(0.01, "smaller roof faces join a neighbour", "m2", 0.0, 10.0)
    min_face_width_m: float = setting(
        0.25, "thinner roof faces, which nobody draws, join a neighbour", "m", 0.0, 1.0
    )
    ground_clearance_m: float = setting(
        0.1, "the ground lies at least this far below the lowest eave", "m", 0.01, 10.0
    )
    chord_tolerance_m: float = setting(
        0.1,
        "facets of cones, domes, onions and vaults lie within this of the curve",
        "m",
        0.02,
        1.0,
    )
    planarity_m: float = setting(
        0.001, "vertices of a face lie within this of its plane", "m", 0.0005, 0.05
    )


@dataclass(frozen=True)
class ReconstructSettings:
    """[reconstruct] moved footprints, walls, overhangs, chimneys, bare ground."""

    align: str = setting(
        "auto",
        "auto moves footprints that clearly lie beside their roofs; off leaves them in place",
        choices=("auto", "off"),
        option="--align",
    )
    footprint_trust: str = setting(
        "points",
        "bare ground inside a footprint, such as a yard: points cuts it out of the footprint; full "
        "roofs it over and adds a remark",
        choices=("points", "full"),
        option="--footprint-trust",
    )
    empty_footprints: str = setting(
        "skip",
        "footprints whose points all lie on the ground: skip gives them the status no_building and "
        "no model; model fits whatever points they have",
        choices=("skip", "model"),
        option="--empty-footprints",
    )
    walls: str = setting(
        "level",
        "lower end of walls: level ends them at one height, the lowest terrain along the outline; "
        "terrain lets them reach down to the terrain everywhere",
        choices=("level", "terrain"),
        option="--walls",
    )
    installations: bool = setting(
        False,
        "also find chimneys and other objects on roofs, and write them as building installations",
        option="--installations",
    )
    footprint_kind: str = setting(
        "walls",
        "what footprints outline, for --lods 2.3: walls, which roofs reach beyond as far as their "
        "points show; roof, within which walls stand by --assumed-overhang; auto takes roof where "
        "points end at three quarters of a footprint",
        choices=("walls", "roof", "auto"),
        option="--footprint-kind",
    )
    assumed_overhang_m: float = setting(
        0.0,
        "distance of walls from footprints of roofs, for --lods 2.3",
        "m",
        0.0,
        3.0,
        option="--assumed-overhang",
    )
    roof_thickness_m: float = setting(
        0.2,
        "thickness of roofs beyond walls, measured upright, for --lods 2.3",
        "m",
        0.02,
        2.0,
        option="--roof-thickness",
    )


@dataclass(frozen=True)
class CitySettings:
    """[city] many buildings, their files and failures."""

    max_points_a_building: int = setting(
        20000,
        "a building with more points is thinned to so many, evenly and by a fixed rule",
        "",
        1000,
        10**7,
    )
    models: str = setting(
        "merged",
        "merged writes one CityGML and one CityJSONSeq file; tiles writes a pair for each work "
        "tile into models/ as soon as it is solved; both writes both",
        choices=("merged", "tiles", "both"),
        option="--models",
    )
    keep_failures: bool = setting(
        True,
        "keep the points, outline and settings of up to 20 buildings with an internal error in "
        "OUT/failures, to be sent with a report (`hiproof repro` runs them again)",
        option="--keep-failures",
    )


@dataclass(frozen=True)
class WriteSettings:
    """[write] LoDs, building parts, CityGML versions, tables, CRS, OpenStreetMap tags."""

    lods: tuple[str, ...] = setting(
        ("2.2",),
        "levels of detail: 0 is footprint and roof edge, 1.2 one block, 1.3 a block for each "
        "building part, 2.2 the roof, 2.3 the roof with overhangs; CityJSON always has the "
        "footprint, and CityGML has only the finer LoD1 and LoD2",
        choices=("0", "1.2", "1.3", "2.2", "2.3"),
        minimum=1,
        option="--lods",
    )
    parts_as: str = setting(
        "one",
        "one writes one solid for each building; buildingparts makes building parts, each with its "
        "own solid, of roofs that meet only at walls",
        choices=("one", "buildingparts"),
        option="--parts-as",
    )
    roof_codes: str = setting(
        "sig3d",
        "code list of roofType in CityGML: that of SIG3D or of AdV",
        choices=("sig3d", "adv"),
        option="--roof-codes",
    )
    citygml: str = setting(
        "2.0", "version of CityGML, or both", choices=("2.0", "3.0", "both"), option="--citygml"
    )
    osm_tags: bool = setting(
        False,
        "also write OpenStreetMap's Simple 3D tags as attributes: roof:shape, roof:height, "
        "roof:direction, roof:angle, height; they replace attributes of the input with these names",
        option="--osm-tags",
    )
    parquet: bool = setting(
        False, "also write the tables as GeoParquet (extra `parquet`)", option="--parquet"
    )
    out_crs: str = setting(
        "",
        'CRS of the coordinates in all files but parameters.jsonl, such as "EPSG:25832"; empty '
        "takes that of the clouds; heights change only if it has a vertical CRS",
        option="--out-crs",
    )
    terrain_intersection: bool = setting(
        True,
        "write the line along which walls meet the terrain into CityGML",
        option="--terrain-intersection",
    )
    gml_surfaces: bool = setting(
        True,
        "also write the surfaces of each solid into CityGML by value, as the last geometry, for "
        "GDAL and QGIS, which follow no links",
        option="--gml-surfaces",
    )

    @property
    def has_lod2(self) -> bool:
        """Whether roofs are written, with or without overhangs."""
        return "2.2" in self.lods or "2.3" in self.lods


@dataclass(frozen=True)
class EnrichSettings:
    """[enrich] party walls, sun, weather and thermal zones of finished models."""

    touch_m: float = setting(
        0.3,
        "distance in metres up to which walls of neighbours touch",
        "m",
        0.0,
        2.0,
        option="--touch",
    )
    use_attribute: str = setting(
        "",
        "attribute of the footprints that names the use of a building, such as residential or "
        "office; empty takes all buildings as residential",
        option="--use-attribute",
    )
    sun: bool = setting(False, "add the sun on every roof surface (extra `sun`)", option="--sun")
    weather: str = setting(
        "",
        "weather of a typical year (EPW, TMY3 or PVGIS), for --sun; empty takes a clear sky",
        option="--weather",
        names="files",
    )
    horizon: str = setting(
        "",
        "horizon file of PVGIS, which shades all buildings, for --sun: heights in degrees at equal "
        "angles, clockwise from the north",
        option="--horizon",
        names="files",
    )
    shading_terrain: str = setting(
        "",
        "terrain model (GeoTIFF; extra `terrain`), which shades up to 20 km away, for --sun; "
        "`hiproof reconstruct --enrich --sun` takes that of the run",
        names="files",
    )
    sun_on_walls: bool = setting(
        False, "also add the sun on every outer wall, for --sun", option="--sun-on-walls"
    )
    energy_ade: bool = setting(
        False,
        "also write thermal zones and their boundaries into CityGML 2.0, as the Energy ADE 1.0 has "
        "them",
        option="--energy-ade",
    )
    albedo: float = setting(
        0.2, "share of light that the ground reflects, for --sun", "", 0.0, 1.0, option="--albedo"
    )


@dataclass(frozen=True)
class Settings:
    """All settings by section; immutable, comparable, and written beside every run.

    >>> Settings().fit.objective
    'likelihood'
    >>> Settings.from_dict({"read": {"building_classes": [67]}}).read.building_classes
    (67,)
    """

    read: ReadSettings = field(default_factory=ReadSettings)
    segment: SegmentSettings = field(default_factory=SegmentSettings)
    fit: FitSettings = field(default_factory=FitSettings)
    compound: CompoundSettings = field(default_factory=CompoundSettings)
    compose: ComposeSettings = field(default_factory=ComposeSettings)
    reconstruct: ReconstructSettings = field(default_factory=ReconstructSettings)
    city: CitySettings = field(default_factory=CitySettings)
    write: WriteSettings = field(default_factory=WriteSettings)
    enrich: EnrichSettings = field(default_factory=EnrichSettings)

    @classmethod
    def from_dict(cls, values: dict[str, dict[str, Any]]) -> Settings:
        """Return settings with the given sections replaced.

        Raises SettingsError for unknown names or values out of bounds.
        """
        return cls().replace(values)

    @classmethod
    def from_toml(cls, path: str | Path) -> Settings:
        """Read settings from a TOML file with one table a section.

        Raises SettingsError when it cannot be read.
        """
        import tomllib  # few runs have such a file

        try:
            values = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
        # undecodable, no TOML, or a number of 5,000 digits
        except (OSError, ValueError, RecursionError) as error:
            raise SettingsError(
                f"expected a TOML settings file at {path}, got: {error}; `hiproof settings` prints "
                "one"
            ) from error
        return cls.from_dict(values)

    def replace(self, values: dict[str, dict[str, Any]]) -> Settings:
        """Return a copy with `values[section][name]` replaced, each checked."""
        sections: dict[str, Any] = {}
        for section_name, changes in values.items():
            section: Any = getattr(self, section_name, None)
            names = [f.name for f in fields(self)]
            if section_name not in names or not isinstance(changes, dict):
                got = (
                    f"[{section_name}]"
                    if isinstance(changes, dict)
                    else f"{section_name} = {format_value(changes)}"
                )
                raise SettingsError(
                    f"expected a settings section (one of {', '.join(names)}), got {got}; `hiproof "
                    "settings` lists them"
                )
            by_name = {f.name: f for f in fields(section)}
            for name in changes:
                if name not in by_name:
                    raise SettingsError(
                        f"expected a setting of [{section_name}] ({', '.join(by_name)}), got "
                        f"{name!r}"
                    )
            checked = {
                name: check_value(f"{section_name}.{name}", by_name[name], value)
                for name, value in changes.items()
            }
            sections[section_name] = dataclasses.replace(section, **checked)
        return dataclasses.replace(self, **sections)

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return a plain nested dictionary, ready for JSON."""
        return {
            s.name: {
                f.name: plain(getattr(getattr(self, s.name), f.name))
                for f in fields(getattr(self, s.name))
            }
            for s in fields(self)
        }

    def to_toml(self) -> str:
        """Return TOML text with every setting, its unit, bounds and meaning.

        The last three are comments.
        """
        lines = []
        for section_field in fields(self):
            section = getattr(self, section_field.name)
            lines.append(f"[{section_field.name}]")
            for f in fields(section):
                lines.append(f"# {describe(f)}")
                lines.append(f"{f.name} = {toml_value(getattr(section, f.name))}")
            lines.append("")
        return "\n".join(lines)


def check_value(name: str, declared: dataclasses.Field[Any], value: Any) -> Any:
    """Convert `value` to the declared setting's type.

    Raises SettingsError with the full sentence when it does not fit.
    """
    default, metadata = declared.default, declared.metadata
    if not isinstance(default, tuple):
        return check_item(name, default, metadata, value)
    values = tuple(value) if isinstance(value, (list, tuple)) else (value,)
    if len(values) < metadata["fewest"]:
        raise SettingsError(
            f"expected {name} to hold {metadata['fewest']} or more values, got none; "
            f"{metadata['help']}"
        )
    return tuple(check_item(name, SETTING_KINDS[declared.type], metadata, item) for item in values)


SETTING_KINDS: dict[Any, object] = {
    "tuple[int, ...]": 0,
    "tuple[float, ...]": 0.0,
    "tuple[str, ...]": "",
}
"""A value of an element's type, by the declared type of a setting of several values."""


def check_item(name: str, template: Any, declared: Any, value: Any) -> Any:
    """Convert one value to the type of `template`, and check it.

    It has to be within the bounds and among the choices declared.
    """
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if isinstance(template, (bool, str)):
        fits = isinstance(value, type(template))
    elif isinstance(template, int):
        fits = whole
    else:
        fits = whole or isinstance(value, float)
    if not fits:
        kind = {bool: "true or false", str: "text", int: "a whole number", float: "a number"}[
            type(template)
        ]
        raise SettingsError(
            f"expected {name} to be {kind}, got {format_value(value)}; {declared['help']}"
        )
    lower, upper, choices = declared["low"], declared["high"], declared["choices"]
    # so written that NaN is in no bounds; a number without bounds must still be finite
    if isinstance(template, (int, float)) and not isinstance(template, bool):
        lower = -LARGEST_INTEGER if lower is None else lower
        upper = LARGEST_INTEGER if upper is None else upper
        if not lower <= value <= upper:
            bounds = " ".join(f"between {lower} and {upper} {declared['unit']}".split())
            raise SettingsError(
                f"expected {name} {bounds}, got {format_value(value)}; {declared['help']}"
            )
    if choices and value not in choices:
        raise SettingsError(
            f"expected {name} to be one of {', '.join(map(str, choices))}, got "
            f"{format_value(value)}"
        )
    return type(template)(value)


def format_value(value: Any) -> str:
    """Format a value for a message, cut short.

    Whole numbers of thousands of digits and long texts are cut.
    """
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        return f"a number of more than {len(str(LARGEST_INTEGER)) - 1} digits"
    if isinstance(value, (list, tuple, dict)):
        return f"a {type(value).__name__} of {len(value)}"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def describe(declared: dataclasses.Field[Any]) -> str:
    """Return one line: meaning, unit, bounds or choices, default."""
    m = declared.metadata
    parts = [m["help"]]
    if m["low"] is not None or m["high"] is not None:
        parts.append(f"{m['low']} to {m['high']} {m['unit']}".strip())
    elif m["unit"]:
        parts.append(f"in {m['unit']}")
    if m["choices"]:
        parts.append("one of " + ", ".join(map(str, m["choices"])))
    return f"{'; '.join(parts)} (default {toml_value(declared.default)})"


def toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)


def plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
