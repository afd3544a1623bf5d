"""Malformed addresses with a known secret, and everything that may repeat it."""

from __future__ import annotations

import random
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from unittest.mock import patch
from urllib.parse import quote, unquote

from hiproof import cli, masking
from hiproof.city.run import Request, reconstruct_area
from hiproof.compiled import news
from hiproof.log import LOGGER
from sample_models import write_sample_run

PARTS = ("Xq7Zw", "kV9jR", "Tb4Yh")  # of secrets; no word of a message holds one
SIGNS = (
    "",
    *"%@:/?#&= '\"\\,;+[]é\t$!|<{-\u202e",
    *["%%", "%zz", "%4", "//", "%20", "%40", "%2F", "%25", ".."],
)
SHAPES = (
    "postgresql://adm:{}@127.0.0.1:1/t?table=fp",
    "postgres://adm:{}@127.0.0.1:1/t?table=fp",
    "postgresql//adm:{}@127.0.0.1:1/t?table=fp",
    "postgresql:/adm:{}@127.0.0.1:1/t?table=fp",
    "postgresql:adm:{}@127.0.0.1:1/t",
    "postgresql:// adm:{}@127.0.0.1:1/t",
    "adm:{}@127.0.0.1:1/t",
    "POSTGRESQL://adm:{}@127.0.0.1:1/t?table=fp",
    "postgresql://adm:{}@127.0.0.1:x/t?table=fp",
    "postgresql://adm:{}@[::1/t?table=fp",
    "postgresql://adm:{}@/t?table=fp&host=/nowhere",
    "postgresql://adm:{}@127.0.0.1:1/t?table=fp&sslmode=never",
    "postgresql://adm@127.0.0.1:1/t?table=fp&password={}",
    "postgresql://adm@127.0.0.1:1/t?password={}&table=fp",
    "postgresql://127.0.0.1:1/t?user=adm&password={}&table=fp&nonsense=1",
    "host=127.0.0.1 port=1 user=adm password={}",
    "host=127.0.0.1 port=1 password={} user=adm",
    "host=127.0.0.1 port=1 password='{}' user=adm",
    "host=127.0.0.1 port=1 password='{} user=adm",
    "host=127.0.0.1 port=1 password = {} nonsense",
    "PG:host=127.0.0.1 port=1 user=adm password={} dbname=t",
    "https://adm:{}@127.0.0.1:1/a.laz",
    "https://{}@127.0.0.1:1/a.laz",
    "http:/adm:{}@127.0.0.1:1/a.laz",
    "http//adm:{}@127.0.0.1:1/a.laz",
    "http://127.0.0.1:1/a.laz?sig={}&v=1",
    "http://127.0.0.1:1/a.laz?X-Amz-Signature={}",
    "http://127.0.0.1:1/a.laz?access_token={}",
    "http://127.0.0.1:1/a.laz?AWSAccessKeyId=adm&Signature={}&Expires=9",
    "s3://adm:{}@bucket/a.laz",
    "ftp://adm:{}@127.0.0.1:1/a.laz",
    "nothing://adm:{}@127.0.0.1:1/a.laz",
    "/vsicurl/http://adm:{}@127.0.0.1:1/a.tif",
)


def draw_secret(rng: random.Random) -> str:
    sign = (rng.choice(SIGNS), rng.choice(SIGNS))
    text = PARTS[0] + sign[0] + PARTS[1] + (sign[1] + PARTS[2] if rng.random() < 0.5 else "")
    return quote(text, safe="") if rng.random() < 0.2 else text


def draw_address(rng: random.Random) -> str:
    """An address with a secret, in some with a character dropped or repeated outside of it."""
    prefix, suffix = rng.choice(SHAPES).split("{}")
    if rng.random() < 0.2 and len(suffix) > 3:
        place = rng.randrange(1, len(suffix))
        suffix = (
            suffix[:place]
            + suffix[place:][rng.choice([0, 1]) :]
            + rng.choice(["", "", "@", ":", " "])
        )
    return prefix + draw_secret(rng) + suffix


def call(*arguments: str) -> str:
    """What the command line says."""
    out = StringIO()
    level = LOGGER.level
    handlers = LOGGER.handlers[:]
    show = warnings.showwarning
    listener = news.listener
    try:
        patched_arguments = patch.object(sys, "argv", ["hiproof", *arguments])
        with patched_arguments, redirect_stdout(out), redirect_stderr(out), suppress(SystemExit):
            cli.main()
    finally:
        LOGGER.handlers[:], warnings.showwarning, news.listener = handlers, show, listener
        LOGGER.setLevel(level)
    return out.getvalue()


def read_files(folder: Path) -> str:
    """The content of all files, as text."""
    return "\n".join(
        f"{file.name}\n{file.read_bytes().decode('latin-1')}"
        for file in folder.rglob("*")
        if file.is_file()
    )


def list_ways(folder: Path) -> dict[str, Callable[[str], str]]:
    """All that may repeat an address, by what the address is given as; texts of screen, log and
    files.
    """
    run, cloud, log, out = folder / "run", str(folder / "cloud.xyz"), folder / "log", folder / "out"
    functions = ("reconstruct", "--out", str(out), "--log-file", str(log), "--verbose", "--restart")

    def api(given_address: str) -> str:
        try:
            with redirect_stderr(StringIO()) as output:
                reconstruct_area(Request((cloud,), out, given_address, restart=True))
        except Exception as error:
            return output.getvalue() + str(error)
        return output.getvalue()

    return {
        "load": lambda given_address: call("load", str(run), given_address),
        "load in pieces": lambda given_address: call("load", str(run), *given_address.split()),
        "footprints": lambda given_address: (
            call(*functions, cloud, "--footprints", given_address)
            + read_files(out)
            + read_files(log.parent)
        ),
        "cloud": lambda given_address: (
            call(*functions, cloud, given_address) + read_files(out) + read_files(log.parent)
        ),
        "terrain": lambda given_address: (
            call(*functions, cloud, "--terrain", given_address) + read_files(out)
        ),
        "overrides": lambda given_address: (
            call(*functions, cloud, f"--overrides={given_address}") + read_files(out)
        ),
        "evaluate": lambda given_address: (
            call("evaluate", str(run), given_address, "--out", str(out)) + read_files(out)
        ),
        "classify": lambda given_address: call(
            "classify", given_address, "--out", str(out / "c.laz")
        ),
        "check": lambda given_address: call("check", given_address),
        "wrong command": lambda given_address: call(given_address),
        "from Python": api,
    }


def find_leak(text: str) -> str:
    """Which part of a secret stands in a text, as it is or encoded; empty where none does."""
    for variant in (text, unquote(text), unquote(unquote(text))):
        for part in PARTS:
            for start in range(len(part) - 2):
                if part[start : start + 4].lower() in variant.lower():
                    return part[start : start + 4]
    return ""


def find_leaks(
    folder: Path, count: int, seed: int = 0, selection: int = 100
) -> Iterator[tuple[str, str, str]]:
    """Yield (way, address, what was said) of those of `count` addresses whose secret is repeated by
    some `chosen` ways.
    """
    write_sample_run(folder / "run")
    (folder / "cloud.xyz").write_text("".join(f"{x} {y} 5.0\n" for x in range(8) for y in range(8)))
    functions = list_ways(folder)
    for number in range(seed, seed + count):
        rng = random.Random(number)
        given_address = draw_address(rng)
        for way in rng.sample(sorted(functions), min(selection, len(functions))):
            masking.SECRETS = masking.Secrets()
            output = functions[way](given_address)
            for file in (folder / "log", *(folder / "out").rglob("*")):
                if file.is_file():
                    file.unlink()
            if find_leak(output):
                yield way, given_address, output
