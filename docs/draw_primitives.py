"""Draw the figures of docs/primitives.md: one a roof type, with its parameters.

python docs/draw_primitives.py
"""

from pathlib import Path

from hiproof.draw.primitives import primitive_svg
from hiproof.primitives import CATALOGUE
from hiproof.primitives.parameters import list_parameters

FOLDER = Path(__file__).parent / "primitives"

HEAD = """# Roof types and their parameters

`docs/draw_primitives.py` draws these figures from the shapes themselves.

- The report, `hiproof view` and `hiproof evaluate` name types in words; files have the names of the
  headings.
- Lengths are in metres and pitches in degrees. Heights count from the lowest eave.
- The front is the long side before a roof, and the back lies behind it. Left and right are the
  ends, seen from the front.
- If only one end slopes, it is the right one. A single slope rises from the front.
- `end_height` is the height that a corner's end would reach at the left.
- A cone, a broach (a spire of eight sides), a dome and an onion are measured by the `width` and the
  `length` of a circle or an ellipse. The `length` of a hexagonal spire is that across flats, and
  its `width` is as large where its sides are equal.
- Circles are written with as many facets as keep them within 0.1 m, and with the circle's area. A
  dome and a barrel follow a circular arc in four chords or more on each side. Set
  `chord_tolerance_m` in `[compose]` for finer or coarser facets; roofs are fitted with those of
  0.1 m. Where the rim follows corners of the outline, facets lie between these, so that a dome over
  nine walls has nine ribs. No shape has more than 256 facets, and none joins a neighbour for being
  narrower than `min_face_width_m`.
- An onion is a bulge with a pointed top. Its eave lies at its widest circle. Walls are vertical, so
  the model leaves out how the bulge draws in below that. The `neck_height` is the height at which
  the top begins, at two fifths of the radius; it is at most three fifths of the `height`.
- A drum is a flat part over a circle, and a ring one around a court or another drum. Their
  outlines have as many sides as a cone of their size has facets.
- A half cone roofs an apse. Its `width` runs along the wall, and its `length` away from it.
- A gable with its ridge off the middle also has a `ridge_offset` (m, towards the back).
- A roof that is less regular than its type gives each side's own values, such as `pitch_front` and
  `eave_front`, and the `height` of a level top.
  See [the parameters](parameters.md#irregular-parts).
"""


NAMES = {
    "flat": "flat roof",
    "monopitch": "single slope, lean-to roof",
    "gable": "gable roof",
    "hip": "hip roof",
    "half_hip": "half-hipped roof: gables whose tops are cut off by a hip",
    "pyramid": "pyramid, tent roof",
    "mansard": "slopes on all sides up to a level top",
    "shed": "saw-tooth roof",
    "asymmetric_gable": "gable with slopes or eaves that differ: saltbox, catslide",
    "gambrel": "gambrel: a gable whose slopes are steeper below",
    "side_hip": "hip at one side: gable at one end, hip at the other",
    "side_half_hip": "half hip at one side: gable at one end, half hip at the other",
    "half_mansard": "one slope up to a level top",
    "truncated_gable": "gable with a level top: two opposite slopes",
    "side_mansard": "mansard on three sides: three slopes up to a level top",
    "corner": "two slopes that meet in a hip, as at the corner of a wing",
    "corner_mansard": "mansard on two adjacent sides: two slopes up to a level top",
    "cone": "cone",
    "broach": "spire of eight sides",
    "dome": "dome",
    "barrel": "barrel roof",
    "half_cone": "half a cone, as over an apse",
    "hexagonal_spire": "spire of six sides",
    "onion": "onion",
}
"""What a person calls each roof type."""


def make_page() -> str:
    """Return docs/primitives.md."""
    sections = []
    for name in CATALOGUE:
        parameters = ", ".join(f"`{p}`" for p in list_parameters(name))
        sections.append(
            f"## {name}\n\n{NAMES[name].capitalize()}.\n\n{parameters}\n\n"
            f"![{name}](primitives/{name}.svg)\n"
        )
    return "\n".join([HEAD, *sections])


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for name in CATALOGUE:
        (FOLDER / f"{name}.svg").write_text(primitive_svg(name))
    (FOLDER.parent / "primitives.md").write_text(make_page())


if __name__ == "__main__":
    main()
