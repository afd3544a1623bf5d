"""Run the notebook of examples/ cell by cell, and store its outputs in it.

python docs/run_notebook.py [NOTEBOOK]

Needs matplotlib, but neither Jupyter nor a kernel: the last value of a cell is its result, as text
and as the HTML that it offers, and a figure that a cell draws is stored as a picture.
"""

from __future__ import annotations

import ast
import base64
import io
import json
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

NOTEBOOK = Path(__file__).resolve().parents[1] / "examples/edit_a_building.ipynb"
DOTS_AN_INCH = 60  # of a stored figure: sharp enough on a page, and small in the repository


def run_cell(source: str, names: dict[str, Any]) -> tuple[str, Any]:
    """Run a cell in a namespace, and return its printed text and its last value."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with redirect_stdout(printed):
        exec(compile(tree, "cell", "exec"), names)
        value = eval(ast.unparse(last), names) if last else None
    return printed.getvalue(), value


def draw_figures() -> list[str]:
    """Return all open figures of matplotlib as PNG in Base64, and close them."""
    import matplotlib.pyplot as plt

    pictures = []
    for number in plt.get_fignums():
        file = io.BytesIO()
        plt.figure(number).savefig(file, format="png", dpi=DOTS_AN_INCH, metadata={"Software": ""})
        pictures.append(base64.b64encode(file.getvalue()).decode())
    plt.close("all")
    return pictures


def make_outputs(printed: str, value: Any, pictures: list[str], number: int) -> list[dict]:
    """Return the outputs of a cell in the notebook format 4."""
    outputs: list[dict[str, Any]] = []
    if printed:
        outputs.append(
            {"name": "stdout", "output_type": "stream", "text": printed.splitlines(keepends=True)}
        )
    if value is not None:
        render = getattr(value, "_repr_html_", None)
        text = f"<{type(value).__module__}.{type(value).__qualname__}>" if render else repr(value)
        data = {"text/plain": [text]} | ({"text/html": [render()]} if render else {})
        outputs.append(
            {
                "data": data,
                "execution_count": number,
                "metadata": {},
                "output_type": "execute_result",
            }
        )
    for picture in pictures:
        data = {"image/png": picture}
        outputs.append({"data": data, "metadata": {}, "output_type": "display_data"})
    return outputs


def run_notebook(notebook: dict[str, Any]) -> dict[str, Any]:
    """Run all code cells in order, store their outputs, and return their namespace."""
    names: dict[str, Any] = {}
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for number, cell in enumerate(cells, 1):
        printed, value = run_cell("".join(cell["source"]), names)
        cell["execution_count"] = number
        cell["outputs"] = make_outputs(printed, value, draw_figures(), number)
    return names


def main(path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    notebook = json.loads(path.read_text(encoding="utf-8"))
    run_notebook(notebook)
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else NOTEBOOK)
