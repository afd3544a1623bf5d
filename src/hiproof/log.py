"""The program's messages: standard logging under the name `hiproof`.

Warnings are among them, and secrets are masked.

The library logs and leaves it to its user what becomes of that; the command line shows warnings and
errors on standard error, and with `--log-file` keeps everything from progress on, with time and
process, in a file. Worker processes of this machine write to the same places; those of a Dask
cluster to Dask's own logs.
"""

from __future__ import annotations

import logging
import sys
import warnings
from contextlib import suppress
from enum import StrEnum
from pathlib import Path

from .errors import HiproofWarning, OutputError, escape_unseen
from .masking import mask

LOGGER = logging.getLogger("hiproof")
FILE_FORMAT = "%(asctime)s %(levelname)s %(process)d %(message)s"


class Level(StrEnum):
    """What of the log is shown: that of this level and above."""

    debug = "debug"
    info = "info"
    warning = "warning"
    error = "error"

    @property
    def number(self) -> int:
        return getattr(logging, self.name.upper())


def count_things(number: int, item: str, many: str = "") -> str:
    """Return a number of things in words.

    `many` is their plural where that is not `item` with an s.

    >>> count_things(1, "building"), count_things(2000, "vertex", "vertices")
    ('1 building', '2,000 vertices')
    """
    return f"{number:,} {item if number == 1 else many or item + 's'}"


class Masking(logging.Formatter):
    """Formats a record, tracebacks too: without passwords, and with no control characters."""

    def format(self, record: logging.LogRecord) -> str:
        return escape_unseen(mask(super().format(record)))


class Console(logging.Handler):
    """Standard error at the time of each record, which a progress bar may have replaced."""

    def emit(self, record: logging.LogRecord) -> None:
        print(self.format(record), file=sys.stderr, flush=True)


class Elsewhere(logging.Handler):
    """Messages of other packages: shown for `debug`, never straight on standard error."""

    def emit(self, record: logging.LogRecord) -> None:
        if not record.name.startswith(LOGGER.name):
            LOGGER.debug("%s: %s", record.name, record.getMessage())


class KeptFile(logging.FileHandler):
    """A log file that may fill its disk: the work then goes on without it, logged once."""

    def handleError(self, record: logging.LogRecord) -> None:
        error = sys.exc_info()[1]
        if not isinstance(error, OSError):
            return super().handleError(record)
        LOGGER.removeHandler(self)
        with suppress(OSError):
            self.close()
        from multiprocessing import parent_process

        if parent_process() is None:  # of the processes that write to the file, the first tells
            text = f"{error.strerror or error}; the work goes on without the log"
            LOGGER.warning("expected to write the log to %s, got: %s", self.baseFilename, text)


def start(level: Level = Level.warning, file: Path | None = None) -> None:
    """Start the log, on standard error and in a file.

    `level` and above go to standard error, `info` and above (`debug`, if that is the level) to the
    end of `file`. What was started before ends. Raises OutputError where the file cannot be
    written.
    """
    handlers: list[logging.Handler] = [
        make_handler(Console(), "hiproof: %(message)s", level.number)
    ]
    if file is not None:
        try:
            Path(file).parent.mkdir(parents=True, exist_ok=True)
            selection = KeptFile(file, encoding="utf-8")
        except OSError as error:
            raise OutputError(
                f"expected a --log-file that can be written, got {file}: {error}; name another"
            ) from error
        handlers.append(make_handler(selection, FILE_FORMAT, min(level.number, logging.INFO)))
    for previous in LOGGER.handlers[:]:
        LOGGER.removeHandler(previous)
        previous.close()
    for handler in handlers:
        LOGGER.addHandler(handler)
    LOGGER.setLevel(min(handler.level for handler in handlers))
    root = logging.getLogger()
    if not any(isinstance(handler, Elsewhere) for handler in root.handlers):
        root.addHandler(Elsewhere())
    warnings.showwarning = log_warning


def make_handler(handler: logging.Handler, form: str, level: int) -> logging.Handler:
    handler.setFormatter(Masking(form))
    handler.setLevel(level)
    return handler


def console_level() -> Level:
    """Return the level from which the log is shown, warning where nothing was started."""
    console = find_console()
    return Level.warning if console is None else Level(logging.getLevelName(console.level).lower())


def find_console() -> Console | None:
    return next((handler for handler in LOGGER.handlers if isinstance(handler, Console)), None)


def worker_arguments() -> tuple:
    """Return the arguments of `start` for a worker to log as this process does, or none."""
    if find_console() is None:
        return ()
    file = next(
        (
            Path(handler.baseFilename)
            for handler in LOGGER.handlers
            if hasattr(handler, "baseFilename")
        ),
        None,
    )
    return console_level(), file


def log_warning(
    message: Warning | str,
    category: type,
    filename: str,
    lineno: int,
    file: object = None,
    line: str | None = None,
) -> None:
    """Log a warning as users read it, without its source; others' packages' for `debug`."""
    level = logging.WARNING if issubclass(category, HiproofWarning) else logging.DEBUG
    LOGGER.log(level, " ".join(str(message).split()))
