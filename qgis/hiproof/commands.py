"""Command lines of `hiproof`, made of what a person chose in QGIS."""

import shlex

# Names of formats of `hiproof convert`, and the files that they are written to. GeoPackage, CityGML
# and the like, which a run writes itself, are there already.
FORMATS = {
    "glb": "buildings.glb",
    "obj": "buildings.obj",
    "stl": "buildings.stl",
    "3dtiles": "buildings.3dtiles",
    "ifc": "buildings.ifc",
    "dxf": "buildings.dxf",
    "3dm": "buildings.3dm",
    "cityjson": "buildings.city.json",
    "citygml3": "buildings.citygml3.gml",
    "fgb": "buildings.fgb",
}


def reconstruct(
    program,
    clouds,
    out,
    footprints=None,
    layer=None,
    condition=None,
    bbox=None,
    terrain=None,
    crs=None,
    processes=None,
    extra="",
):
    """Return the command of the main job.

    `bbox` is (xmin, ymin, xmax, ymax) in the clouds' coordinates, `more` further options as typed.
    """
    options = {
        "--footprints": footprints,
        "--layer": layer,
        "--where": condition,
        "--bbox": bbox and ",".join(f"{side:.10g}" for side in bbox),
        "--terrain": terrain,
        "--crs": crs,
        "--jobs": processes and str(processes),
    }
    return [program, "reconstruct", *clouds, "--out", out, *pairs(options), *shlex.split(extra)]


def evaluate(program, folder, clouds, footprints=None, layer=None):
    """Return the command that measures a run's models against points."""
    return [
        program,
        "evaluate",
        folder,
        *clouds,
        *pairs({"--footprints": footprints, "--layer": layer}),
    ]


def convert(program, folder, format, out=None):
    """Return the command that converts a run's models for 3D viewers."""
    return [program, "convert", folder, *([out] if out else []), "--format", format]


def status(program, folder):
    """Return the command that shows how far a run is."""
    return [program, "status", folder, "--json"]


def pairs(options):
    """Return options with their values, those without one left out.

    A value that begins with a dash cannot be taken for an option.
    """
    return [f"{name}={value}" for name, value in options.items() if value]
