"""Code of the command that runs before everything else is imported.

Ctrl-C ends it at once, for nothing is begun that could be left half done.

Python would show a traceback of whatever import it came in, and some packages make other errors of
it.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from typing import Any

INTERRUPTED = 130  # exit code, as shells know it: 128 and the signal's number


def end_at_once(*_: Any) -> None:
    os._exit(INTERRUPTED)


def is_command() -> bool:
    """Return whether this is the command `hiproof`, or `python -m hiproof`, not an importer."""
    started = os.path.basename(sys.argv[0]) if sys.argv else ""
    return started.removesuffix(".exe") == "hiproof" or (
        started == "-m" and "hiproof" in sys.orig_argv
    )


IS_COMMAND = is_command()  # now, for `python -m` changes sys.argv once packages are imported


def end_at_once_on_interrupt() -> None:
    """Let Ctrl-C, unless ignored, end the command at once, until `interrupt_as_usual`."""
    is_main = threading.current_thread() is threading.main_thread()
    if IS_COMMAND and is_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, end_at_once)


def interrupt_as_usual() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is end_at_once:
        signal.signal(signal.SIGINT, signal.default_int_handler)


end_at_once_on_interrupt()
