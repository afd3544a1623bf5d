"""The algorithms: their parameters, their command, and their results."""

import functools
import inspect
import os

from qgis.core import (
    QgsProcessing,
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingOutputFile,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterCrs,
    QgsProcessingParameterEnum,
    QgsProcessingParameterExtent,
    QgsProcessingParameterFile,
    QgsProcessingParameterFolderDestination,
    QgsProcessingParameterMultipleLayers,
    QgsProcessingParameterNumber,
    QgsProcessingParameterRasterLayer,
    QgsProcessingParameterString,
    QgsProcessingParameterVectorLayer,
    QgsProviderRegistry,
)

from . import commands, process, results

FORMATS = tuple(commands.FORMATS)


class Algorithm(QgsProcessingAlgorithm):
    """What all have in common: they call the command named by the parameter PROGRAM."""

    def createInstance(self):
        return type(self)()

    def name(self):
        return type(self).__name__.lower()

    def shortHelpString(self):
        return " ".join(inspect.cleandoc(self.__doc__).split())

    def add_program(self):
        self.add(
            QgsProcessingParameterString(
                "PROGRAM", "Program", os.environ.get("HIPROOF_PROGRAM", "hiproof")
            )
        )

    def add(self, parameter):
        self.addParameter(parameter)

    def add_clouds(self, label="Point clouds (LAS, LAZ, COPC, text, PLY)", optional=False):
        self.add(
            QgsProcessingParameterMultipleLayers(
                "CLOUDS", label, QgsProcessing.TypeFile, optional=optional
            )
        )

    def call(self, command, feedback, progress=None):
        """Run a command, its lines into the feedback; the user's Cancel ends it."""
        feedback.pushCommandInfo(" ".join(command))
        try:
            return process.run(command, feedback.pushInfo, feedback.isCanceled, progress)
        except process.Failed as error:
            raise QgsProcessingException(str(error)) from error

    def get_source(self, parameters, name, context):
        """Return (path, layer, condition) of a vector layer.

        Each is None where there is none.
        """
        layer = self.parameterAsVectorLayer(parameters, name, context)
        if layer is None:
            return None, None, None
        uri_parts = QgsProviderRegistry.instance().decodeUri(
            layer.dataProvider().name(), layer.source()
        )
        return (
            uri_parts.get("path") or layer.source(),
            uri_parts.get("layerName") or None,
            layer.subsetString() or None,
        )

    def load(self, folder, raised, context):
        """Have the layers of a run's GeoPackage loaded, with their styles."""
        loaded = {}
        for name, layer in results.load_layers(folder):
            context.temporaryLayerStore().addMapLayer(layer)
            details = QgsProcessingContext.LayerDetails(layer.name(), context.project(), name)
            details.setPostProcessor(results.Styled(results.choose_style(name, raised)))
            context.addLayerToLoadOnCompletion(layer.id(), details)
            loaded[name.upper()] = layer.id()
        return loaded


class Reconstruct(Algorithm):
    """Models the buildings of point clouds as LoD2 solids with named roofs.

    Without footprints the cloud is split into buildings. The results (CityGML, CityJSON,
    parameters, GeoPackage) come into a folder; said again, a run goes on where it stopped.
    """

    def displayName(self):
        return "Reconstruct buildings"

    def initAlgorithm(self, configuration=None):
        self.add_clouds()
        polygons = [QgsProcessing.TypeVectorPolygon]
        self.add(
            QgsProcessingParameterVectorLayer("FOOTPRINTS", "Footprints", polygons, optional=True)
        )
        self.add(QgsProcessingParameterRasterLayer("TERRAIN", "Terrain model", optional=True))
        self.add(
            QgsProcessingParameterExtent(
                "EXTENT", "Only buildings in (the clouds' coordinates)", optional=True
            )
        )
        self.add(QgsProcessingParameterCrs("CRS", "CRS of clouds that name none", optional=True))
        self.add(
            QgsProcessingParameterNumber(
                "PROCESSES", "Processes (else as many as pay)", optional=True, minValue=1
            )
        )
        self.add(
            QgsProcessingParameterString(
                "MORE", "Further options of hiproof reconstruct", "", optional=True
            )
        )
        self.add(QgsProcessingParameterBoolean("LOAD", "Load the buildings", True))
        self.add(QgsProcessingParameterBoolean("RAISED", "Raise them in 2.5D", False))
        self.add_program()
        self.add(QgsProcessingParameterFolderDestination("OUTPUT", "Folder for the results"))

    def processAlgorithm(self, parameters, context, feedback):
        program = self.parameterAsString(parameters, "PROGRAM", context)
        folder = self.parameterAsString(parameters, "OUTPUT", context)
        self.call(
            self.command(parameters, context, program, folder),
            feedback,
            functools.partial(tell, program, folder, feedback),
        )
        if not self.parameterAsBool(parameters, "LOAD", context):
            return {"OUTPUT": folder}
        return {
            "OUTPUT": folder,
            **self.load(folder, self.parameterAsBool(parameters, "RAISED", context), context),
        }

    def command(self, parameters, context, program, folder):
        footprints, layer, condition = self.get_source(parameters, "FOOTPRINTS", context)
        terrain = self.parameterAsRasterLayer(parameters, "TERRAIN", context)
        crs = self.parameterAsCrs(parameters, "CRS", context)
        extent = self.parameterAsExtent(parameters, "EXTENT", context)
        sides = (extent.xMinimum(), extent.yMinimum(), extent.xMaximum(), extent.yMaximum())
        return commands.reconstruct(
            program,
            self.parameterAsFileList(parameters, "CLOUDS", context),
            folder,
            footprints,
            layer,
            condition,
            None if extent.isNull() else sides,
            terrain and terrain.source(),
            crs.authid() if crs.isValid() else None,
            self.parameterAsInt(parameters, "PROCESSES", context),
            self.parameterAsString(parameters, "MORE", context),
        )


def tell(program, folder, feedback):
    """Move the progress bar to the share of buildings done."""
    share = process.measure_progress(program, folder)
    if share is not None:
        feedback.setProgress(share)


class Evaluate(Algorithm):
    """Measures a run's models against points, its own where none are named.

    Distances, shares, overlaps and volumes go to evaluation.csv, a row a building.
    """

    def displayName(self):
        return "Evaluate models"

    def initAlgorithm(self, configuration=None):
        self.add(
            QgsProcessingParameterFile(
                "FOLDER", "Folder of a run", QgsProcessingParameterFile.Folder
            )
        )
        self.add_clouds("Point clouds, where not those of the run", optional=True)
        polygons = [QgsProcessing.TypeVectorPolygon]
        self.add(
            QgsProcessingParameterVectorLayer("FOOTPRINTS", "Footprints", polygons, optional=True)
        )
        self.add_program()
        self.addOutput(QgsProcessingOutputFile("TABLE", "Figures by building"))

    def processAlgorithm(self, parameters, context, feedback):
        folder = self.parameterAsString(parameters, "FOLDER", context)
        clouds = [
            cloud for cloud in self.parameterAsFileList(parameters, "CLOUDS", context) if cloud
        ]
        footprints, layer, _ = self.get_source(parameters, "FOOTPRINTS", context)
        program = self.parameterAsString(parameters, "PROGRAM", context)
        self.call(commands.evaluate(program, folder, clouds, footprints, layer), feedback)
        return {"TABLE": os.path.join(folder, "evaluation.csv")}


class Convert(Algorithm):
    """Writes a run's models in another format."""

    def displayName(self):
        return "Convert models"

    def initAlgorithm(self, configuration=None):
        self.add(
            QgsProcessingParameterFile(
                "FOLDER", "Folder of a run", QgsProcessingParameterFile.Folder
            )
        )
        self.add(QgsProcessingParameterEnum("FORMAT", "Format", FORMATS, defaultValue=0))
        self.add_program()
        self.addOutput(QgsProcessingOutputFile("FILE", "The models"))

    def processAlgorithm(self, parameters, context, feedback):
        folder = self.parameterAsString(parameters, "FOLDER", context)
        format = FORMATS[self.parameterAsEnum(parameters, "FORMAT", context)]
        out = os.path.join(folder, commands.FORMATS[format])
        self.call(
            commands.convert(
                self.parameterAsString(parameters, "PROGRAM", context), folder, format, out
            ),
            feedback,
        )
        return {"FILE": out}


class Load(Algorithm):
    """Loads the buildings and roof surfaces of a run, coloured or raised.

    Colours are by roof type; buildings are raised in 2.5D.
    """

    def displayName(self):
        return "Load results"

    def initAlgorithm(self, configuration=None):
        self.add(
            QgsProcessingParameterFile(
                "FOLDER", "Folder of a run", QgsProcessingParameterFile.Folder
            )
        )
        self.add(QgsProcessingParameterBoolean("RAISED", "Raise them in 2.5D", False))

    def processAlgorithm(self, parameters, context, feedback):
        folder = self.parameterAsString(parameters, "FOLDER", context)
        run_layers = self.load(folder, self.parameterAsBool(parameters, "RAISED", context), context)
        if not run_layers:
            raise QgsProcessingException(
                f"expected the folder of a run, got {folder}, which has no buildings.gpkg; choose "
                "another"
            )
        return run_layers


ALGORITHMS = (Reconstruct, Evaluate, Convert, Load)
