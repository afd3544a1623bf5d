"""The kinds of error that hiproof raises.

Every message is one sentence: what was expected, what came, what to try.

Passwords in addresses are masked where a message is made, so that none reaches a screen, a file or
another process.
"""

import errno
import os
import re
import traceback
import warnings
from pathlib import Path
from typing import NamedTuple

from .masking import mask


class HiproofError(Exception):
    """Base of every error hiproof raises on purpose, a text for the user without traceback."""

    def __init__(self, message: str = ""):
        super().__init__(escape_unseen(mask(put_plainly(str(message)))))


# Characters that a terminal or a page obeys in place of showing them: controls, and marks of the
# direction of writing.
UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def escape_unseen(text: str) -> str:
    r"""Return a text that shows what a terminal or a page would obey.

    >>> print(escape_unseen("house-\u202e1\x1b[31m"))
    house-\u202e1\x1b[31m
    """
    return UNSEEN.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


OS_ERROR = re.compile(r"\[(?:Errno|WinError) (-?\d+)\] ([^:\n;]+)(?:: '[^']*')?")
"""What Python says of a path that cannot be used; the sentence around it names the path."""

WORDS_OF_OS = {
    errno.ENOENT: "no such file",
    errno.EISDIR: "a folder",
    errno.ENOTDIR: "a file in place of a folder",
}


NO_TEXT = re.compile(r"'[\w-]+' codec can't decode bytes? [^:]*: [\w ]+")


def put_plainly(text: str) -> str:
    """Return a text in which what Python says of files and their bytes is put in words.

    >>> put_plainly("expected settings, got: [Errno 21] Is a directory: 'a.toml'; name a file")
    'expected settings, got: a folder; name a file'
    """

    def name(found: re.Match[str]) -> str:
        return WORDS_OF_OS.get(int(found[1]), found[2][0].lower() + found[2][1:])

    return NO_TEXT.sub("bytes that are no text", OS_ERROR.sub(name, text))


def explain_fault(path: str | os.PathLike[str]) -> str:
    """Return why no program can read a file of this machine, "" where nothing tells.

    >>> explain_fault("nowhere/at.all")
    'no such file'
    """
    try:
        with open(path, "rb") as file:
            return "" if file.read(1) else "an empty file"
    except OSError as error:
        return put_plainly(str(error))


class InputError(HiproofError):
    """A file or an array that cannot be used.

    It is unreadable, empty, of the wrong kind, or without the requested classes.
    """


class DamagedRaster(InputError):
    """A terrain model of which a part is unreadable; the run ends, as buildings need it."""


class NoModelError(InputError):
    """A model was requested where there is none (`Building.built` is None); see the status."""


class SettingsError(HiproofError):
    """A setting that is unknown, of the wrong type or out of its bounds."""


class OutputError(HiproofError):
    """A place that cannot be written: no permission, no space, not a folder."""


class FitError(HiproofError):
    """Points that determine no roof: too few for a plane, all in one place, or not finite."""


class CompositionError(HiproofError):
    """A roof that cannot become a valid solid.

    The caller falls back to a simpler roof. `parts` are the numbers of the roof parts whose faces
    are at fault, empty where that is not known.
    """

    parts: tuple[int, ...] = ()


def is_interrupt(error: BaseException) -> bool:
    """Return whether `error` is a Ctrl-C in disguise.

    One that comes while compiled code runs Python becomes a SystemError, or several one of the
    other, and one that comes in an import a package may turn into an ImportError. What catches an
    `Exception` would take these for a failure.
    """
    cause: BaseException | None = error
    while isinstance(cause, (SystemError, ImportError)):
        cause = cause.__cause__
    return isinstance(cause, KeyboardInterrupt)


def raise_interrupt(error: BaseException) -> None:
    """Raise a Ctrl-C in disguise as what it is."""
    if is_interrupt(error):
        raise KeyboardInterrupt from error


class ErrorReport(NamedTuple):
    """The record of an unexpected error: one line with its place in the code, the traceback."""

    detail: str
    trace: str


def report_error(error: Exception) -> ErrorReport:
    """Describe one building's own error; MemoryError and Ctrl-C, which are not, are raised."""
    if isinstance(error, MemoryError):
        raise error
    raise_interrupt(error)
    place = traceback.extract_tb(error.__traceback__)[-1]
    detail = f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
    return ErrorReport(detail, "".join(traceback.format_exception(error)))


class HiproofWarning(UserWarning):
    """Base of the warnings: what was put right on the way, in one sentence."""

    def __init__(self, message: str = ""):
        super().__init__(escape_unseen(mask(str(message))))


class InputWarning(HiproofWarning):
    """Input that was used after a correction, such as points dropped; says what and how much."""


def warn(source: object, text: str) -> None:
    """Warn (InputWarning) of what was found in a `source`, a file or what else was read."""
    warnings.warn(f"{source}: {text}", InputWarning, stacklevel=2)


class OutputWarning(HiproofWarning):
    """Output that was found other than it was left, and what is done about it."""


class NotKeptWarning(HiproofWarning):
    """Compiled functions cannot be kept, so every process compiles them; says what to do."""
