"""The few kinds of error hiproof raises; every message is one sentence: what was expected, what
came, what to try.

Passwords in addresses are masked where a message is made, so that none reaches a screen, a file or
another process.
"""

import traceback
from pathlib import Path
from typing import NamedTuple

from .masking import mask


class HiproofError(Exception):
    """Base of every error hiproof raises on purpose.

    Its text is meant for the user, without a traceback.
    """

    def __init__(self, message: str = ""):
        super().__init__(mask(str(message)))


class InputError(HiproofError):
    """A file or an array that cannot be used: unreadable, empty, of the wrong kind, without the
    classes asked for.
    """


class DamagedRaster(InputError):
    """A terrain model of which a part cannot be read: every building on it needs it, so the run
    ends.
    """


class NoModelError(InputError):
    """A model asked for of a building that got none;

    `Building.built` is None there, and the status says why.
    """


class SettingsError(HiproofError):
    """A setting that is unknown, of the wrong type or out of its bounds."""


class OutputError(HiproofError):
    """A place that cannot be written: no permission, no space, not a folder."""


class FitError(HiproofError):
    """Points from which no roof can be determined (fewer than a plane needs, all in one place, not
    finite).
    """


class CompositionError(HiproofError):
    """A roof that cannot become a valid solid; the caller falls back to a simpler roof.

    `parts` are the numbers of the roof parts whose faces are at fault, empty where that is not
    known.
    """

    parts: tuple[int, ...] = ()


def is_interrupt(error: BaseException) -> bool:
    """Whether `error` is a Ctrl-C in disguise: of one that comes while compiled code runs Python
    makes a SystemError, or several one of the other, and of one that comes in an import a package
    may make an ImportError. What catches an `Exception` would take these for a failure.
    """
    cause: BaseException | None = error
    while isinstance(cause, (SystemError, ImportError)):
        cause = cause.__cause__
    return isinstance(cause, KeyboardInterrupt)


class ErrorReport(NamedTuple):
    """What is kept of an unexpected error: one line with its place in the code, and the
    traceback.
    """

    detail: str
    trace: str


def report_error(error: Exception) -> ErrorReport:
    """Describe an error that one building or one place has alone.

    MemoryError and Ctrl-C are raised again: they are not the fault of the building.
    """
    if isinstance(error, MemoryError):
        raise error
    if is_interrupt(error):
        raise KeyboardInterrupt from error
    place = traceback.extract_tb(error.__traceback__)[-1]
    detail = f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
    return ErrorReport(detail, "".join(traceback.format_exception(error)))


class HiproofWarning(UserWarning):
    """Base of the warnings: what was put right on the way, in one sentence."""

    def __init__(self, message: str = ""):
        super().__init__(mask(str(message)))


class InputWarning(HiproofWarning):
    """Input that was used after putting something right (points dropped, a CRS assumed); it says
    what and how much.
    """


class OutputWarning(HiproofWarning):
    """Output that was found other than it was left, and what is done about it."""


class NotKeptWarning(HiproofWarning):
    """Compiled functions cannot be kept, so that every process compiles them again; it says what to
    do.
    """
