"""Every setting once: its type and default here, unit, bounds and help in data/settings.toml.

Command line, TOML file and error texts derive from both.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from numbers import Integral
from pathlib import Path
from typing import Any

from .data_files import read_data_file
from .errors import SettingsError

Changes = dict[str, dict[str, Any]]  # of settings, by section and name
LARGEST_INTEGER = 10**15  # no number of a setting without bounds is larger


SETTING_ROWS = read_data_file("settings")
# What stands for the entries that a setting does not have in data/settings.toml.
UNDECLARED = {
    **dict.fromkeys(("unit", "option", "names"), ""),
    **dict.fromkeys(("low", "high")),
    "choices": (),
    "fewest": 0,
}


class Section:
    """A section of settings, each of which is a field with its row of data/settings.toml."""

    def __init_subclass__(cls) -> None:
        for name, row in SETTING_ROWS[cls.__name__.removesuffix("Settings").lower()].items():
            setattr(cls, name, field(default=getattr(cls, name), metadata=UNDECLARED | row))


@dataclass(frozen=True)
class ReadSettings(Section):
    """[read] which points count, units, surveys, passages, heights without points."""

    building_classes: tuple[int, ...] = (6,)
    ground_classes: tuple[int, ...] = (2,)
    roofs: str = "auto"
    crs: str = ""
    unit: str = "auto"
    overture_catalogue: str = "https://stac.overturemaps.org/catalog.json"
    override_columns: tuple[str, ...] = ()
    fallback_roof_height: str = ""
    fallback_ground_height: str = ""
    clearance_column: str = "clearance"
    raised_column: str = ""
    shift: str = "auto"
    largest_shift_m: float = 1.0
    year_column: str = ""
    split_gap_m: float = 0.0
    split_houses: bool = True
    split_min_points: int = 30

    @property
    def by_class(self) -> bool:
        """Whether roofs are points of building classes: of whole clouds, or "auto" with such."""
        return self.roofs in ("auto", "class")


@dataclass(frozen=True)
class FitSettings(Section):
    """[fit] roof types to choose among, and how they are fitted."""

    types: tuple[str, ...] = ()
    objective: str = "likelihood"
    side_softness_m: tuple[float, ...] = (0.1, 0.04, 0.015, 0.006)
    parts: str = "compound"


@dataclass(frozen=True)
class CompoundSettings(Section):
    """[compound] how much detail roofs of several parts have."""

    detail: str = "full"
    tolerance_m: float = 0.25
    evidence_points: float = 1.0
    evidence_area_m2: float = 0.25


@dataclass(frozen=True)
class SegmentSettings(Section):
    """[segment] recognising roof types with the network."""

    network: str = "auto"
    weights: str = ""
    device: str = "cpu"


@dataclass(frozen=True)
class ComposeSettings(Section):
    """[compose] from fitted roof to solid."""

    snap_m: float = 0.001
    min_face_area_m2: float = 0.01
    min_face_width_m: float = 0.25
    ground_clearance_m: float = 0.1
    chord_tolerance_m: float = 0.1
    planarity_m: float = 0.001


@dataclass(frozen=True)
class ReconstructSettings(Section):
    """[reconstruct] moved footprints, walls, overhangs, chimneys, bare ground."""

    align: str = "auto"
    footprint_trust: str = "points"
    empty_footprints: str = "skip"
    walls: str = "level"
    installations: bool = False
    footprint_kind: str = "walls"
    assumed_overhang_m: float = 0.0
    roof_thickness_m: float = 0.2


@dataclass(frozen=True)
class CitySettings(Section):
    """[city] many buildings, their files and failures."""

    max_points_a_building: int = 20000
    models: str = "merged"
    keep_failures: bool = True


@dataclass(frozen=True)
class WriteSettings(Section):
    """[write] LoDs, building parts, CityGML versions, tables, CRS, OpenStreetMap tags."""

    lods: tuple[str, ...] = ("2.2",)
    parts_as: str = "one"
    roof_codes: str = "sig3d"
    citygml: str = "2.0"
    osm_tags: bool = False
    parquet: bool = False
    out_crs: str = ""
    terrain_intersection: bool = True
    gml_surfaces: bool = True

    @property
    def has_lod2(self) -> bool:
        """Whether roofs are written, with or without overhangs."""
        return "2.2" in self.lods or "2.3" in self.lods


@dataclass(frozen=True)
class EnrichSettings(Section):
    """[enrich] party walls, sun, weather and thermal zones of finished models."""

    touch_m: float = 0.3
    use_attribute: str = ""
    sun: bool = False
    weather: str = ""
    horizon: str = ""
    shading_terrain: str = ""
    sun_on_walls: bool = False
    energy_ade: bool = False
    albedo: float = 0.2


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
    def from_dict(cls, values: Changes) -> Settings:
        """Return settings with sections replaced; SettingsError for unknown or bad values."""
        return cls().replace(values)

    @classmethod
    def from_toml(cls, path: str | Path) -> Settings:
        """Read settings of TOML, a table a section; SettingsError when it cannot be read."""
        try:
            values = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
        # undecodable, no TOML, or a number of 5,000 digits
        except (OSError, ValueError, RecursionError) as error:
            raise SettingsError(
                f"expected a TOML settings file at {path}, got: {error}; `hiproof settings` prints "
                "one"
            ) from error
        return cls.from_dict(values)

    def replace(self, values: Changes) -> Settings:
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

    def to_dict(self) -> Changes:
        """Return a plain nested dictionary, ready for JSON."""
        return dataclasses.asdict(self, dict_factory=make_plain)

    def to_toml(self) -> str:
        """Return TOML of every setting, with its unit, bounds and meaning as comments."""
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
    """Convert `value` to the setting's type; SettingsError in a sentence if it does not fit."""
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


# A value of an element's type, by the declared type of a setting of several values.
SETTING_KINDS: dict[Any, object] = {
    "tuple[int, ...]": 0,
    "tuple[float, ...]": 0.0,
    "tuple[str, ...]": "",
}


def check_item(name: str, template: Any, declared: Any, value: Any) -> Any:
    """Convert a value to `template`'s type within its declared bounds and choices."""
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
    """Format a value for a message, huge numbers and long texts cut short."""
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


def make_plain(items: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    return {name: list(value) if isinstance(value, tuple) else value for name, value in items}
