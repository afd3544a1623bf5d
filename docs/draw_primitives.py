"""Draw the figures of docs/primitives.md: one a roof type, with its parameters.

python docs/draw_primitives.py
"""

from pathlib import Path

from hiproof.draw.primitives import primitive_svg
from hiproof.parametric.shape import names_of
from hiproof.primitives import CATALOGUE

FOLDER = Path(__file__).parent / "primitives"

HEAD = """# Roof types and their parameters

Drawn by `docs/draw_primitives.py` from the shapes themselves. Lengths are metres, pitches degrees; heights count from the lowest eave.
The front is the side before a roof's length, its back behind it; left and right are the ends, seen from the front. An end that slopes
at one side only is the right one, a single slope rises from the front; `end_height` is how high a corner's end would come at the left.

A gable whose ridge lies off the middle has a `ridge_offset` too (m, towards the back). A roof that is less regular than its type has
each side's own: `pitch_front`, `eave_front` and so on in place of the lengths below, with `height` of a level top.
"""


def document() -> str:
    """docs/primitives.md."""
    sections = [
        f"## {name}\n\n{', '.join(f'`{p}`' for p in names_of(name))}\n\n![{name}](primitives/{name}.svg)\n"
        for name in CATALOGUE
    ]
    return "\n".join([HEAD, *sections])


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for name in CATALOGUE:
        (FOLDER / f"{name}.svg").write_text(primitive_svg(name))
    (FOLDER.parent / "primitives.md").write_text(document())


if __name__ == "__main__":
    main()
