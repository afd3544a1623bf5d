"""Finished runs damaged at random but by structure, and every reader of a run over them."""

from __future__ import annotations

import copy
import json
import logging
import random
import shutil
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

from hiproof.cli import check
from hiproof.cli.convert import FormatName, convert
from hiproof.cli.evaluate import evaluate
from hiproof.cli.report import report
from hiproof.cli.view import open_tiles
from hiproof.edit.desk import Desk
from hiproof.errors import HiproofError
from hiproof.log import LOGGER
from hiproof.parametric.finished import load_postgis
from hiproof.parametric.run import build_file
from hiproof.write.fragments import Sheet
from hiproof.write.tables.postgis import Load, database_rows
from sample_parameters import write_parameters_of_each_kind

FILES = ("buildings.city.jsonl", "parameters.jsonl", "run.json")
OTHERS: list[Any] = json.loads(
    r"""[null, true, false, 0, 1, -1, 2, 7.5, -0.25, 1e-300, 1e9, 1e20, 1e300, -1e300,
    1000000000000000, 2147483648, 9223372036854775808, "", "a", "²", "0", "\u0000", "\ud800",
    "../../x", "NaN", "gable", "EPSG:28992", "EPSG:4326", "foot", [], [1], [null], ["a"], [[]],
    [[[]]], [0, 0, 0], [1e300, 0, 0], [[0, 0], [1, 1], [0, 1]], [[[0, 0], [1, 1], [0, 1]]], {},
    {"a": 1}, {"type": "Solid"}, NaN, Infinity, -Infinity]"""
)
OTHERS += [10**400, "a" * 5000]
"""What takes the place of a value; infinities and NaN are written as Python's JSON writes them."""


def places(value: Any, path: tuple = ()) -> Iterator[tuple]:
    """Paths of all values in a JSON value, of its lists' first, last and two further items
    alone.
    """
    yield path
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from places(inner, (*path, name))
    elif isinstance(value, list):
        for index in sorted({0, 1, len(value) // 2, len(value) - 1} & set(range(len(value)))):
            yield from places(value[index], (*path, index))


def damage(value: Any, rng: random.Random) -> Any:
    """The value with something in it replaced, removed, repeated or renamed."""
    value = copy.deepcopy(value)
    path = rng.choice(list(places(value)))
    if not path:
        return copy.deepcopy(rng.choice(OTHERS))
    inside = value
    for step in path[:-1]:
        inside = inside[step]
    step, action = path[-1], rng.random()
    if action < 0.65:
        inside[step] = copy.deepcopy(rng.choice(OTHERS))
    elif action < 0.8:
        del inside[step]
    elif action < 0.9 and isinstance(inside, list):
        inside.insert(step, copy.deepcopy(inside[step]))
    elif action < 0.95 and isinstance(inside, dict):
        inside[rng.choice(["x", "type", "id", "", "\ud800"])] = inside.pop(step)
    elif isinstance(inside[step], (int, float)) and not isinstance(inside[step], bool):
        inside[step] = inside[step] * rng.choice([-1, 1.01, 10, 1e6]) + rng.choice([0, 1])
    else:
        inside[step] = [inside[step]]
    return value


def damaged_text(text: str, rng: random.Random) -> bytes:
    """A file's text with a line damaged, or the text itself."""
    lines, action = text.splitlines(), rng.random()
    if action < 0.85:
        number = (
            rng.randrange(len(lines))
            if len(lines) < 3 or rng.random() < 0.3
            else rng.randrange(1, len(lines))
        )
        value = json.loads(text) if text.startswith("{\n") else json.loads(lines[number])
        for _ in range(rng.choice([1, 1, 1, 2])):
            value = damage(value, rng)
        lines = (
            [json.dumps(value)]
            if text.startswith("{\n")
            else [*lines[:number], json.dumps(value), *lines[number + 1 :]]
        )
    elif action < 0.9:
        return text.encode()[: rng.randrange(len(text))]
    elif action < 0.95:
        number = rng.randrange(len(lines))
        lines = rng.choice(
            [lines[:number] + lines[number + 1 :], [*lines, lines[number]], lines[::-1]]
        )
    else:
        place = rng.randrange(len(text))
        return text.encode()[:place] + rng.randbytes(rng.randrange(1, 9)) + text.encode()[place:]
    return ("\n".join(lines) + "\n").encode()


def edit(folder: Path) -> None:
    """All that the page of `hiproof edit` asks of a run."""
    desk = Desk(folder, "anna")
    for row in json.loads(json.dumps(desk.buildings(), allow_nan=False))["rows"]:
        for ask in (
            desk.building,
            desk.cloud,
            lambda id: desk.change(
                id, {"parts": desk.building(id)["parts"], "asked": {"action": "show"}}
            ),
            lambda id: desk.accept(id, {"parts": desk.building(id)["parts"], "version": "run"}),
        ):
            try:
                json.dumps(ask(row["id"]), allow_nan=False).encode()
            except HiproofError as error:
                sentence(error)


def build(folder: Path) -> None:
    built = build_file(folder / "parameters.jsonl", folder / "built")
    assert built.exit_code != 1, built.not_built
    if check.count_bad([check.check_file(folder / "built" / "buildings.city.jsonl", 0.01)]):
        raise AssertionError("built what is invalid")


def view(folder: Path) -> None:
    with open_tiles(folder) as tiles:
        assert (tiles / "tileset.json").is_file()


def load(folder: Path) -> None:
    """All that is read for a database, and the values it would be sent."""

    def send(dsn: str, buildings: Iterable[Sheet], run: Load, damaged: Any) -> int:
        texts = [database_rows(sheet).to_text() for sheet in buildings]
        assert not any(b"\\u0000" in text for text in texts)
        return len(texts)

    with patch("hiproof.write.tables.postgis.load_tables", send):
        load_postgis(folder, "", damaged=sentence)


def convert_file(folder: Path) -> None:
    """The models without their parameters."""
    convert(folder / FILES[0], folder / "again.gml")


READERS: dict[str, tuple[Callable[[Path], Any], tuple[str, ...]]] = {
    "check": (
        lambda folder: str(check.count_bad([check.check_file(folder / FILES[0], 0.01)])),
        FILES[:1],
    ),
    "convert glb": (lambda folder: convert(folder, format=FormatName.glb), FILES[1:]),
    "convert obj": (lambda folder: convert(folder, format=FormatName.obj), FILES[1:]),
    "convert a file": (convert_file, FILES[:1]),
    "view": (view, FILES[1:]),
    "report": (lambda folder: report(folder), FILES[::2]),
    "evaluate": (lambda folder: evaluate(folder, [str(folder / "cloud.xyz")]), FILES[::2]),
    "load": (load, FILES[1:]),
    "edit": (edit, FILES[1:]),
    "build": (build, FILES[1:]),
}
"""Every reader of a run, with the files that it reads."""


def sentence(error: HiproofError) -> None:
    """Fails for an error that is no sentence that a terminal can show."""
    text = str(error)
    assert "expected" in text and "got" in text and "\n" not in text and len(text) < 1500, text
    text.encode()


def find_fault(read: Callable[[Path], Any], folder: Path) -> str:
    """What goes wrong when a reader reads a run, other than that it says so; empty where nothing
    does.
    """
    code = None
    try:
        with redirect_stdout(StringIO()):
            code = read(folder)
    except HiproofError as error:
        try:
            sentence(error)
        except (AssertionError, UnicodeError):
            return f"no sentence: {error!r:.2000}"
    except Exception:
        return traceback.format_exc()
    return f"exit code {code}" if code == 1 else ""


def write_sound_run(folder: Path) -> Path:
    """Write a run of a few buildings of different roofs, made of their parameters, with a cloud to
    measure against.
    """
    write_parameters_of_each_kind(folder / "given" / "parameters.jsonl")
    build_file(folder / "given" / "parameters.jsonl", folder / "run")
    (folder / "run" / "cloud.xyz").write_text(
        "85000.0 446000.0 5.0\n85001.0 446000.0 5.0\n85002.0 446001.0 5.0\n"
    )
    return folder / "run"


def find_faults(
    sound: Path, work: Path, count: int, seed: int, readers: int = len(READERS)
) -> Iterator[tuple[int, str, str]]:
    """Yield (number, reader, what goes wrong) of `count` runs made of a sound one, each read by so
    many `readers`.
    """
    texts = {name: (sound / name).read_text() for name in FILES}
    LOGGER.setLevel(logging.ERROR + 1)
    for number in range(seed, seed + count):
        rng = random.Random(number)
        name = rng.choice(FILES)
        content = damaged_text(texts[name], rng)
        readers_of_file = [reader for reader, (_, files) in READERS.items() if name in files]
        for reader in rng.sample(readers_of_file, min(readers, len(readers_of_file))):
            shutil.rmtree(work, ignore_errors=True)
            shutil.copytree(sound, work)
            (work / name).write_bytes(content)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                fault = find_fault(READERS[reader][0], work)
            if fault:
                yield number, reader, fault
