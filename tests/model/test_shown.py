"""Where parts show: areas that share nothing, are the outline together, and lie where no other part
is higher; heights at many points are those of each part.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely import affinity

from handmade import RD_ORIGIN, courtyard, make_building, make_lost_building
from hiproof.city.work.solve import make_outcome
from hiproof.compose import compose
from hiproof.evaluate.models import read_models
from hiproof.frames import LocalFrame
from hiproof.model import Building, Model, Part, Piece, Roof
from hiproof.model.heights import find_highest
from hiproof.model.roof_figures import roof_figures
from hiproof.model.shown import share_surface
from hiproof.status import Status
from hiproof.write.building_attributes import osm_tags
from hiproof.write.tables.rows import part_rows
from roof_zoo import FRAME, KINDS, generate_roof
from written_run import write_all

SNAPPED_M = 0.05  # composing moves edges by less than this


def make_slopes():
    """A gable of 9 by 5 m, its eaves at 4 m."""
    slopes = np.array([[0.0, 0.4, 4.0], [0.0, -0.4, 6.0]])
    size = {"width": 5.0, "length": 9.0, "height": 1.0}
    return Part("gable", (Piece(shapely.box(0, 0, 9, 5), slopes),), size)


def compose_building(roof):
    """A building as it stands in a national grid."""
    roof = replace(roof, frame=LocalFrame(RD_ORIGIN))
    return Building("a", Status.MODELLED, built=Model(roof, compose(roof, 0.0).move(RD_ORIGIN)))


def flat(z, *box):
    return Part("flat", (Piece(shapely.box(*box), np.array([[0.0, 0.0, z]])),))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", KINDS)
def test_parts_share_no_area_and_are_the_outline_together(kind, seed):
    building = compose_building(generate_roof(kind, seed))
    areas = building.compute_visible_areas()
    assert len(areas) == len(building.parts)
    assert shapely.is_valid(areas).all()
    together = shapely.union_all(areas)
    assert sum(area.area for area in areas) == pytest.approx(together.area, abs=1e-6)
    outline = shapely.transform(building.roof.outline, building.roof.frame.to_world)
    assert together.symmetric_difference(outline).area < SNAPPED_M * outline.length


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["partition", "cross_gables", "steps"])
def test_where_a_part_shows_none_is_higher(kind, seed):
    building = compose_building(generate_roof(kind, seed))
    roof, rng = building.roof, np.random.default_rng(seed)
    for part, area in zip(roof.parts, building.compute_visible_areas(), strict=True):
        inner = shapely.buffer(shapely.transform(area, roof.frame.to_local), -2 * SNAPPED_M)
        if inner.is_empty:
            continue
        xy = rng.uniform(inner.bounds[:2], inner.bounds[2:], (400, 2))
        xy = xy[shapely.contains_xy(inner, xy[:, 0], xy[:, 1])]
        covered = np.isfinite(part.height_at(xy))  # elsewhere it fills a gap that no part covers
        assert (part.height_at(xy)[covered] > roof.height_at(xy)[covered] - 2 * SNAPPED_M).all()


def test_parts_in_one_plane_share_a_surface_by_their_outlines():
    parts = (flat(3.0, 0, 0, 6, 5), flat(3.0, 6, 0, 10, 5), flat(2.0, 1, 1, 2, 2))
    building = compose_building(Roof(parts, shapely.box(0, 0, 10, 5), FRAME))
    assert len(building.solid.select_faces("RoofSurface")) == 1
    areas = [area.area for area in building.compute_visible_areas()]
    assert areas == pytest.approx([30.0, 20.0, 0.0])


def test_a_building_is_of_the_type_that_shows_most_in_every_output(tmp_path):
    """The flat part is drawn over 60 m2, of which the gable hides 45; the gable is drawn over, and
    shows, 45.
    """
    parts = (flat(2.5, 0, 0, 12, 5), make_slopes(), flat(3.0, 2, 1, 8, 4))
    roof = Roof(parts, shapely.box(0, 0, 12, 5), FRAME)
    building = replace(compose_building(roof), z_ground=0.0)
    assert building.type == "gable"
    assert building.model.visible_m2 == pytest.approx((15.0, 45.0, 0.0))
    write_all(tmp_path, [building])
    (model,) = read_models(tmp_path / "buildings.city.jsonl")
    assert model.roof_type == "gable"
    assert osm_tags(building, roof_figures(building.solid))["roof:shape"] == "gabled"
    record = json.loads((tmp_path / "parameters.jsonl").read_text().splitlines()[1])
    assert record["type"] == "gable"
    gml = (tmp_path / "buildings.gml").read_text()
    assert "1130</bldg:roofType>" in gml  # two types show
    assert make_outcome(0, building, 0.0).type == "gable"


def test_hidden_parts_do_not_make_a_roof_a_mixed_one(tmp_path):
    roof = Roof((flat(3.0, 2, 1, 8, 4), make_slopes()), shapely.box(0, 0, 9, 5), FRAME)
    write_all(tmp_path, [replace(compose_building(roof), z_ground=0.0)])
    assert "1030</bldg:roofType>" in (tmp_path / "buildings.gml").read_text()


def test_rows_hold_where_a_part_shows_and_its_size_and_a_hidden_one_has_none():
    roof = Roof((flat(3.0, -5, -5, 20, 20), flat(2.0, 1, 1, 2, 2)), shapely.box(0, 0, 10, 5), FRAME)
    ((geometry, values),) = part_rows(compose_building(roof))
    x, y, _ = RD_ORIGIN
    assert shapely.from_wkb(geometry).equals(shapely.box(x, y, x + 10, y + 5))
    assert values["area_m2"] == 50.0


def test_a_small_surface_stays_with_its_part_where_no_other_is_drawn():
    small, distant = shapely.box(0, 0, 0.1, 0.1), shapely.box(5, 5, 6, 6)
    remaining, remainder = share_surface(small, small, distant)
    assert remaining.equals(small) and remainder.is_empty


def test_what_shrinks_to_a_line_on_the_grid_is_no_area():
    ring = [(-2.221, 1.864), (-1.357, 0.634), (-3.735, -1.053), (-4.604, 0.098)]
    area = shapely.Polygon([(-4.72, 0.253), (-2.038, 2), *ring])
    members = shapely.Polygon([(-2.039, 1.999), (-4.604, 0.098), (-4.72, 0.253)])
    remaining, remainder = share_surface(area, members, shapely.Polygon(ring))
    assert {remaining.geom_type, remainder.geom_type} == {"MultiPolygon"}
    assert remaining.area + remainder.area == pytest.approx(area.area, abs=1e-2)


@pytest.mark.parametrize("seed", range(20))
def test_parts_in_one_plane_whose_outlines_miss_one_another_leave_no_slivers(seed):
    rng, parts = np.random.default_rng(seed), []
    for x0, x1 in ((0, 6), (6, 10)):
        box = affinity.rotate(shapely.box(x0, 0, x1, 5), 30, (3, 2.5))
        box = shapely.set_precision(affinity.rotate(box, rng.uniform(-0.02, 0.02)), 1e-4)
        parts.append(Part("flat", (Piece(box, np.array([[0.0, 0.0, 3.0]])),)))
    outline = affinity.rotate(shapely.box(0, 0, 10, 5), 30, (3, 2.5))
    areas = compose_building(Roof(tuple(parts), outline, FRAME)).compute_visible_areas()
    assert shapely.is_valid(areas).all() and {area.geom_type for area in areas} == {"Polygon"}
    assert [area.area for area in areas] == pytest.approx([30.0, 20.0], abs=0.1)


def test_a_part_drawn_with_a_spike_of_no_width_shares_its_surface_all_the_same():
    spiked = shapely.Polygon([(0, 0), (6, 0), (6, 3), (9, 3), (6, 3), (6, 5), (0, 5)])
    parts = (Part("flat", (Piece(spiked, np.array([[0.0, 0.0, 3.0]])),)), flat(3.0, 6, 0, 10, 5))
    areas = compose_building(Roof(parts, shapely.box(0, 0, 10, 5), FRAME)).compute_visible_areas()
    assert [area.area for area in areas] == pytest.approx([30.0, 20.0])


def test_a_part_around_a_yard_has_a_hole():
    (area,) = make_building(courtyard(), kinds=("flat",)).compute_visible_areas()
    assert area.area == pytest.approx(84.0) and len(area.interiors) == 1


def test_a_building_without_a_model_shows_nothing():
    assert make_lost_building().compute_visible_areas() == []


def test_the_highest_part_is_found_at_every_point():
    rng = np.random.default_rng(3)
    corners = rng.uniform(0.0, 40.0, (30, 2))
    outlines = shapely.buffer(shapely.points(corners), rng.uniform(1.0, 20.0, 30), quad_segs=2)
    planes = rng.normal(0.0, 1.0, (30, 2, 3))
    pieces = [Piece(o, p) for o, p in zip(outlines, planes, strict=True)]
    parts = [Part("free", (piece,)) for piece in pieces]
    xy = rng.uniform(-5.0, 45.0, (5_000, 2))
    heights = np.array([part.height_at(xy) for part in parts])
    z, top = find_highest(parts, xy)
    assert np.array_equal(z, heights.max(axis=0))
    assert np.array_equal(top, heights.argmax(axis=0))
