"""A command that runs beside QGIS.

Its output is passed on, and it ends when the user cancels.
"""

import json
import os
import subprocess
import sys
import threading
import time

from . import commands

POLL_S, STATUS_S = 0.2, 3.0


class Failed(Exception):
    """The command ended in an error; the text is what it said."""


def run(command, say, cancelled, progress=None):
    """Run `command` to its end, passing each line of its output to `say`.

    Returns its exit code, 0 or 1 (some building failed).

    `cancelled()` is asked whether to stop it; `progress()` is called every few seconds. Raises
    Failed, with what it said last, for a command that cannot be started, is used wrongly (2) or was
    stopped.
    """
    try:
        process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            text=True,
            **make_environment(),
        )
    except OSError as error:
        raise Failed(
            f"expected the program hiproof, got: {error}; install it (pip install hiproof) and "
            "name it in the parameter Program"
        ) from error
    lines = []
    reader = threading.Thread(target=pass_lines, args=(process.stdout, say, lines), daemon=True)
    reader.start()
    asked_at = time.monotonic()
    while process.poll() is None:
        if cancelled():
            process.terminate()
            process.wait()
            raise Failed("stopped; what was finished is kept, and the same run goes on from there")
        if progress and time.monotonic() - asked_at > STATUS_S:
            progress()
            asked_at = time.monotonic()
        time.sleep(POLL_S)
    reader.join()
    process.stdout.close()
    if process.returncode not in (0, 1):
        raise Failed(
            "\n".join(lines[-3:]) or f"{command[0]} ended with exit code {process.returncode}"
        )
    return process.returncode


def pass_lines(lines, say, lines_kept):
    for line in lines:
        lines_kept.append(line.rstrip())
        say(lines_kept[-1])


def make_environment():
    """Return the environment of the command, without QGIS's own variables.

    They are for QGIS's Python, not for another's; on Windows no window is to open.
    """
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ("PYTHONHOME", "PYTHONPATH")
    }
    return {
        "env": environment,
        **({"creationflags": subprocess.CREATE_NO_WINDOW} if sys.platform == "win32" else {}),
    }


def measure_progress(program, folder):
    """Return the share of buildings done [%] of the run in `folder`.

    It is None while that is not known.
    """
    process = subprocess.run(
        commands.status(program, folder), capture_output=True, text=True, **make_environment()
    )
    try:
        buildings = json.loads(process.stdout)["buildings"]
    except (ValueError, KeyError):
        return None
    return 100.0 * buildings["done"] / buildings["total"] if buildings["total"] else None
