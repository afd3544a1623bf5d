"""The effect of a named number on Delft's even footprints.

They are run with half of it, with it, and with twice of it.

usage: python -m benchmarks.constants hiproof.fit.union.prices.CORNER_COST [--shares 1 0.25]
[--factors 0.5 1 2]

The package is copied, the number changed in the copy's text, and `benchmarks.delft --parity even`
run on that copy: so numbers that are compiled into functions count like all others. What was
compiled from the changed file is compiled again, minutes for a number of the search. Each row is
one of `benchmarks.delft`; a number that changes no row does nothing on Delft.
"""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import hiproof

from .tables import make_parser

PACKAGE, ROOT = Path(hiproof.__file__).parent, Path(__file__).parents[1]
PARITY = "even"  # of footprints' ids: on these constants are chosen, on the odd ones reported


def find_value(text: str, name: str) -> ast.Constant:
    """Find where the number `name` stands in a module's text, or exit with a sentence."""
    for statement in ast.parse(text).body:
        if isinstance(statement, ast.Assign):
            target, value = statement.targets[0], statement.value
            is_pair = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
            names, values = (target.elts, value.elts) if is_pair else ([target], [value])
            for target_name, number in zip(names, values, strict=True):
                if (
                    isinstance(target_name, ast.Name)
                    and target_name.id == name
                    and isinstance(number, ast.Constant)
                ):
                    return number
    sys.exit(
        f"expected a number that a module names by itself, such as TILE_M = 250.0, got {name}; the "
        "page of constants lists them"
    )


def change_value(text: str, name: str, factor: float) -> str:
    """Multiply the number `name` in a module's text by `factor`.

    It stays whole where it is whole.

    >>> change_value("A, MOST = 1.5, 7  # of all\\n", "MOST", 0.5)
    'A, MOST = 1.5, 4  # of all\\n'
    """
    number = find_value(text, name)
    new = type(number.value)(
        round(number.value * factor) if isinstance(number.value, int) else number.value * factor
    )
    lines = text.splitlines(keepends=True)
    line = lines[number.lineno - 1].encode()  # columns are counted in bytes
    lines[number.lineno - 1] = (
        line[: number.col_offset] + repr(new).encode() + line[number.end_col_offset :]
    ).decode()
    return "".join(lines)


def measure_rows(module: Path, name: str, factor: float, shares: list[str]) -> str:
    """Return the output of `benchmarks.delft` on a copy with a changed number."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "hiproof"
        shutil.copytree(PACKAGE, copy)  # what is compiled goes along, and is used where it holds
        file = copy / module
        file.write_text(change_value(file.read_text("utf-8"), name, factor), encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "benchmarks.delft",
            "--parity",
            PARITY,
            "--shares",
            *shares,
        ]
        path = os.pathsep.join([folder, *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {**os.environ, "PYTHONPATH": path}
        process = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
        )
        return process.stdout or process.stderr


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("name", help="such as hiproof.fit.union.prices.CORNER_COST")
    parser.add_argument("--shares", nargs="+", default=["1", "0.25"], help="of the points")
    parser.add_argument("--factors", nargs="+", type=float, default=[0.5, 1.0, 2.0])
    a = parser.parse_args()
    place, _, name = a.name.removeprefix("hiproof.").rpartition(".")
    module = Path(*place.split(".")).with_suffix(".py")
    module = module if (PACKAGE / module).is_file() else module.with_suffix("") / "__init__.py"
    if not (PACKAGE / module).is_file():
        sys.exit(f"expected a module of hiproof and a name in it, got {a.name}; see the constants")
    value = find_value((PACKAGE / module).read_text(encoding="utf-8"), name).value
    for factor in a.factors:
        rows = measure_rows(module, name, factor, a.shares)
        print(f"{name} = {value!r} times {factor:g}:\n{rows}", flush=True)


if __name__ == "__main__":
    main()
