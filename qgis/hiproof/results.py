"""What a run has written, as layers: coloured by the style kept in the file, roofs, or buildings raised in 2.5D."""

import os
from typing import ClassVar

from qgis.core import (
    Qgs25DRenderer,
    QgsCategorizedSymbolRenderer,
    QgsExpressionContextUtils,
    QgsFillSymbol,
    QgsProcessingLayerPostProcessorInterface,
    QgsRendererCategory,
    QgsVectorLayer,
)

# the colours of roof types, as the figures of the documentation have them
COLOURS = {
    "flat": "#9e9e9e",
    "monopitch": "#f6c85f",
    "gable": "#d1495b",
    "hip": "#3a7ca5",
    "pyramid": "#6f4e7c",
    "mansard": "#5b8c5a",
}
OTHERS = "#c9a27e"
HEIGHT = 'coalesce("rf_h_roof_max" - "rf_h_ground", 0)'


def layers_of(folder):
    """(name, QgsVectorLayer) of those layers that the run's GeoPackage has."""
    path = os.path.join(folder, "buildings.gpkg")
    found = (
        (name, QgsVectorLayer(f"{path}|layername={name}", f"hiproof {name}", "ogr"))
        for name in ("buildings", "roof_surfaces")
    )
    return [(name, layer) for name, layer in found if layer.isValid()]


def style_of(name, raised):
    """A function that styles a layer: buildings raised to their height, or everything coloured by its roof type."""
    if raised and name == "buildings":
        return raise_buildings
    return colour_by_type("hiproof_roof_type" if name == "buildings" else "type")


def raise_buildings(layer):
    """Draw buildings as blocks of their height, as QGIS' 2.5D view does."""
    QgsExpressionContextUtils.setLayerVariable(layer, "qgis_25d_height", HEIGHT)
    QgsExpressionContextUtils.setLayerVariable(layer, "qgis_25d_angle", 70)
    layer.setRenderer(Qgs25DRenderer())


def colour_by_type(field):
    """A styling function that colours by the roof type in `field`; a style that the file itself keeps goes before."""

    def colour(layer):
        _, told = layer.loadDefaultStyle()
        if told and layer.renderer().type() != "singleSymbol":
            return
        symbol = {
            name: QgsFillSymbol.createSimple({"color": c, "outline_color": "#404040"}) for name, c in COLOURS.items()
        }
        categories = [QgsRendererCategory(name, symbol[name], name) for name in symbol]
        rest = QgsFillSymbol.createSimple({"color": OTHERS, "outline_color": "#404040"})
        layer.setRenderer(QgsCategorizedSymbolRenderer(field, [*categories, QgsRendererCategory(None, rest, "other")]))

    return colour


class Styled(QgsProcessingLayerPostProcessorInterface):
    """Styles a layer when Processing has loaded it."""

    kept: ClassVar = []  # Processing holds no reference of its own

    def __init__(self, style):
        super().__init__()
        self.style = style
        self.kept.append(self)

    def postProcessLayer(self, layer, context, feedback):
        self.style(layer)
        layer.triggerRepaint()
