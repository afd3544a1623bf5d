"""QGIS styles of a GeoPackage's layers, in the table `layer_styles` that QGIS applies."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from ...data_files import Values
from ...primitives.catalogue import CATALOGUE
from ..attribute_list import OWN
from ..colours import GRADE_COLOURS, ROOF_COLOURS, SUN_STOPS, UNKNOWN_COLOUR, list_legend
from ..values import xml_attribute

TABLE = "layer_styles"
LINE_RGBA = "50,50,50,255"


class Style(NamedTuple):
    """A colour (#rrggbb) for each value of an expression over columns.

    The last colour is that of all other values. `alpha` lets surfaces below show.
    """

    layer: str
    name: str
    expression: str
    colours: dict[str, str]
    alpha: float
    is_default: bool = True


def legend_expression(column: str) -> str:
    """Return the expression that gives the legend entry of the roof type in a column.

    >>> print(legend_expression("type")[:42])
    CASE WHEN "type" IN ('flat') THEN 'flat' W
    """
    kinds: dict[str, list[str]] = {}
    for kind in CATALOGUE:
        kinds.setdefault(list_legend(kind), []).append(f"'{kind}'")
    cases = (f"WHEN \"{column}\" IN ({','.join(of)}) THEN '{to}'" for to, of in kinds.items())
    return f"CASE {' '.join(cases)} END"


def type_style(layer: str, column: str, alpha: float) -> Style:
    return Style(layer, "roof types", legend_expression(column), ROOF_COLOURS, alpha)


STYLES = (
    type_style("buildings", f"{OWN}roof_type", 0.35),
    type_style("parts", "type", 0.5),
    type_style("roof_surfaces", "type", 1.0),
    Style(
        "buildings",
        "quality",
        f"{OWN}quality",
        GRADE_COLOURS | {"unknown": UNKNOWN_COLOUR},
        0.5,
        is_default=False,
    ),
)


SUN_COLUMN = f"{OWN}sun_kwh_m2"


def sun_style(sky: str) -> Style:
    """Return the style of surfaces by the sun, SUN_STOPS, with labels that name the `sky`."""
    names = {f"from {least:g} kWh/m2 ({sky})": least for least, _ in reversed(SUN_STOPS)}
    cases = (f"WHEN \"{SUN_COLUMN}\" >= {least:g} THEN '{name}'" for name, least in names.items())
    colours = dict(zip(names, (colour for _, colour in reversed(SUN_STOPS)), strict=True))
    expression = f"CASE {' '.join(cases)} END"
    return Style("roof_surfaces", "sun", expression, colours | {"unknown": UNKNOWN_COLOUR}, 1.0)


def choose_styles(columns: Mapping[str, Collection[str]], sky: str = "") -> tuple[Style, ...]:
    """Return styles of tables by their columns; roof surfaces with the sun show it."""
    sun = sun_style(sky)
    if SUN_COLUMN not in columns.get(sun.layer, ()):
        return STYLES
    others = (
        style._replace(is_default=False) if style.layer == sun.layer else style for style in STYLES
    )
    return (*others, sun)


def style_rows(styles: Sequence[Style] = STYLES) -> list[Values]:
    """Return the rows of `layer_styles`: by roof type (default) and by quality of models."""
    return [
        {
            "f_table_catalog": "",
            "f_table_schema": "",
            "f_table_name": style.layer,
            "f_geometry_column": "geom",
            "styleName": style.name,
            "styleQML": style_qml(style),
            "styleSLD": "",
            "useAsDefault": style.is_default,
            "description": f"coloured by {style.name.removesuffix('s')}",
            "owner": "hiproof",
            "ui": None,
            "update_time": "2000-01-01T00:00:00.000Z",
        }
        for style in styles
    ]


def style_qml(style: Style) -> str:
    """Return a style in QGIS' own form.

    >>> style_qml(STYLES[1]).count("<category ") == len(ROOF_COLOURS)
    True
    """
    *named, _ = style.colours
    categories = "".join(
        f'<category symbol="{k}" value="{xml_attribute(name) if name in named else ""}" '
        f'label="{xml_attribute(name)}"'
        ' render="true"/>'
        for k, name in enumerate(style.colours)
    )
    symbols = "".join(
        fill_symbol(k, colour, style.alpha) for k, colour in enumerate(style.colours.values())
    )
    return (
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>"
        '<qgis version="3.22.0" styleCategories="Symbology">'
        f'<renderer-v2 type="categorizedSymbol" attr="{xml_attribute(style.expression)}" '
        'symbollevels="0" forceraster="0">'
        f"<categories>{categories}</categories><symbols>{symbols}</symbols></renderer-v2></qgis>"
    )


def fill_symbol(number: int, colour: str, alpha: float) -> str:
    """Return a plain fill of `colour` (#rrggbb) with thin lines around it."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    options = {
        "color": f"{red},{green},{blue},{round(255 * alpha)}",
        "outline_color": LINE_RGBA,
        "outline_width": "0.1",
    }
    options |= {"outline_width_unit": "MM", "style": "solid", "outline_style": "solid"}
    text = "".join(
        f'<Option name="{name}" value="{value}" type="QString"/>' for name, value in options.items()
    )
    return (
        f'<symbol type="fill" name="{number}" alpha="1" clip_to_extent="1" force_rhr="0">'
        '<layer class="SimpleFill" enabled="1" locked="0" pass="0"><Option '
        f'type="Map">{text}</Option></layer></symbol>'
    )
