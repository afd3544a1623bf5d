"""The command line: one thin module a command, imported only when that command runs."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import takewhile

from ..early import INTERRUPTED, end_at_once_on_interrupt
from ..garbage import collect_rarely, leave_garbage

KEPT = (
    "interrupted; no file is left half written. What a run had finished is kept: the same command "
    "goes on from there"
)


def main() -> None:
    """Run `hiproof`, which collects garbage rarely from its first import on.

    Once all is done, Ctrl-C ends the command at once, without a traceback, and no garbage is
    collected any more.
    """
    with collect_rarely():
        try:
            run_command()
        finally:
            end_at_once_on_interrupt()
            leave_garbage()


def run_command() -> None:
    """Run the command of the arguments, and return its exit code.

    Errors meant for the user become one line and exit code 2, Ctrl-C exit code 130. An error of our
    own making shows its traceback, passwords masked as in all of the log, and ends with exit code
    1.
    """
    from .. import log
    from ..compiled import news
    from ..errors import HiproofError, is_interrupt
    from ..masking import remember
    from .app import app

    remember(*addresses_in(sys.argv[1:]))
    log.start()
    news.listener = news.Lines(log.LOGGER.warning)
    try:
        app()
    except HiproofError as error:
        log.LOGGER.error(error)
        sys.exit(2)
    except SystemExit as end:
        if end.code == INTERRUPTED:  # Ctrl-C
            log.LOGGER.error(KEPT)
        raise
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, KeyboardInterrupt) or is_interrupt(error):
            log.LOGGER.error(KEPT)
            sys.exit(INTERRUPTED)
        log.LOGGER.error("failed; please report this:", exc_info=True)
        sys.exit(1)


def addresses_in(arguments: list[str]) -> Iterator[str]:
    """Yield arguments that may be addresses.

    They are arguments, values of options, and addresses that blanks in a password have cut into
    several arguments.

    >>> list(addresses_in(["--prefix=a", "run", "password=S3", "cr3t"]))[3:]
    ['run password=S3 cr3t', 'password=S3', 'password=S3 cr3t', 'cr3t']
    """
    from ..masking import names_a_secret

    for index, argument in enumerate(arguments):
        yield argument
        if argument.startswith("--") and "=" in argument:
            yield argument.partition("=")[2]
        additions = list(takewhile(lambda other: not other.startswith("-"), arguments[index + 1 :]))
        is_cut = ":" in argument and any("@" in other for other in additions)
        if is_cut or names_a_secret(" ".join([argument, *additions[:1]])):
            yield " ".join([argument, *additions])
