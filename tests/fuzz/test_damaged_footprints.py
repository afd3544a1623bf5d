"""A footprint that is no building's gets a status of its own, in little time, and harms
no other.
"""

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fuzz.damaged_footprints import ODD, SOUND_IN_THE_WORLD, wavy, write_beside_a_sound_one
from hiproof.city.plan.work_plan import WorkPlan, make_jobs
from hiproof.city.run import Request, reconstruct_area
from hiproof.geometry.point_grid import PointGrid, grow_polygon
from hiproof.model import Footprint
from hiproof.read.outlines.polygons import WIDEST_BUILDING_M, simple_polygons
from hiproof.settings import Settings
from hiproof.stages.outline import MOST_OUTLINE_VERTICES, without_needless_vertices
from run_records import by_id
from tiny_town import make_town, write_cloud, write_footprints

QUICK = settings(
    max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), database=None
)
NUMBERS = st.one_of(
    st.floats(-30, 30),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, 1.0, 1e9]),
)


@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
def test_odd_footprints_get_a_status_and_harm_no_other(tmp_path):
    town = make_town(2, 3.0)
    cloud = str(write_cloud(tmp_path / "cloud.laz", town.xyz, town.classification))
    alone = write_footprints(tmp_path / "alone.geojson", {"sound": SOUND_IN_THE_WORLD})
    reconstruct_area(Request((cloud,), tmp_path / "alone", str(alone)))
    footprints = write_beside_a_sound_one(tmp_path / "footprints.geojson")
    summary = reconstruct_area(Request((cloud,), tmp_path / "out", str(footprints)))
    rows = by_id(tmp_path / "out")
    assert summary.exit_code == 0
    assert rows.pop("sound") == by_id(tmp_path / "alone")["sound"]
    assert {name: row["status"] for name, row in rows.items()} == {
        name: status for name, (_, status) in ODD.items()
    }
    detail = rows["10,000 vertices"]["detail"]
    assert "outline of 10001 vertices was simplified" in detail


def test_an_outline_keeps_its_shape_and_says_how_far():
    outline = shapely.Polygon(wavy(5000))
    simple, remark = without_needless_vertices(outline)
    distance = float(remark.rsplit("within ", 1)[1].removesuffix(" m"))
    assert shapely.get_num_coordinates(simple) <= MOST_OUTLINE_VERTICES
    assert simple.is_valid and distance <= 0.08
    assert shapely.hausdorff_distance(simple.exterior, outline.exterior) <= distance + 1e-9


def comb(teeth):
    """A valid outline with so many teeth, 2 cm wide and 10 cm deep."""
    ring = [(0.02 * i, 0.1 * (i % 2)) for i in range(teeth)]
    return shapely.Polygon([*ring, (0.02 * teeth, 12), (0, 12)])


@pytest.mark.parametrize("outline", [comb(2000), comb(40_000), shapely.Polygon(wavy(40_000))])
def test_an_outline_of_thousands_of_teeth_is_simplified(outline):
    """4,000 teeth took 52 s and 1.7 GB, most of it to grow the outline by the reach of a shift."""
    simple, remark = without_needless_vertices(outline)
    shapely.prepare(simple)
    PointGrid(np.zeros((1, 2))).find_within(simple, 4.0)
    assert f"outline of {len(outline.exterior.coords)} vertices" in remark
    assert simple.is_valid and abs(simple.area / outline.area - 1) < 0.01


def test_an_outline_of_hundreds_of_teeth_is_grown_by_as_much_as_its_hull():
    outline = grow_polygon(comb(450), 4.0, quad_segs=4)
    assert outline.area == pytest.approx(
        shapely.buffer(shapely.convex_hull(comb(450)), 4.0).area, rel=0.03
    )
    square = shapely.box(0, 0, 9, 9)
    assert grow_polygon(square, 4.0, quad_segs=4).equals_exact(
        shapely.buffer(square, 4.0, quad_segs=4)
    )


def test_a_plan_keeps_the_footprint_and_works_on_a_simpler_area(tmp_path):
    outline = comb(2000)
    (job,) = make_jobs((Footprint("a", outline, {"year": 1950}),))
    plan = WorkPlan((job,), {"0_0_0": (0,)}, None, Settings())
    plan.save(tmp_path / "plan.jsonl")
    (loaded,) = WorkPlan.load(tmp_path / "plan.jsonl").jobs
    assert loaded.footprint.polygon.equals_exact(outline) and loaded.area.equals_exact(job.area)
    assert shapely.get_num_coordinates(job.area) < 20


def test_an_outline_of_few_vertices_stays_as_it_is():
    outline = shapely.Polygon(wavy(MOST_OUTLINE_VERTICES - 1))
    assert without_needless_vertices(outline) == (outline, "")


def test_courtyards_narrower_than_what_is_left_out_go_with_it():
    yards = [shapely.box(x, y, x + 0.1, y + 0.1).exterior for x in range(20) for y in range(20)]
    outline = shapely.Polygon(shapely.box(-1, -1, 21, 21).exterior, yards)
    simple, remark = without_needless_vertices(outline)
    assert len(simple.interiors) == 0 and "of 2005 vertices" in remark


@QUICK
@given(numbers=st.lists(st.tuples(NUMBERS, NUMBERS), min_size=2, max_size=12))
def test_any_ring_becomes_valid_polygons_of_a_buildings_size_or_none(numbers):
    polygons = simple_polygons(shapely.Polygon([(0.0, 0.0), *numbers]))
    assert polygons
    for polygon in polygons:
        assert polygon.is_valid
        assert (
            polygon.is_empty
            or np.ptp(shapely.get_coordinates(polygon), axis=0).max() <= WIDEST_BUILDING_M
        )
