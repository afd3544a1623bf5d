"""A run's results as layers.

They have the style kept in the file, roofs, or buildings raised in 2.5D.
"""

import os
from typing import ClassVar

from qgis.core import (
    Qgs25DRenderer,
    QgsExpressionContextUtils,
    QgsProcessingLayerPostProcessorInterface,
    QgsVectorLayer,
)

HEIGHT = 'coalesce("rf_h_roof_max" - "rf_h_ground", 0)'


def load_layers(folder):
    """Return (name, QgsVectorLayer) of the layers in the run's GeoPackage."""
    path = os.path.join(folder, "buildings.gpkg")
    layers = (
        (name, QgsVectorLayer(f"{path}|layername={name}", f"hiproof {name}", "ogr"))
        for name in ("buildings", "roof_surfaces")
    )
    return [(name, layer) for name, layer in layers if layer.isValid()]


def choose_style(name, raised):
    """Return a function that styles a layer.

    Buildings are raised to their height, or keep the file's style by roof type.
    """
    return raise_buildings if raised and name == "buildings" else QgsVectorLayer.loadDefaultStyle


def raise_buildings(layer):
    """Draw buildings as blocks of their height, as QGIS' 2.5D view does."""
    QgsExpressionContextUtils.setLayerVariable(layer, "qgis_25d_height", HEIGHT)
    QgsExpressionContextUtils.setLayerVariable(layer, "qgis_25d_angle", 70)
    layer.setRenderer(Qgs25DRenderer())


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
