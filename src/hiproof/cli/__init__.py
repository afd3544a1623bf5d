"""The command line: one thin module a command, imported only when that command runs."""

from __future__ import annotations

import sys

INTERRUPTED = 130  # exit code, as shells know it: 128 and the signal's number
KEPT = "interrupted; no file is left half written. What a run had finished is kept: the same command goes on from there"


def main() -> None:
    """Entry point of `hiproof`: errors meant for the user become one line and exit code 2, Ctrl-C exit code 130.

    An error of our own making shows its traceback, passwords masked as in all of the log, and ends with exit code 1.
    """
    from .. import log
    from ..compiled import news
    from ..errors import HiproofError, is_interrupt
    from .app import app

    log.start()
    news.listener = news.Lines(log.LOGGER.warning)
    try:
        app()
    except HiproofError as error:
        log.LOGGER.error(error)
        sys.exit(2)
    except SystemExit as end:
        if end.code == INTERRUPTED:  # Ctrl-C, of which typer says nothing
            log.LOGGER.error(KEPT)
        raise
    except Exception as error:
        if is_interrupt(error):
            log.LOGGER.error(KEPT)
            sys.exit(INTERRUPTED)
        log.LOGGER.error("failed; please report this:", exc_info=True)
        sys.exit(1)
