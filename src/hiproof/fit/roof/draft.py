"""Hold a roof that is being improved, with what is known of it and room to try moves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .accept import FIT_ROUNDS, LEAST_UNITS, LOOP_ROUNDS, fit_roof, improve
from .draw import Drawing, make_drawing
from .price import Known, Site, know, price_known
from .tables import Tables, make_tables_like


@dataclass
class Draft:
    """A `roof` over a `site`, and what is `known` of it. `trial` and `drawing` are room to try."""

    roof: Tables
    site: Site
    known: Known
    trial: Tables
    drawing: Drawing

    @property
    def price(self) -> float:
        """What the roof costs, in points."""
        return price_known(self.known, self.site)

    @property
    def least_gain(self) -> float:
        """What a change must save, in points."""
        return LEAST_UNITS * self.site.unit

    def copy(self) -> Draft:
        """Return a draft of the same roof, to be changed."""
        roof = Tables(*(column.copy() for column in self.roof))
        return replace(self, roof=roof, known=self.known._replace(costs=self.known.costs.copy()))

    def fit(self) -> None:
        """Fit the roof to all points."""
        fit_roof(self.roof, self.site, FIT_ROUNDS)
        self.known = know(self.roof, self.drawing, self.site)

    def improve(self, asked: np.ndarray | None = None) -> None:
        """Make moves that concern volumes `asked` (v,), or all, until none saves."""
        asked = np.ones(len(self.roof.sides), np.bool_) if asked is None else asked
        self.known = improve(
            self.roof, self.trial, self.site, self.drawing, self.known, asked, LOOP_ROUNDS
        )


def make_draft(roof: Tables, site: Site) -> Draft:
    """Return a draft of a roof, fitted to all points."""
    drawing = make_drawing(len(roof.sides))
    fit_roof(roof, site, FIT_ROUNDS)
    return Draft(roof, site, know(roof, drawing, site), make_tables_like(roof), drawing)
