"""How QGIS draws the layers of a GeoPackage: styles in the table `layer_styles`, whose defaults
QGIS applies by itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..attribute_list import OWN
from ..colours import GRADE_COLOURS, UNKNOWN_COLOUR, type_colours
from ..xml_text import xml_attribute

TABLE = "layer_styles"
LINE = "50,50,50,255"


class Style(NamedTuple):
    """A colour (#rrggbb) for each value of a layer's column, that of "unknown" for all others;

    `alpha` lets surfaces below show.
    """

    layer: str
    name: str
    column: str
    colours: dict[str, str]
    alpha: float
    is_default: bool = True


STYLES = (
    Style("buildings", "roof types", f"{OWN}roof_type", type_colours(), 0.35),
    Style("parts", "roof types", "type", type_colours(), 0.5),
    Style("roof_surfaces", "roof types", "type", type_colours(), 1.0),
    Style(
        "buildings",
        "quality",
        f"{OWN}quality",
        GRADE_COLOURS | {"unknown": UNKNOWN_COLOUR},
        0.5,
        is_default=False,
    ),
)


def style_rows() -> list[dict[str, Any]]:
    """The rows of `layer_styles`: by roof type, the default of every layer, and by the quality of
    the models.
    """
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
        for style in STYLES
    ]


def style_qml(style: Style) -> str:
    """A style in QGIS' own form.

    >>> style_qml(STYLES[1]).count("<category ") == len(type_colours())
    True
    """
    kinds = [*(name for name in style.colours if name != "unknown"), "unknown"]
    categories = "".join(
        f'<category symbol="{k}" value="{"" if name == "unknown" else xml_attribute(name)}" '
        f'label="{xml_attribute(name)}"'
        ' render="true"/>'
        for k, name in enumerate(kinds)
    )
    symbols = "".join(
        fill_symbol(k, style.colours[name], style.alpha) for k, name in enumerate(kinds)
    )
    return (
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>"
        '<qgis version="3.22.0" styleCategories="Symbology">'
        f'<renderer-v2 type="categorizedSymbol" attr="{style.column}" symbollevels="0" '
        'forceraster="0">'
        f"<categories>{categories}</categories><symbols>{symbols}</symbols></renderer-v2></qgis>"
    )


def fill_symbol(number: int, colour: str, alpha: float) -> str:
    """A plain fill with thin lines around it; `colour` is #rrggbb."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    options = {
        "color": f"{red},{green},{blue},{round(255 * alpha)}",
        "outline_color": LINE,
        "outline_width": "0.1",
    }
    options |= {"outline_width_unit": "MM", "style": "solid", "outline_style": "solid"}
    told = "".join(
        f'<Option name="{name}" value="{value}" type="QString"/>' for name, value in options.items()
    )
    return (
        f'<symbol type="fill" name="{number}" alpha="1" clip_to_extent="1" force_rhr="0">'
        '<layer class="SimpleFill" enabled="1" locked="0" pass="0"><Option '
        f'type="Map">{told}</Option></layer></symbol>'
    )
