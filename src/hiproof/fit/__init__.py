"""From the points of one building to the parameters of its roof.

single         `fit_roof`: one primitive by all points, the door to both objectives
likelihood     the default objective: starts, annealing, the choice of type, what is known of the
               result
direction      plan directions before any fit
walls          which points lie on walls
tables         the catalogue as arrays
kernel         the likelihood with gradient and Hessian, minimised; compiled
paper          the objective of the paper, as published
prices         the table of prices of a roof
roof           `fit_building`: a roof of few volumes, drawn by one price and one loop
layout         what a roof is fitted to: points, an outline, its directions, blocks of it
candidates     volumes that points suggest
misfit         what points and unobserved cells cost under a roof; compiled
outcome        the outcome of `fit_building`
shapes         larger and curved shapes in place of its parts
outline        the outline of a building that comes without one
align          how far a footprint lies beside its roof
registration   how far all footprints of a data set do
site           a footprint against the ground: the two that follow
bare_ground    yards and lost wings inside a footprint, cut out
standing       whether anything stands on a footprint
installations  chimneys and other objects on a roof
overhang       how far a roof reaches beyond its outline
neighbour_roofs  points on a neighbour's roof that reaches over the outline

`fit_roof` is imported on first use, because it brings the compiler along.
"""

from __future__ import annotations


def __getattr__(name: str):
    if name == "fit_roof":
        from .single import fit_roof

        return fit_roof
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
