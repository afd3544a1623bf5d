"""The folders of bundles, without what is in them, which only failures need (bundles.py)."""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

FAILURES_FOLDER, FACTS = "failures", "failure.json"
PLAIN_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,59}")
RESERVED_NAMES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)")  # Names of devices on Windows.


def folder_name(id: str) -> str:
    """Return a name for the bundle of building `id` on any file system.

    >>> folder_name("0363100012168777"), folder_name("../Town Hall")
    ('0363100012168777', 'town-hall-ea5e75b2')
    """
    if PLAIN_NAME.fullmatch(id) and not RESERVED_NAMES.fullmatch(id):
        return id
    digest = hashlib.sha256(id.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    words = re.sub(r"[^a-z0-9]+", "-", id.lower())[:40].strip("-")
    return f"{words}-{digest}" if words else f"building-{digest}"


def bundles_in(out: Path) -> list[Path]:
    """Return the bundles in the output folder of a run.

    Folders of others are left out.
    """
    return sorted(facts.parent for facts in (Path(out) / FAILURES_FOLDER).glob(f"[!.]*/{FACTS}"))


def remove_bundles(out: Path, failed_ids: Collection[str] = ()) -> None:
    """Remove all bundles but those of buildings that failed, and unfinished ones."""
    folder = Path(out) / FAILURES_FOLDER
    selection = {folder_name(id) for id in failed_ids}
    for bundle in bundles_in(out):
        if bundle.name not in selection:
            shutil.rmtree(bundle, ignore_errors=True)
    for unfinished in folder.glob(".*"):
        shutil.rmtree(unfinished, ignore_errors=True)
    with suppress(OSError):  # it is not there, or holds something
        folder.rmdir()
