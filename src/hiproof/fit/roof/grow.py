"""Grow a roof: add volumes where points are unexplained, then grow each of them anew.

A large roof grows block by block, each as if it were a building, and its moves then make one roof
of what meets along the cuts.
"""

from __future__ import annotations

import numpy as np

from ..layout.blocks import split_into_blocks
from ..layout.scene import Scene, open_window
from ..layout.whole import Whole
from .accept import BESIDE_M, CHANGE_MARGIN_M, HOPE_UNITS
from .add import add_all, add_at_places, add_each
from .draft import Draft, make_draft
from .draw import draw_in, draw_whole_roof
from .price import know_change, widen
from .site import make_site
from .start import join_roofs, start_roof
from .tables import VOLUME_COUNT, pack

# Points in which structure is sought, of a house and of a larger roof or block.
HOUSE_POINTS, BLOCK_POINTS = 600, 1600
LARGEST_HOUSE_M2 = 200.0  # Area (m2) of the largest house.
# Most volumes that moves make one roof of. Time grows with their cube, and footprints with more,
# such as a whole town's, are no building: 220 volumes take a minute, 500 a quarter of an hour.
MOST_JOINED = 250


def find_roof(whole: Whole, keeps_shapes: bool) -> Draft:
    """Find a roof that no move makes cheaper. Its hidden sides are drawn in."""
    drafts = [draw_in_all(grow(block, keeps_shapes)) for block in split_into_blocks(whole)]
    draft = drafts[0]
    if len(drafts) > 1:
        roof = join_roofs([block.roof for block in drafts])
        draft = make_draft(roof, make_site(whole, keeps_shapes))
    # Narrow strips cost from now on what they are seen to lack.
    draft.fit()
    if draft.roof.counts[VOLUME_COUNT] > MOST_JOINED:
        return draw_in_all(draft)
    draft.improve()
    if whole.plan.uvz.shape[1] > count_search_points(whole.outline.area):  # else all were seen
        added = add_at_places(draft, whole, BLOCK_POINTS)
        if added.any():
            draft.fit()
            draft.improve(added)
    draft.fit()
    return draw_in_all(draft)


def draw_in_all(draft: Draft) -> Draft:
    """Draw in the sides of a roof that other volumes hide."""
    draw_in(draft.roof, draw_whole_roof(draft.roof, draft.site))
    return draft


def count_search_points(area_m2: float) -> int:
    """Return among how many points of a block structure is sought at most."""
    return HOUSE_POINTS if area_m2 <= LARGEST_HOUSE_M2 else BLOCK_POINTS


def grow(whole: Whole, keeps_shapes: bool) -> Draft:
    """Grow the roof of a block from a level base."""
    site = make_site(whole, keeps_shapes)
    scene = open_window(whole, whole.box, count_search_points(whole.outline.area))
    if scene is None:  # hardly a point
        return make_draft(start_roof(whole, site, 0.5), site)
    draft = add_all(make_draft(start_roof(whole, site), site), scene, whole.box)
    draft.fit()
    draft.improve()
    k = 0
    while k < draft.roof.counts[VOLUME_COUNT] > 1:
        draft = regrow(draft, k, scene, whole)
        k += 1
    return draft


def regrow(draft: Draft, k: int, scene: Scene, whole: Whole) -> Draft:
    """Take out volume k, and add what is then missing. Returns the cheaper roof."""
    new = rest = draft.copy()
    boxes = widen(rest.roof.boxes[k], CHANGE_MARGIN_M).reshape(1, 4)
    rest.roof.n_planes[k] = 0
    rest.known = know_change(rest.roof, rest.drawing, rest.site, boxes, BESIDE_M, rest.known)
    pack(rest.roof)
    n_left = rest.roof.counts[VOLUME_COUNT]
    for new in add_each(rest, scene, whole.box):
        if abs(new.price - draft.price) < draft.least_gain:  # the same roof again
            return draft
    if new.price < draft.price + HOPE_UNITS * draft.site.unit:
        new.improve(np.arange(len(new.roof.sides)) >= n_left)
    return new if new.price < draft.price - draft.least_gain else draft
