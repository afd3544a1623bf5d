"""Files that appear whole or not at all: written beside their place, synced, then renamed.

Whatever goes wrong on the way (an exception, Ctrl-C, a full disk), the half-written file is removed
and a file that stood there before keeps its content. What the file system refuses becomes an
OutputError, a full sentence for the user; errors of the caller's own code pass through unchanged.

A file that stands for an input, or for a file of a run, is refused.
"""

from __future__ import annotations

import errno
import io
import os
import platform
import re
import secrets
import shutil
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from ..errors import OutputError
from ..formats import FORMATS

EDQUOT = getattr(errno, "EDQUOT", -1)  # Windows has none
ADVICE = {
    errno.ENOSPC: "the disk is full; free some space or choose another --out folder",
    EDQUOT: "your disk quota is used up; free some space or choose another --out folder",
    errno.EFBIG: "the file grew beyond the size allowed here; raise the limit (ulimit -f) or write "
    "fewer buildings",
    **dict.fromkeys(
        (errno.EACCES, errno.EPERM), "permission denied; choose a folder you may write to"
    ),
    errno.EROFS: "the file system is read-only; choose another folder",
    **dict.fromkeys(
        (errno.ENOTDIR, errno.EEXIST),
        "a part of this path is a file, not a folder; choose another path",
    ),
    errno.EISDIR: "a folder of this name is in the way; choose another file name",
    errno.ENAMETOOLONG: "the name is too long for this file system; choose a shorter one",
}

# Reading never fails so: in a block that writes, these are errors of writing whatever file they
# name.
ONLY_WRITING = (errno.ENOSPC, EDQUOT, errno.EFBIG, errno.EROFS)


def output_error(path: str | os.PathLike, error: OSError) -> OutputError:
    """Return the error for `error`, met while writing `path`.

    >>> str(output_error("out/a.gml", OSError(errno.ENOSPC, "No space left on device")))[:50]
    'expected to write out/a.gml, but the disk is full;'
    """
    advice = ADVICE.get(
        error.errno or 0, f"got: {error}; check the path, the permissions and the space left"
    )
    return OutputError(f"expected to write {os.fspath(path)}, but {advice}")


@contextmanager
def suggest_elsewhere(command: str, chosen: Path | None) -> Iterator[None]:
    """Add the `command` that writes elsewhere to an error, unless its place was `chosen`."""
    try:
        yield
    except OutputError as error:
        if chosen is not None:
            raise
        raise OutputError(f"{error}. Write elsewhere with `{command}`") from error


class OutputFile(io.FileIO):
    """A raw file for exclusive writing and reading back; failing writes raise OutputError."""

    def __init__(self, hidden: Path, path: Path):
        self.path = path
        super().__init__(hidden, "x+")

    def write(self, data) -> int:
        try:
            return super().write(data)
        except OSError as error:
            raise output_error(self.path, error) from error


@contextmanager
def atomic(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a free hidden path beside `path`, which becomes `path`.

    It becomes so when the block ends well, and is removed when not. The parent folder is made if
    missing. Raises OutputError where the place cannot be written, before the block is entered if
    that can be known, and for the block's own errors when they come from writing the hidden file.

    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> with atomic(folder / "a.txt") as beside:
    ...     _ = beside.write_text("whole")
    ...     (folder / "a.txt").exists()
    False
    >>> [file.name for file in folder.iterdir()]
    ['a.txt']
    """
    # A link is followed, so that its target is replaced and not the link.
    path = Path(os.path.realpath(path))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        is_special = path.exists() and not path.is_file()
    except OSError as error:
        raise output_error(path, error) from error
    if is_special:
        raise OutputError(
            f"expected a file to write, got {path}, a device or a pipe; choose another name"
        )
    hidden = hidden_name(path)
    try:
        yield hidden
        sync(hidden)
        os.replace(hidden, path)
        sync(path.parent)
    except OSError as error:
        if error.errno in ONLY_WRITING or str(hidden) in (
            str(error.filename),
            str(error.filename2),
        ):
            raise output_error(path, error) from error
        raise
    finally:
        # After a good end the hidden name is gone; SQLite leaves journals beside it after a bad
        # one.
        for leftover in (
            hidden,
            *(hidden.with_name(hidden.name + end) for end in ("-journal", "-wal", "-shm")),
        ):
            remove(leftover)


@contextmanager
def atomic_file(path: str | os.PathLike) -> Iterator[BinaryIO]:
    """Yield a buffered, seekable binary file that becomes `path` at a good end; see `atomic`."""
    with atomic(path) as hidden, open_hidden(hidden, Path(path)) as file:
        yield file


def save_text(path: str | os.PathLike, text: str) -> None:
    """Write a text file, whole or not at all; see `atomic`."""
    with atomic(path) as hidden:
        hidden.write_text(text, encoding="utf-8")


@contextmanager
def scratch(path: str | os.PathLike) -> Iterator[BinaryIO]:
    """Yield a binary file beside `path` for the block; a full disk raises OutputError."""
    hidden = hidden_name(Path(os.path.realpath(path)))
    try:
        with open_hidden(hidden, Path(path)) as file:
            yield file
    finally:
        remove(hidden)


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yield a hidden folder that replaces `folder` when the block ends well, or is removed."""
    name = hidden_name(folder)
    older = name.with_name(name.name + "-older")
    try:
        name.mkdir(parents=True)
        yield name
        if folder.exists():
            folder.rename(older)
        name.rename(folder)
    except OSError as error:
        raise output_error(folder, error) from error
    finally:
        for remainder in (name, older):
            remove(remainder)


@contextmanager
def open_hidden(hidden: Path, path: Path) -> Iterator[BinaryIO]:
    """Yield a buffered file at `hidden`, whose errors speak of `path`."""
    try:
        raw = OutputFile(hidden, path)
    except OSError as error:
        raise output_error(path, error) from error
    file = io.BufferedRandom(raw, 1 << 16)
    try:
        yield file
        file.flush()
    finally:
        # Closing the raw file drops what is still buffered after a failure instead of failing
        # again.
        raw.close()


def remove(path: Path) -> None:
    """Remove a file or folder if it can be: the error before this one is to be reported."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
        return
    with suppress(OSError):
        path.unlink(missing_ok=True)


def hidden_name(path: Path) -> Path:
    """Return a free hidden name beside `path`, and remove what killed processes left there."""
    start = f".{path.name[:40]}-{zlib.crc32(platform.node().encode()):08x}-"
    pattern = re.compile(re.escape(start) + r"(\d+)-[0-9a-f]{8}\b")
    with suppress(OSError), os.scandir(path.parent) as entries:
        for entry in entries:
            if (match := pattern.match(entry.name)) and not is_running(int(match[1])):
                remove(Path(entry.path))
    return path.with_name(f"{start}{os.getpid()}-{secrets.token_hex(4)}{path.suffix}")


def is_running(process: int) -> bool:
    """Return whether a process of this machine runs, or may run."""
    if os.name != "posix":  # signal 0 ends processes elsewhere
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def sync(path: Path) -> None:
    """Sync a file or folder; not all systems open folders, and Windows no read-only files."""
    try:
        descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    except PermissionError:
        return
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


STATE_FOLDER = ".hiproof"  # in the output folder of a run: what it resumes from
RUN_RECORD = "run.json"  # what every run keeps beside its models
PARAMETERS = FORMATS["parameters"].file
# Files of a run's folder that no other command makes again.
OWN_FILES = frozenset(
    [format.file for format in FORMATS.values() if format.fragment]
    + [RUN_RECORD, "changes.csv", "changes.gpkg", "edits.jsonl"]
)


def refuse_overwriting(outputs: Iterable[Path], inputs: Iterable[Any]) -> None:
    """Raise OutputError where an output is one of `inputs`, or lies in a run's own state.

    Folders, addresses and None are no inputs.
    """
    files = [Path(str(path)) for path in inputs if path and is_file(str(path))]
    for out in map(Path, outputs):
        if STATE_FOLDER in Path(os.path.realpath(out)).parts:
            raise OutputError(
                f"expected a place outside {STATE_FOLDER}, where a run keeps its state, got {out}; "
                "choose another"
            )
        if out.exists() and any(out.samefile(file) for file in files):
            raise OutputError(
                f"expected another file to write than the one that is read, got {out} for both; "
                "name a new one"
            )


def refuse_replacing(outputs: Sequence[Path], inputs: Iterable[Any]) -> None:
    """Raise OutputError where an output is a run's own file, too; see `refuse_overwriting`."""
    refuse_overwriting(outputs, inputs)
    for out in outputs:
        path = Path(os.path.realpath(out))
        is_own = path.name in OWN_FILES and path.with_name(RUN_RECORD).exists()
        if path.is_file() and (is_own or path.name == PARAMETERS):
            raise OutputError(
                f"expected a new file to write, got {out}, which is a file of a run; choose "
                "another name"
            )


def is_file(path: str) -> bool:
    with suppress(OSError, ValueError):  # an address may be too long for a path
        return Path(path).is_file()
    return False
