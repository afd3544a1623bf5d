"""`hiproof status`: how far a run is, read from its ledger while the run may still be writing it."""

from __future__ import annotations

from pathlib import Path

from ..city.ledger import Ledger
from ..errors import InputError


def run(folder: Path) -> int:
    path = folder / ".hiproof" / "ledger.sqlite"
    if not path.is_file():
        raise InputError(f"expected the output folder of a run, got {folder}, which has no ledger; check the path")
    ledger = Ledger(path, read_only=True)
    for line in describe(ledger):
        print(line)
    return 0


def describe(ledger: Ledger) -> list[str]:
    """Progress, failures by kind, throughput and time left, a line each."""
    tasks = ledger.tasks()
    lines = []
    for kind, what in (("sort", "point files read"), ("solve", "work tiles solved")):
        rows = [row for row in tasks if row[1] == kind]
        lines.append(f"{what}: {sum(row[3] != 'open' for row in rows)} of {len(rows)}")
    solve = [row for row in tasks if row[1] == "solve"]
    total, done = sum(row[2] for row in solve), [row for row in solve if row[3] != "open"]
    finished = sum(row[2] for row in done)
    lines.append(f"buildings done: {finished} of {total}")
    times = sorted(row[6] for row in done)
    if len(times) > 1 and times[-1] > times[0]:
        rate = (finished - done[0][2]) / (times[-1] - times[0])
        left = f", about {(total - finished) / rate:.0f} s left" if finished < total and rate else ""
        lines.append(f"throughput: {rate:.1f} buildings a second{left}")
    lines += [f"{number} {status}" for status, number in ledger.counts("status").items()]
    lines += [f"failed: {row[0]}: {row[5]}" for row in tasks if row[3] == "failed"]
    lines += [f"internal error: building {id}: {detail}" for id, detail in ledger.failures()]
    lines.append("finished" if ledger.get("merged") == "yes" else "not finished: the same command goes on")
    return lines
