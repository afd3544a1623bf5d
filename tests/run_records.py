"""What of a run's output is compared byte by byte."""

from hiproof import read_parameters

RECORDS = ("buildings.gml", "buildings.city.jsonl", "parameters.jsonl")


def records(out):
    """The content of the files by name."""
    return {name: (out / name).read_bytes() for name in RECORDS}


def by_id(out):
    """The parameter rows by building."""
    return {row["id"]: row for row in read_parameters(out / "parameters.jsonl")}
