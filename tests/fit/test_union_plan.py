"""Check what becomes of volumes: sides and composite shapes."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from hiproof.fit.candidates.volumes import COLUMNS, LEVEL, N_PLANES, OFFSET0, U0, V1
from hiproof.fit.roof import fit_building
from hiproof.fit.roof.site import make_site
from hiproof.fit.roof.start import add_volume
from hiproof.fit.roof.tables import make_tables
from hiproof.fit.shapes.curved import fit_shapes
from hiproof.fit.shapes.regions import unite_outlines
from hiproof.fit.shapes.teeth import unite_saw_teeth
from hiproof.model import Part, Piece
from hiproof.primitives import get
from hiproof.primitives.family import Member
from hiproof.settings import Settings
from union_scenes import lay_out_scene, list_corners

# --- sides ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "end, drawn_end, place",
    [
        (1.3, 1.3, 1.3),  # away from all walls
        (4.0, 3.8, 4.0),  # a little beside one
        (4.0, 4.2, 4.0),
        (3.2, 3.2, 3.2),  # near one, but where the points are
    ],
)
def test_a_side_lies_on_a_wall_near_it_unless_points_lie_elsewhere(end, drawn_end, place):
    block = shapely.box(-4.0, -4.0, 4.0, 4.0)
    outline = block | shapely.box(4.0, -4.0, 7.0, 0.0) | shapely.box(-7.0, 0.0, -4.0, 4.0)
    xy = np.random.default_rng(0).uniform(-7.0, 7.0, (600, 2))
    xy = xy[shapely.contains_xy(outline, *xy.T)]
    whole, _ = lay_out_scene(np.column_stack([xy, np.zeros(len(xy))]), outline, [0.0])
    u, v = whole.plan.uvz[:2]
    z = np.where((u >= -4.0) & (u <= end) & (np.abs(v) <= 4.0), 2.0, -5.0)
    site = make_site(replace(whole, plan=replace(whole.plan, uvz=np.vstack([u, v, z]))))
    volume = np.r_[np.zeros(OFFSET0), [np.inf] * 4, 2.0, np.zeros(COLUMNS - OFFSET0 - N_PLANES)]
    roof = make_tables(2, 20, 20)
    for rectangle, height in ([-7.0, 7.0, -4.0, 4.0], -5.0), ([-4.0, drawn_end, -4.0, 4.0], 2.0):
        volume[U0 : V1 + 1], volume[OFFSET0 + LEVEL] = rectangle, height
        add_volume(roof, volume, whole.turn, site, False)
    ends = -roof.half_planes[1, :2, 2] * roof.half_planes[1, :2, 0]
    assert ends == pytest.approx([-4.0, place], abs=1e-9)


# --- larger shapes --------------------------------------------------------------------------------

KAPPAS = [0.0, 0.7, -2.5]


def make_teeth(count, kappa, slope=0.5, width=5.0, length=12.0, uneven=0.0):
    """Make monopitches behind one another, in no order, a part each.

    Every second one is `uneven` (m) wider than the others.
    """
    shape, parts, v = get("monopitch"), [], 0.0
    for k in range(count):
        item = width + (uneven if k % 2 else 0.0)
        theta_p = {"width": item, "length": length, "height": slope * item}
        across = v + 0.5 * item
        place = np.array([-math.sin(kappa) * across + 40.0, math.cos(kappa) * across - 7.0, 4.0])
        parts.append(shape.part(shape.to_theta(theta_p, kappa, place)))
        v += item
    return [parts[k] for k in np.random.default_rng(count).permutation(count)]


def measure_height(parts, xy):
    z = np.full(len(xy), -np.inf)
    for piece in (piece for part in parts for piece in part.pieces):
        inside = shapely.contains_xy(piece.outline, *xy.T)
        z[inside] = np.maximum(z[inside], piece.height_at(xy[inside]))
    return z


def scatter_points(parts, count=400):
    outline = shapely.union_all([piece.outline for part in parts for piece in part.pieces]).buffer(
        -0.01
    )
    x0, y0, x1, y1 = outline.bounds
    xy = np.random.default_rng(0).uniform((x0, y0), (x1, y1), (count, 2))
    return xy[shapely.contains_xy(outline, *xy.T)]


@pytest.mark.parametrize("kappa", KAPPAS)
@pytest.mark.parametrize("count", [2, 3, 6])
def test_equal_monopitches_in_a_row_are_one_saw_tooth(count, kappa):
    parts = make_teeth(count, kappa)
    (shed,) = unite_saw_teeth(parts)
    assert shed.type == "shed" and shed.parameters["teeth"] == count
    assert shed.parameters["width"] == pytest.approx(5.0 * count)
    xy = scatter_points(parts)
    assert np.mean(np.abs(measure_height([shed], xy) - measure_height(parts, xy)) < 1e-6) > 0.99


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("kappa", KAPPAS)
def test_a_tooth_whose_lower_end_is_hidden_is_a_tooth_of_its_row(kappa, number):
    """The middle one of three, or the last, reaches under its neighbour.

    Neither of the others follows the other.
    """
    parts = sorted(
        make_teeth(3, kappa),
        key=lambda part: np.array([-math.sin(kappa), math.cos(kappa)]) @ part.translation[:2],
    )
    shape, back = get("monopitch"), np.array([math.sin(kappa), -math.cos(kappa), 0.0])
    tooth, row = parts[number], list(parts)
    longer = {"width": 8.0, "length": 12.0, "height": 4.0}  # 3 m of it under the first tooth
    row[number] = shape.part(
        shape.to_theta(longer, kappa, tooth.translation + 1.5 * back + [0.0, 0.0, -1.5])
    )
    (shed,) = unite_saw_teeth(row)
    assert shed.type == "shed" and shed.parameters["teeth"] == 3
    xy = scatter_points(parts)
    assert np.mean(np.abs(measure_height([shed], xy) - measure_height(parts, xy)) < 1e-6) > 0.99


def test_monopitches_that_face_each_other_or_differ_stay_apart():
    first, other = make_teeth(2, 0.0)
    shape = get("monopitch")
    turned = shape.part(shape.to_theta(other.parameters, other.kappa + math.pi, other.translation))
    steeper = make_teeth(2, 0.0, slope=0.9)[1]
    for second in (turned, steeper):
        assert sorted(part.type for part in unite_saw_teeth([first, second])) == [
            "monopitch",
            "monopitch",
        ]


@pytest.mark.parametrize("higher", [0.22, -0.22])
def test_two_all_but_level_roofs_at_two_heights_are_no_saw_tooth(higher):
    """Their planes do not determine how wide teeth are.

    Without walls they implied a negative width, and the fit failed.
    """
    first, second = sorted(
        make_teeth(2, 1.6, slope=0.033, width=3.7, length=2.8), key=lambda part: part.translation[0]
    )
    second = replace(
        second,
        pieces=tuple(
            replace(piece, planes=piece.planes + [0.0, 0.0, higher]) for piece in second.pieces
        ),
        translation=second.translation + [0.0, 0.0, higher],
    )
    shape = get("flat")
    context = shape.part(
        shape.to_theta({"width": 30.0, "length": 30.0}, 1.6, np.array([36.0, -7.0, 3.0]))
    )
    assert sorted(part.type for part in unite_saw_teeth([first, second, context])) == [
        "flat",
        "monopitch",
        "monopitch",
    ]


@pytest.mark.parametrize(("types", "found"), [(["monopitch", "flat"], 2), (["shed"], 1)])
def test_saw_teeth_only_where_they_are_allowed(types, found):
    row = make_teeth(2, 0.0)
    xy = scatter_points(row, 800)
    points = np.column_stack([xy, measure_height(row, xy)])
    settings = Settings.from_dict({"fit": {"types": types}})
    fit = fit_building(points, shapely.union_all([part.outlines[0] for part in row]), settings)
    assert [part.type for part in fit.roof_parts] == types[:1] * found


def draw_gambrel_parts(rng, kappa):
    """Draw a gambrel as a gable on a truncated gable's top, each over its own plan."""
    width, length, slope, upper = (
        rng.uniform(8.0, 11.0),
        rng.uniform(10.0, 16.0),
        rng.uniform(1.2, 2.0),
        rng.uniform(0.3, 0.6),
    )
    half_break = 0.5 * width * rng.uniform(0.5, 0.75)
    break_height = slope * (0.5 * width - half_break)
    centre, none = rng.normal(0.0, 20.0, 2), np.inf
    lower = Member(
        kappa,
        centre,
        np.array([0.5 * length, 0.5 * width]),
        np.array([none, none, 3.0, 3.0]),
        np.array([0.0, 0.0, slope, slope]),
        3.0 + break_height,
    )
    top = Member(
        kappa,
        centre,
        np.array([0.5 * length, half_break]),
        np.full(4, 3.0 + break_height) + [none, none, 0.0, 0.0],
        np.array([0.0, 0.0, upper, upper]),
    )
    return [member.part([shapely.Polygon(list_corners(member))]) for member in (lower, top)], (
        width,
        length,
        break_height,
        2 * half_break,
    )


def fit_parts(parts):
    """Fit shapes to points on the roof of `parts`, which may take their place."""
    xy = scatter_points(parts, 2000)
    points = np.column_stack([xy, measure_height(parts, xy)])
    return fit_shapes(parts, points, unite_outlines(parts).convex_hull, Settings())


@pytest.mark.parametrize("kappa", KAPPAS)
@pytest.mark.parametrize("seed", range(3))
def test_a_gable_on_a_truncated_gable_is_a_gambrel(seed, kappa):
    parts, (width, length, break_height, break_width) = draw_gambrel_parts(
        np.random.default_rng(seed), kappa
    )
    (result,) = fit_parts(parts)
    assert result.type == "gambrel"
    expected = {
        "width": width,
        "length": length,
        "break_height": break_height,
        "break_width": break_width,
    }
    assert {name: result.parameters[name] for name in expected} == pytest.approx(expected, abs=0.02)
    xy = scatter_points(parts)
    assert measure_height([result], xy) == pytest.approx(measure_height(parts, xy), abs=0.02)


@pytest.mark.parametrize("kappa", KAPPAS)
@pytest.mark.parametrize(("further", "steeper"), [(1.0, 0.0), (0.0, 0.01)])
def test_a_gable_whose_ridge_lies_off_its_middle_is_a_gambrels_top(further, steeper, kappa):
    """A rectangle's end under other parts and a hundredth of slope do not matter."""
    (lower, upper), sizes = draw_gambrel_parts(np.random.default_rng(1), kappa)
    half_break, slope = 0.5 * sizes[3], upper.parameters["height"] / (0.5 * sizes[3])
    eave = float(upper.translation[2])
    offsets = Member(
        kappa,
        upper.translation[:2] + 0.5 * further * np.array([-math.sin(kappa), math.cos(kappa)]),
        np.array([0.5 * sizes[1], half_break + 0.5 * further]),
        np.array([np.inf, np.inf, eave, eave - slope * further]),
        np.array([0.0, 0.0, slope + steeper, slope]),
    )
    top = offsets.part([piece.outline for piece in upper.pieces])
    assert (
        top.type == ("asymmetric_gable" if steeper else "gable")
        and "ridge_offset" in top.parameters
    )
    (result,) = fit_parts([lower, top])
    assert result.type == "gambrel"
    assert result.parameters["break_width"] == pytest.approx(sizes[3], abs=0.2)


def test_a_gable_beside_a_truncated_gable_is_no_gambrel():
    (lower, upper), _ = draw_gambrel_parts(np.random.default_rng(0), 0.0)
    shifted = Part(
        upper.type,
        tuple(
            Piece(shapely.transform(piece.outline, lambda xy: xy + [0.0, 12.0]), piece.planes)
            for piece in upper.pieces
        ),
        upper.parameters,
        upper.kappa,
        upper.translation + [0.0, 12.0, 0.0],
    )
    assert sorted(part.type for part in fit_parts([lower, shifted])) == ["gable", "truncated_gable"]
