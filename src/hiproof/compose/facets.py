"""Facets of curved roof parts, as many as keep the tolerance of chords.

A part is fitted with few facets. Its parameters give the others.
"""

from __future__ import annotations

from dataclasses import replace

from ..model import Part, Roof
from ..primitives.catalogue import CATALOGUE


def draw_facets(roof: Roof, chord_m: float) -> Roof:
    """Return the roof with facets of its curved parts within a tolerance (m)."""
    parts = tuple(draw_part_facets(part, chord_m) for part in roof.parts)
    return replace(roof, parts=parts)


def draw_part_facets(part: Part, chord_m: float) -> Part:
    """Return a part with other facets, or as it is where it is not curved."""
    refine = CATALOGUE[part.type].refine if part.type in CATALOGUE else None
    if refine is None or not part.parameters:
        return part
    shape = refine(part.parameters, chord_m)
    planes = shape.planes_at(shape.to_theta(part.parameters, part.kappa, part.translation))
    return replace(part, pieces=shape.make_pieces(part.outlines, planes))
