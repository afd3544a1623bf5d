"""The command line: one thin module a command, imported only when that command runs."""

from __future__ import annotations

import sys
import traceback

INTERRUPTED = 130


def main() -> None:
    """Entry point of `hiproof`: errors meant for the user become one line and exit code 2, Ctrl-C exit code 130.

    An error of our own making shows its traceback, passwords masked like everywhere, and ends with exit code 1.
    """
    from ..compiled import news
    from ..errors import HiproofError, warn_in_sentences
    from ..masking import masked
    from .app import app

    warn_in_sentences()
    news.listener = news.Lines(lambda text: print(f"hiproof: {text}", file=sys.stderr, flush=True))
    try:
        app()
    except HiproofError as error:
        print(f"hiproof: {error}", file=sys.stderr)
        sys.exit(2)
    except SystemExit as end:
        if end.code == INTERRUPTED:  # Ctrl-C, of which typer says nothing
            print(
                "hiproof: interrupted; no file is left half written. What a run had finished is kept: the same command "
                "goes on from there",
                file=sys.stderr,
            )
        raise
    except Exception:
        print(masked(traceback.format_exc()), end="", file=sys.stderr)
        sys.exit(1)
