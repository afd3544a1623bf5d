"""Every command with its group, its line in the list of commands and an example."""

from __future__ import annotations

from typing import NamedTuple


class Entry(NamedTuple):
    """What the help shows of a command beside its options."""

    group: str
    help: str
    example: str
    first_options: tuple[str, ...] = ()  # where there are more than people need first


FIRST_OPTIONS = (
    "out",
    "footprints",
    "id_attribute",
    "bbox",
    "terrain",
    "crs",
    "overrides",
    "jobs",
    "restart",
    "quiet",
    "help_all",
)
"""Options of `hiproof reconstruct` that people need first: ten, and the one that shows the rest."""

COMMANDS = {
    "reconstruct": Entry(
        "Reconstruct",
        "model the buildings of point clouds",
        "hiproof reconstruct tile.laz --footprints footprints.gpkg --out models",
        FIRST_OPTIONS,
    ),
    "update": Entry(
        "Reconstruct",
        "bring models up to date with a new survey",
        "hiproof update models 2014/ --out models_2014",
    ),
    "demo": Entry(
        "Reconstruct", "model a bundled neighbourhood of 26 houses", "hiproof demo --out demo"
    ),
    "footprints": Entry(
        "Reconstruct",
        "fetch building footprints from Overture Maps",
        "hiproof footprints tile.laz --out footprints.gpkg",
    ),
    "classify": Entry(
        "Reconstruct",
        "write a copy of a cloud with ground and building classes",
        "hiproof classify tile.laz --out classified.laz",
    ),
    "settings": Entry(
        "Reconstruct",
        "print all settings as TOML",
        "hiproof settings --write hiproof.toml",
    ),
    "warm": Entry("Reconstruct", "compile before the first run", "hiproof warm --all"),
    "repro": Entry(
        "Reconstruct",
        "run a failed building again",
        "hiproof repro models/failures/B7 --out again",
    ),
    "status": Entry(
        "Inspect", "show the progress and the summary of a run", "hiproof status models"
    ),
    "view": Entry("Inspect", "show the models in your browser", "hiproof view models"),
    "report": Entry(
        "Inspect", "write an HTML page about a run", "hiproof report models --out report.html"
    ),
    "evaluate": Entry(
        "Inspect",
        "measure models against points, footprints or other models",
        "hiproof evaluate models tile.laz --json",
    ),
    "check": Entry(
        "Inspect",
        "check that solids are valid by ISO 19107",
        "hiproof check models/buildings.city.jsonl",
    ),
    "attributes": Entry(
        "Inspect", "explain every attribute and table", "hiproof attributes > attributes.md"
    ),
    "edit": Entry(
        "Edit", "correct buildings in your browser", "hiproof edit models --only doubtful"
    ),
    "build": Entry(
        "Edit",
        "make all files again from edited parameters",
        "hiproof build models/parameters.jsonl --out edited",
    ),
    "enrich": Entry(
        "Export", "add party walls, house types and the sun to a run", "hiproof enrich models"
    ),
    "convert": Entry(
        "Export", "convert models to another format", "hiproof convert models models.glb"
    ),
    "load": Entry(
        "Export", "load models into PostGIS", "hiproof load models postgresql://user@host/database"
    ),
    "segment": Entry(
        "Network",
        "label the points of single buildings",
        "hiproof segment a.laz --out labelled.laz",
    ),
    "train": Entry(
        "Network",
        "train the network on labelled points",
        "hiproof train --data simulated --out net",
    ),
}
