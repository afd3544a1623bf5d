"""Count lines, compiled functions and numeric constants of the search.

usage: python -m benchmarks.search_size [--folder fit/union] [--files]

A constant is a number in an assignment at the top of a module: `NEAR_M, TURNS = 0.2, (1, 2)` holds
three. `--folder` names another folder of the package, `--files` prints a row a file.
"""

from __future__ import annotations

import argparse
import ast
from pathlib import Path

import hiproof

PACKAGE = Path(hiproof.__file__).parent


def count_constants(text: str) -> int:
    """Count the numbers in assignments at the top of a module's text.

    >>> text = "NEAR_M, TURNS = 0.2, (1, -2)\\nNAMES = ('a',)\\ndef f(x=3):\\n    y = 4\\n"
    >>> count_constants(text)
    3
    """
    statements = [s for s in ast.parse(text).body if isinstance(s, ast.Assign | ast.AnnAssign)]
    nodes = [node for statement in statements for node in ast.walk(statement)]
    values = [node.value for node in nodes if isinstance(node, ast.Constant)]
    return sum(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def count_compiled(text: str) -> int:
    """Count the functions at the top of a module that are compiled.

    >>> count_compiled("@compiled\\ndef f(): ...\\n\\ndef g(): ...\\n")
    1
    """
    functions = [s for s in ast.parse(text).body if isinstance(s, ast.FunctionDef)]
    decorators = [" ".join(map(ast.unparse, function.decorator_list)) for function in functions]
    return sum("compiled" in text for text in decorators)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--folder", default="fit/union", help="below the package's own")
    parser.add_argument("--files", action="store_true", help="print a row a file")
    arguments = parser.parse_args()
    total = [0, 0, 0]
    for path in sorted((PACKAGE / arguments.folder).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        row = [len(text.splitlines()), count_compiled(text), count_constants(text)]
        total = [sum(totals) for totals in zip(total, row, strict=True)]
        if arguments.files:
            print(f"{row[0]:5d} lines {row[1]:3d} compiled {row[2]:3d} constants  {path.name}")
    lines, functions, constants = total
    print(f"{arguments.folder}: {lines} lines, {functions} compiled functions, {constants} numbers")


if __name__ == "__main__":
    main()
