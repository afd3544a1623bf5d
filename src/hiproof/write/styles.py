"""How QGIS draws the layers of a GeoPackage: a style for each in the table `layer_styles`, which QGIS asks by itself."""

from __future__ import annotations

from typing import Any

from .attribute_list import OWN
from .colours import type_colour, type_colours
from .xml_text import xml_attribute

TABLE = "layer_styles"
TYPE_COLUMN = {"buildings": f"{OWN}roof_type", "parts": "type", "roof_surfaces": "type"}
"""Column of the roof type by layer."""

FILL_ALPHA = {"buildings": 0.35, "parts": 0.5, "roof_surfaces": 1.0}
"""Outlines and parts let roof surfaces be seen through them."""

LINE = "50,50,50,255"


def style_rows() -> list[dict[str, Any]]:
    """The rows of `layer_styles`: one a layer, the default of it."""
    return [
        {
            "f_table_catalog": "",
            "f_table_schema": "",
            "f_table_name": layer,
            "f_geometry_column": "geom",
            "styleName": "roof types",
            "styleQML": style_qml(layer),
            "styleSLD": "",
            "useAsDefault": True,
            "description": "coloured by roof type",
            "owner": "hiproof",
            "ui": None,
            "update_time": "2000-01-01T00:00:00.000Z",
        }
        for layer in TYPE_COLUMN
    ]


def style_qml(layer: str) -> str:
    """A layer's style in QGIS' own form: a colour for each roof type, that of an unknown one for all others.

    >>> style_qml("parts").count("<category ") == len(type_colours())
    True
    """
    kinds = [*(name for name in type_colours() if name != "unknown"), "unknown"]
    categories = "".join(
        f'<category symbol="{k}" value="{"" if name == "unknown" else xml_attribute(name)}" label="{xml_attribute(name)}"'
        ' render="true"/>'
        for k, name in enumerate(kinds)
    )
    symbols = "".join(fill_symbol(k, type_colour(name), FILL_ALPHA[layer]) for k, name in enumerate(kinds))
    return (
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>"
        '<qgis version="3.22.0" styleCategories="Symbology">'
        f'<renderer-v2 type="categorizedSymbol" attr="{TYPE_COLUMN[layer]}" symbollevels="0" forceraster="0">'
        f"<categories>{categories}</categories><symbols>{symbols}</symbols></renderer-v2></qgis>"
    )


def fill_symbol(number: int, colour: str, alpha: float) -> str:
    """A plain fill with thin lines around it; `colour` is #rrggbb."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    options = {"color": f"{red},{green},{blue},{round(255 * alpha)}", "outline_color": LINE, "outline_width": "0.1"}
    options |= {"outline_width_unit": "MM", "style": "solid", "outline_style": "solid"}
    told = "".join(f'<Option name="{name}" value="{value}" type="QString"/>' for name, value in options.items())
    return (
        f'<symbol type="fill" name="{number}" alpha="1" clip_to_extent="1" force_rhr="0">'
        f'<layer class="SimpleFill" enabled="1" locked="0" pass="0"><Option type="Map">{told}</Option></layer></symbol>'
    )
