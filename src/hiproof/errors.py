"""The kinds of error that hiproof raises.

Every message is one sentence: what was expected, what came, what to try.

Passwords in addresses are masked where a message is made, so that none reaches a screen, a file or
another process.
"""

import traceback
import warnings
from pathlib import Path
from typing import NamedTuple

from .masking import mask


class HiproofError(Exception):
    """Base of every error hiproof raises on purpose, a text for the user without traceback."""

    def __init__(self, message: str = ""):
        super().__init__(mask(str(message)))


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
        super().__init__(mask(str(message)))


class InputWarning(HiproofWarning):
    """Input that was used after a correction, such as points dropped; says what and how much."""


def warn(source: object, text: str) -> None:
    """Warn (InputWarning) of what was found in a `source`, a file or what else was read."""
    warnings.warn(f"{source}: {text}", InputWarning, stacklevel=2)


class OutputWarning(HiproofWarning):
    """Output that was found other than it was left, and what is done about it."""


class NotKeptWarning(HiproofWarning):
    """Compiled functions cannot be kept, so every process compiles them; says what to do."""
