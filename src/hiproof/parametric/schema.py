"""The JSON schema (draft 2020-12) of parameters.jsonl.

Its first line is a `head`, every other a `building`.
"""

from __future__ import annotations

import json
from typing import Any

from ..model.installation import CHIMNEY, ROOF_OBJECT
from ..model.overhang import ROOF_EDGE, WALLS
from ..primitives.cants import MEASURES, MOST_CANTS
from ..primitives.catalogue import CATALOGUE
from ..read.crs import NAMED_UNITS
from ..status import Change, ChangeKind, Grade, Status
from ..write.attribute_list import (
    CHANGE,
    CHANGE_PLACE,
    ENDED_MODEL,
    HEAD,
    INSTALLATION,
    OVERHANG,
    PARAMETERS,
    PART,
    PASSAGE,
    ROOF_OUTSIDE,
    UPDATE_HEAD,
    Attribute,
)
from ..write.parameters import VERSION
from .installations import BOX_SIZES

NUMBER_SCHEMA, TEXT_SCHEMA = {"type": "number"}, {"type": "string"}
NUMBER_OR_NULL, TEXT_OR_NULL = {"type": ["number", "null"]}, {"type": ["string", "null"]}
NUMBERS = {"type": "object", "additionalProperties": NUMBER_SCHEMA}
SHARES = {"type": "object", "additionalProperties": NUMBER_OR_NULL}
PLACE = {"type": "array", "items": NUMBER_SCHEMA, "minItems": 3, "maxItems": 3}
RING = {
    "type": "array",
    "minItems": 3,
    "items": {"type": "array", "items": NUMBER_SCHEMA, "minItems": 2, "maxItems": 2},
}
POLYGON_SCHEMA = {"type": "array", "items": RING, "minItems": 1}
LENGTH_SCHEMA = {"type": "number", "exclusiveMinimum": 0}

HEAD_KINDS = {
    "hiproof_parameters": {"const": VERSION},
    "crs": TEXT_OR_NULL,
    "unit": {"enum": list(NAMED_UNITS)},
    "cityjson_offset": {"anyOf": [PLACE, {"type": "null"}]},
    "compose": NUMBERS,
    "write": {"type": "object"},
    "update": {"$ref": "#/$defs/update"},
}
UPDATE_KINDS = {
    "survey": TEXT_SCHEMA,
    "roofs_outside": {"type": "array", "items": {"$ref": "#/$defs/roof_outside"}},
}
ROOF_KINDS = {
    "id": TEXT_OR_NULL,
    "kind": {"enum": [kind.code for kind in ChangeKind]},
    "outlines": {"type": "array", "items": POLYGON_SCHEMA},
}
BUILDING_KINDS = {
    "id": TEXT_SCHEMA,
    "status": {"enum": [status.code for status in Status]},
    "quality": {"enum": [*(grade.code for grade in Grade), None]},
    "detail": TEXT_SCHEMA,
    "type": TEXT_OR_NULL,
    "origin": {"anyOf": [PLACE, {"type": "null"}]},
    "parts": {"type": "array", "items": {"$ref": "#/$defs/part"}},
    "outline": {"anyOf": [POLYGON_SCHEMA, {"type": "null"}]},
    "shift": {"type": "array", "items": NUMBER_SCHEMA, "minItems": 2, "maxItems": 2},
    "z_ground": NUMBER_OR_NULL,
    "ground_source": TEXT_OR_NULL,
    "terrain_line": {"type": "array", "items": {"type": "array", "items": PLACE}},
    "passages": {"type": "array", "items": {"$ref": "#/$defs/passage"}},
    "installations": {"type": "array", "items": {"$ref": "#/$defs/installation"}},
    "walls": {"enum": ["level", "terrain"]},
    "overhangs": {"type": "array", "items": {"$ref": "#/$defs/overhang"}},
    "roof_thickness": LENGTH_SCHEMA,
    "footprint_kind": {"enum": [WALLS, ROOF_EDGE]},
    "attributes": {"type": "object"},
    "points": {"type": "integer", "minimum": 0},
    "residuals": SHARES,
    "recognised": SHARES,
    "types": SHARES,
    "survey_date": TEXT_SCHEMA,
    "epochs_used": {"type": "array", "items": TEXT_SCHEMA},
    "change": {"$ref": "#/$defs/change"},
}
CHANGE_KINDS = {
    "class": {"enum": [change.code for change in Change]},
    "survey": TEXT_OR_NULL,
    "chance": NUMBER_OR_NULL,
    "places": {"type": "array", "items": {"$ref": "#/$defs/change_place"}},
    "lineage": {"type": "array", "items": {"type": ["integer", "null"]}},
    "predecessors": {"type": "array", "items": TEXT_SCHEMA},
    "valid_from": TEXT_OR_NULL,
    "valid_to": TEXT_OR_NULL,
    "history": {"type": "array", "items": {"$ref": "#/$defs/ended_model"}},
}
ENDED_KINDS = {
    "id": TEXT_SCHEMA,
    "valid_from": TEXT_OR_NULL,
    "valid_to": TEXT_SCHEMA,
    "type": TEXT_OR_NULL,
    "z_ground": NUMBER_SCHEMA,
    "z_top": NUMBER_SCHEMA,
    "outline": POLYGON_SCHEMA,
    "origin": PLACE,
    "parts": {"type": "array", "items": {"$ref": "#/$defs/part"}},
}
PLACE_KINDS = {
    "kind": {"enum": [kind.code for kind in ChangeKind]},
    "difference": NUMBER_OR_NULL,
    "sigma": NUMBER_OR_NULL,
    "area": NUMBER_OR_NULL,
    "parts": {"type": "array", "items": {"type": ["integer", "null"]}},
    "outlines": {"type": "array", "items": POLYGON_SCHEMA},
}
PART_KINDS = {
    "parameters": {**NUMBERS, "properties": {"width": LENGTH_SCHEMA, "length": LENGTH_SCHEMA}},
    "position": PLACE,
    "rotation": NUMBER_SCHEMA,
    "sigma": NUMBERS,
    "outlines": {"type": "array", "items": POLYGON_SCHEMA},
}
PASSAGE_KINDS = {"outline": POLYGON_SCHEMA, "ceiling": NUMBER_SCHEMA}
OVERHANG_KINDS = {
    "edge": {"type": "integer", "minimum": 0},
    "length": LENGTH_SCHEMA,
    "sigma": NUMBER_OR_NULL,
}
INSTALLATION_KINDS = {
    "type": {"enum": [CHIMNEY, ROOF_OBJECT]},
    "parameters": {
        "type": "object",
        "properties": dict.fromkeys(BOX_SIZES, LENGTH_SCHEMA),
        "required": list(BOX_SIZES),
        "additionalProperties": False,
    },
    "position": PLACE,
    "rotation": NUMBER_SCHEMA,
}


def schema() -> dict[str, Any]:
    """Return the schema of a line.

    >>> schema()["$defs"]["head"]["properties"]["hiproof_parameters"]["const"]
    1
    """
    defs = {
        "head": describe_attributes(HEAD, HEAD_KINDS, required=("hiproof_parameters",)),
        "update": describe_attributes(UPDATE_HEAD, UPDATE_KINDS, required=("survey",)),
        "roof_outside": describe_attributes(
            ROOF_OUTSIDE, ROOF_KINDS, required=("kind", "area", "outlines")
        ),
        "building": describe_attributes(PARAMETERS, BUILDING_KINDS, required=("id",)),
        "part": describe_attributes(
            PART,
            {"type": {"enum": list(CATALOGUE)}, **PART_KINDS},
            required=("type", "parameters", "position"),
        )
        | {"allOf": parameters_by_type()},
        "passage": describe_attributes(PASSAGE, PASSAGE_KINDS, required=("outline", "ceiling")),
        "installation": describe_attributes(
            INSTALLATION, INSTALLATION_KINDS, required=("type", "parameters", "position")
        ),
        "overhang": describe_attributes(OVERHANG, OVERHANG_KINDS, required=("edge", "length")),
        "change": describe_attributes(CHANGE, CHANGE_KINDS, required=("class",)),
        "ended_model": describe_attributes(ENDED_MODEL, ENDED_KINDS, required=("id", "valid_to")),
        "change_place": describe_attributes(CHANGE_PLACE, PLACE_KINDS, required=("kind",)),
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "a line of parameters.jsonl",
        "if": {"required": ["hiproof_parameters"]},
        "then": {"$ref": "#/$defs/head"},
        "else": {"$ref": "#/$defs/building"},
        "$defs": defs,
    }


def describe_attributes(
    attributes: tuple[Attribute, ...], kinds: dict[str, Any], required: tuple[str, ...]
) -> dict[str, Any]:
    """Return the schema of an object with `attributes`.

    Each has its meaning and unit. Those of no other kind are numbers or null.
    """
    properties = {
        a.name: {
            "description": f"{a.meaning} [{a.unit}]" if a.unit else a.meaning,
            **kinds.get(a.name, NUMBER_OR_NULL),
        }
        for a in attributes
    }
    closed = {"additionalProperties": False} if attributes is not HEAD else {}
    return {"type": "object", "properties": properties, "required": list(required), **closed}


def parameters_by_type() -> list[dict[str, Any]]:
    """Return what the parameters of a part of each type must hold.

    A part with each side's own parameters is free of this.
    """
    sides, cants = (
        "(pitch|eave|skew)_(left|right|front|back)",
        f"({'|'.join(MEASURES)})_cant[1-{MOST_CANTS}]",
    )
    side_by_side = {"propertyNames": {"pattern": f"^(width|length|height|{sides}|{cants})$"}}
    rules = []
    for kind, shape in CATALOGUE.items():
        alternatives = [
            {
                "required": [] if kind == "flat" else list(names),
                "propertyNames": {"enum": list(names)},
            }
            for names in dict.fromkeys(variant.parameters for variant in shape.variants)
        ]
        is_kind = {"properties": {"type": {"const": kind}}}
        rules.append(
            {
                "if": is_kind,
                "then": {"properties": {"parameters": {"anyOf": [*alternatives, side_by_side]}}},
            }
        )
    return rules


def schema_text() -> str:
    """Return the schema as the published file holds it."""
    return json.dumps(schema(), indent=1) + "\n"
