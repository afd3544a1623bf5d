"""Every attribute and table of hiproof's formats and documents, by data/attributes.toml."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from ..data_files import Values, read_data_file
from ..formats import FORMATS
from ..primitives.catalogue import CATALOGUE
from ..primitives.contract import SIDES


class Attribute(NamedTuple):
    """A named value of a `kind`, `unit` and meaning; `type` says more in parameters.jsonl."""

    name: str
    kind: str
    unit: str
    meaning: str
    type: str


class AttributeTable(NamedTuple):
    """Attributes that stand together; `prefix` precedes their names in files."""

    title: str
    where: str
    attributes: tuple[Attribute, ...]
    prefix: str = ""
    required: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the attributes, without prefix."""
        return tuple(attribute.name for attribute in self.attributes)


DECLARED = read_data_file("attributes")
SIZES, KINDS_OF_TYPES = DECLARED["sizes"], DECLARED["kinds"]
# Every parameter of a part by name, but for those of cants: unit and meaning.
SHAPE: dict[str, tuple[str, str]] = {
    **SIZES,
    **{
        name: ("m", f"of a {kind}")
        for kind, shape in CATALOGUE.items()
        for name in shape.parameters
        if name not in SIZES
    },
    **{
        f"{name}_{side}": of_side
        for side in SIDES[2:] + SIDES[:2]
        for name, of_side in DECLARED["of_sides"].items()
    },
}

# Beginnings of the names of parameters in degrees; all others but a number of teeth are in metres.
ANGLES = tuple(f"{what}_" for what in ("pitch", "skew", "facing"))


def describe_type(type: str) -> str:
    """Return the kind of a type, as lists of attributes name it.

    >>> [describe_type(type) for type in ("text?", "number?[]", "polygon?", "part", "status")]
    ['text', 'list', 'list', 'object', 'text']
    """
    if type.endswith("[]"):
        return "list"
    name = type.removesuffix("?")
    return "object" if name in DECLARED["tables"] else KINDS_OF_TYPES.get(name, name)


def make_attribute(name: str, type: str, unit: str, meaning: str) -> Attribute:
    return Attribute(name, describe_type(type), unit, meaning, type)


def read_table(row: Values, earlier: Mapping[str, AttributeTable]) -> AttributeTable:
    """Read a declared table, which may include attributes of `earlier` ones."""
    included = [
        attribute._replace(name=earlier[name].prefix + attribute.name)
        for name, names in row.get("include", {}).items()
        for attribute in earlier[name].attributes
        if attribute.name in names
    ]
    declared = [make_attribute(name, *values) for name, values in row["attributes"].items()]
    return AttributeTable(
        row["title"],
        row["where"],
        (*included, *declared),
        row.get("prefix", ""),
        tuple(row.get("required", ())),
    )


def add_shape(table: AttributeTable) -> AttributeTable:
    """Return the table of parts with a column for every parameter, and its deviation."""
    *columns, cants = table.attributes
    shape = [make_attribute(name, "number", *values) for name, values in SHAPE.items()]
    units = {"z_eave": "m", "rotation": "deg"} | {a.name: a.unit for a in shape}
    sigma = [
        make_attribute(f"{name}_sigma", "number", unit, f"standard deviation of {name}")
        for name, unit in units.items()
        if name != "teeth"
    ]
    return table._replace(attributes=(*columns, *shape, cants, *sigma))


TABLES: dict[str, AttributeTable] = {}
for name, row in DECLARED["tables"].items():
    TABLES[name] = read_table(row, TABLES)
TABLES["parts"] = add_shape(TABLES["parts"])
# Attributes that building parts have of their own.
OF_PARTS: list[str] = DECLARED["tables"]["building_part"]["include"]["roofer"]
PREFIX, OWN = TABLES["roofer"].prefix, TABLES["hiproof"].prefix

PREFACE = """# Attributes

What stands in the files of a run, beside the attributes of the input, which are kept under
their own names. Lengths are metres also where coordinates are not. Made by `hiproof attributes`.
"""


def attributes_text() -> str:
    """Return all tables as Markdown, as `hiproof attributes` and docs/attributes.md have."""
    return "\n".join([PREFACE, files_text(), *map(table_text, TABLES.values())])


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
        f"| `{table.prefix}{a.name}` | {a.kind} | {a.unit} | {a.meaning} |"
        for a in table.attributes
    ]
    head = ["| name | kind | unit | meaning |", "| --- | --- | --- | --- |"]
    return "\n".join([f"## {table.title}", "", f"In {table.where}.", "", *head, *rows, ""])
