"""The JSON schema (draft 2020-12) of parameters.jsonl: a `head`, then lines of a `building`."""

from __future__ import annotations

import json

from ..data_files import Values
from ..primitives.cants import MEASURES, MOST_CANTS
from ..primitives.catalogue import CATALOGUE
from ..write.attribute_list import DECLARED, TABLES
from .record import CHOICES

RECORDS = (
    *("head", "update", "roof_outside", "building", "part", "passage", "installation"),
    *("overhang", "change", "ended_model", "change_place"),
)
TYPE_SCHEMAS: dict[str, Values] = DECLARED["schemas"]


def schema() -> Values:
    """Return the schema of a line.

    >>> schema()["$defs"]["head"]["properties"]["hiproof_parameters"]["const"]
    1
    """
    defs = {name: describe_record(name) for name in RECORDS}
    defs["part"]["allOf"] = parameters_by_type()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "a line of parameters.jsonl",
        "if": {"required": ["hiproof_parameters"]},
        "then": {"$ref": "#/$defs/head"},
        "else": {"$ref": "#/$defs/building"},
        "$defs": defs,
    }


def describe_record(name: str) -> Values:
    """Return the schema of an object; only a head may have further keys."""
    table = TABLES[name]
    properties = {}
    for attribute in table.attributes:
        unit = f" [{attribute.unit}]" if attribute.unit else ""
        meaning = {"description": attribute.meaning + unit}
        properties[attribute.name] = meaning | describe_type(attribute.type)
    return {
        "type": "object",
        "properties": properties,
        "required": list(table.required),
        **({} if name == "head" else {"additionalProperties": False}),
    }


def describe_type(type: str) -> Values:
    """Return the schema of a type, as data/attributes.toml names it.

    >>> describe_type("text?"), describe_type("passage[]")["items"]
    ({'type': ['string', 'null']}, {'$ref': '#/$defs/passage'})
    """
    if type.endswith("[]"):
        return {"type": "array", "items": describe_type(type[:-2])}
    if type.endswith("?"):
        described = describe_type(type[:-1])
        if "enum" in described:
            return {"enum": [*described["enum"], None]}
        if described.keys() == {"type"}:
            return {"type": [described["type"], "null"]}
        return {"anyOf": [described, {"type": "null"}]}
    if type in CHOICES:
        return {"enum": list(CHOICES[type][1])}
    return {"$ref": f"#/$defs/{type}"} if type in RECORDS else TYPE_SCHEMAS[type]


def parameters_by_type() -> list[Values]:
    """Return what parameters of each type must hold, unless each side has its own."""
    sides = "(pitch|eave|skew)_(left|right|front|back)"
    cants = f"({'|'.join(MEASURES)})_cant[1-{MOST_CANTS}]"
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
