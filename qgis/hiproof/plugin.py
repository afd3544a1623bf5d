"""The plugin, and the provider that it brings to Processing."""

from qgis.core import QgsApplication, QgsProcessingProvider

from .algorithms import ALGORITHMS


class Provider(QgsProcessingProvider):
    """The algorithms under the name hiproof."""

    def id(self):
        return "hiproof"

    def name(self):
        return "hiproof"

    def longName(self):
        return "hiproof: buildings from LiDAR"

    def loadAlgorithms(self):
        for algorithm in ALGORITHMS:
            self.addAlgorithm(algorithm())


class Plugin:
    """Registers the provider while the plugin is on."""

    provider = None

    def initProcessing(self):
        self.provider = Provider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self):
        self.initProcessing()

    def unload(self):
        QgsApplication.processingRegistry().removeProvider(self.provider)
