"""Runs over points, and what of a run's output is compared byte by byte."""

from hiproof import read_parameters
from hiproof.city.run import Request, reconstruct_area
from tiny_town import write_cloud, write_footprints

RECORDS = ("buildings.gml", "buildings.city.jsonl", "parameters.jsonl")


def records(out):
    """The content of the files by name."""
    return {name: (out / name).read_bytes() for name in RECORDS}


def by_id(out):
    """The parameter rows by building."""
    return {row["id"]: row for row in read_parameters(out / "parameters.jsonl")}


def run_points(folder, xyz, classes, footprints=None, **options):
    """Run over a cloud and footprints, if there are any; return the rows by id, and the summary."""
    folder.mkdir(parents=True, exist_ok=True)
    cloud = write_cloud(folder / "cloud.laz", xyz, classes, origin=xyz.min(axis=0))
    outlines = footprints and str(write_footprints(folder / "footprints.geojson", footprints))
    summary = reconstruct_area(Request((str(cloud),), folder / "out", outlines, **options))
    return by_id(folder / "out"), summary
