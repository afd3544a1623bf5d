"""Damaged outputs of a run, as `check`, `convert` and `report` may find them; all are made from one
sound run.
"""

import copy
import json
from collections.abc import Callable
from pathlib import Path

from sample_models import write_sample_run

HUGE, DEEP = 10**400, 1_000_000


def sound_lines(folder: Path) -> list[dict]:
    """The lines of a sound CityJSONSeq file: a header, a gable, a block with a courtyard, a
    building without model.
    """
    write_sample_run(folder)
    return [json.loads(line) for line in (folder / "buildings.city.jsonl").read_text().splitlines()]


def change(
    lines: list[dict], *path: str | int, to: object = None, by: Callable | None = None
) -> bytes:
    """The file with the member at `path` replaced; `...` is the line's only city object."""
    lines = copy.deepcopy(lines)
    place = lines
    for step in path[:-1]:
        place = place[next(iter(place)) if step is ... else step]
    place[path[-1]] = by(place[path[-1]]) if by else to
    return join_lines(lines)


def join_lines(lines: list[dict]) -> bytes:
    return ("\n".join(map(json.dumps, lines)) + "\n").encode()


def damaged_files(folder: Path) -> dict[str, bytes]:
    """Contents of `buildings.city.jsonl` by what is wrong with the file as a whole, or with its
    header.
    """
    lines = sound_lines(folder)
    sound = join_lines(lines)
    return {
        "empty": b"",
        "blank": b"\n \n",
        "not JSON": b"buildings\n",
        "binary": bytes(range(256)),
        "utf-16": sound.decode().encode("utf-16"),
        "null": b"null\n",
        "a list": b"[]\n",
        "a number": b"3\n",
        "a text": b'"buildings"\n',
        "nested a million deep": b"[" * DEEP + b"]" * DEEP,
        "a number of 5000 digits": sound.replace(b"0.0001", b"9" * 5000, 1),
        "header is a list": change(lines, 0, to=[]),
        "no header": join_lines(lines[1:]),
        "transform is a text": change(lines, 0, "transform", to="none"),
        "transform is a list": change(lines, 0, "transform", to=[1]),
        "scale of two": change(lines, 0, "transform", "scale", to=[1, 1]),
        "scale of words": change(lines, 0, "transform", "scale", to=["a", "b", "c"]),
        "huge scale": change(lines, 0, "transform", "scale", to=[HUGE, 1, 1]),
        "infinite translation": change(lines, 0, "transform", "translate", to=[float("inf"), 0, 0]),
    }


def damaged_models(folder: Path) -> dict[str, bytes]:
    """Contents of `buildings.city.jsonl` by what is wrong with its first building; the others are
    sound.
    """
    lines = sound_lines(folder)
    return damaged_members(lines) | damaged_geometries(lines)


def damaged_members(lines: list[dict]) -> dict[str, bytes]:
    """Lines, vertices, objects and attributes that are something else than they should be."""
    attributes = (1, "CityObjects", ..., "attributes")
    head, first, *other_lines = join_lines(lines).splitlines(keepends=True)
    return {
        "cut off": head + b"".join(other_lines) + first[: len(first) // 2],
        "nested after the header": head + b"[" * DEEP + b"]" * DEEP + b"\n" + b"".join(other_lines),
        "feature is a list": change(lines, 1, to=[]),
        "feature is null": change(lines, 1, to=None),
        "vertices of two": change(lines, 1, "vertices", by=lambda v: [p[:2] for p in v]),
        "vertices of words": change(
            lines, 1, "vertices", by=lambda v: [["a", "b", "c"] for _ in v]
        ),
        "vertices null": change(lines, 1, "vertices"),
        "a huge vertex": change(lines, 1, "vertices", 0, 0, to=HUGE),
        "a vertex that is no number": change(lines, 1, "vertices", 0, 0, to=float("nan")),
        "objects are a list": change(lines, 1, "CityObjects", to=[]),
        "objects are null": change(lines, 1, "CityObjects"),
        "an object is null": change(lines, 1, "CityObjects", "house-1"),
        "an object is a text": change(lines, 1, "CityObjects", "house-1", to="gable"),
        "an attribute that is no number": change(
            lines, *attributes, by=lambda a: a | {"height": float("nan")}
        ),
    }


def damaged_geometries(lines: list[dict]) -> dict[str, bytes]:
    """Boundaries and semantics that are something else than they should be."""
    geometry = (1, "CityObjects", ..., "geometry")
    solid = (*geometry, 0)
    face = (*solid, "boundaries", 0, 0)
    return {
        "geometry is a text": change(lines, *geometry, to="solid"),
        "geometry is a number": change(lines, *geometry, to=5),
        "a geometry is null": change(lines, *solid),
        "boundaries are null": change(lines, *solid, "boundaries"),
        "boundaries are numbers": change(lines, *solid, "boundaries", to=[[1, 2, 3]]),
        "boundaries are a text": change(lines, *solid, "boundaries", to="abc"),
        "boundaries nested too deep": change(lines, *solid, "boundaries", by=lambda b: [b]),
        "an index beyond": change(lines, *face, 0, 0, to=999),
        "a huge index": change(lines, *face, 0, 0, to=HUGE),
        "a negative index": change(lines, *face, 0, 0, to=-1),
        "an index with decimals": change(lines, *face, 0, 0, to=0.5),
        "an index that is a text": change(lines, *face, 0, 0, to="0"),
        "an index that is null": change(lines, *face, 0, 0),
        "semantics are a list": change(lines, *solid, "semantics", to=[1]),
        "semantics are a text": change(lines, *solid, "semantics", to="roof"),
        "a surface beyond": change(lines, *solid, "semantics", "values", 0, 0, to=99),
        "a surface that is a text": change(lines, *solid, "semantics", "values", 0, 0, to="roof"),
        "surfaces are numbers": change(lines, *solid, "semantics", "surfaces", to=[1, 2, 3]),
    }


def invalid_models(folder: Path) -> dict[str, bytes]:
    """As `damaged_models`, for what may be read as CityJSON but is no solid: `check` has findings
    for it.
    """
    lines = sound_lines(folder)
    solid = (1, "CityObjects", ..., "geometry", 0)
    face = (*solid, "boundaries", 0, 0)
    return {
        "a ring of two points": change(lines, *face, 0, by=lambda ring: ring[:2]),
        "a ring of one point": change(lines, *face, 0, by=lambda ring: ring[:1]),
        "a ring of no points": change(lines, *face, 0, to=[]),
        "a face of no rings": change(lines, *face, to=[]),
        "a ring of one point thrice": change(lines, *face, 0, by=lambda ring: ring[:1] * 3),
        "a ring on a line": change(lines, *face, 0, by=lambda ring: [*ring[:2], ring[0]]),
        "no faces": change(lines, *solid, "boundaries", to=[[]]),
        "a hole of two points": change(lines, *face, by=lambda rings: [*rings, rings[0][:2]]),
        "a vertex far away": change(lines, 1, "vertices", 0, 0, to=10**300),
    }


def odd_models(folder: Path) -> dict[str, bytes]:
    """As `damaged_models`, for what is unusual but can be used."""
    lines = sound_lines(folder)
    attributes = (1, "CityObjects", ..., "attributes")
    solid = (1, "CityObjects", ..., "geometry", 0)
    return {
        "attributes null": change(lines, *attributes),
        "a huge attribute": change(lines, *attributes, by=lambda a: a | {"height": HUGE}),
        "attributes with objects": change(
            lines, *attributes, by=lambda a: a | {"owner": {"names": [1, [2, None]]}}
        ),
        "roof type is a number": change(
            lines, *attributes, by=lambda a: a | {"hiproof_roof_type": 7}
        ),
        "status is a list": change(
            lines, *attributes, by=lambda a: a | {"hiproof_status": ["modelled"]}
        ),
        "roof type with markup": change(
            lines, *attributes, by=lambda a: a | {"hiproof_roof_type": "[/red]"}
        ),
        "geometry null": change(lines, 1, "CityObjects", ..., "geometry"),
        "no semantics": change(lines, *solid, "semantics"),
        "lod is a word": change(lines, *solid, "lod", to="two"),
        "metadata is a list": change(lines, 0, "metadata", to=[]),
        "no metadata": change(lines, 0, "metadata"),
    }


RECORDS = {
    "a list": b"[]",
    "null": b"null",
    "a number": b"7",
    "empty": b"",
    "not JSON": b"{hiproof",
    "nested a million deep": b"[" * DEEP,
    "binary": bytes(range(256)),
    "settings are a list": b'{"settings": [1]}',
    "read is a list": b'{"settings": {"read": [1]}}',
    "classes are words": b'{"settings": {"read": {"building_classes": ["six"]}}}',
    "classes are a number": b'{"settings": {"read": {"building_classes": 6}}}',
    "inputs are a list": b'{"inputs": ["a.laz"]}',
    "clouds are a text": b'{"inputs": {"clouds": "a.laz"}}',
    "clouds are numbers": b'{"inputs": {"clouds": [1, null]}}',
    "footprints are a list": b'{"inputs": {"footprints": ["a"]}}',
    "a path with a zero": b'{"inputs": {"clouds": ["a\\u0000b"], "footprints": "a\\u0000b"}}',
    "crs is a number": b'{"crs": -5}',
    "crs is a list": b'{"crs": [1, 2]}',
    "epochs are numbers": b'{"epochs": {"2014": 1}}',
    "an epoch counts no clouds": b'{"epochs": {"2014": {"clouds": "1"}}}',
    "a shift is a number": b'{"update": {"shift": 0.1}}',
    "a shift has two numbers": b'{"update": {"shift": {"applied": [0, 1]}}}',
}
"""Contents of `run.json`."""
