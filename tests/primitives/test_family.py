"""Laws of the family of roof shapes: one surface, whichever way it is turned, named or written
down.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from hiproof.errors import FitError
from hiproof.primitives import CATALOGUE, get
from hiproof.primitives.family import (
    GENERAL_SHAPES,
    KIN,
    Member,
    compute_planes,
    name_among,
    read_member,
)
from hiproof.primitives.parameters import refuse_no_shape
from union_scenes import compute_lowest, draw_member, list_corners

SHAPE_NAMES = [name for name, _ in GENERAL_SHAPES.values()]
each_shape = pytest.mark.parametrize("shape", SHAPE_NAMES)


def name_shape(shape):
    return f"{shape.name}-{len(shape.parameters)}"


def members(shape, count=12):
    """Members of that shape: irregular ones, regular ones (those of the catalogue), skewed ones and
    canted ones in turn.
    """
    for seed in range(count):
        rng = np.random.default_rng([seed, SHAPE_NAMES.index(shape)])
        member = draw_member(rng, shape, regular=seed % 4 == 1, skewed=seed % 4 == 2)
        yield add_cants(rng, member) if seed % 4 == 3 and any(member.has) else member


def add_cants(rng, member, limit=3):
    """The member with one to `most` planes over walls that cut corners of its rectangle off."""
    count = rng.integers(1, limit + 1)
    facing = 0.5 * math.pi * rng.permutation(4)[:count] + rng.uniform(0.3, 1.2, count)
    distance = np.hypot(*member.half) * rng.uniform(0.6, 0.9, count)
    eaves, slopes = member.base + rng.uniform(-0.5, 2, count), rng.uniform(0.3, 2, count)
    return replace(member, cants=np.array([facing, distance, eaves, slopes]))


def is_same_surface(planes, member):
    """Whether planes have the member's heights over its plan, to a millimetre."""
    xy = strew_over_plan(member)
    expected = compute_lowest(member.planes(), xy)
    return compute_lowest(planes, xy) == pytest.approx(expected, abs=1e-3)


def strew_over_plan(member):
    """Places (200, 2) strewn over a member's plan and a little beyond."""
    corners = list_corners(member)
    shares = np.random.default_rng(0).uniform(-0.1, 1.1, (200, 2))
    return corners[0] + shares @ np.array([corners[1] - corners[0], corners[3] - corners[0]])


def sort_planes(planes):
    return planes[np.lexsort(np.round(planes.T, 6))]


@each_shape
@pytest.mark.parametrize("as_catalogue", [True, False], ids=["by its type", "side by side"])
def test_planes_follow_from_the_description(shape, as_catalogue):
    for member in members(shape):
        if as_catalogue or any(member.has):  # a flat roof has no side to be described by
            planes = compute_planes(member.name, *member.describe(as_catalogue=as_catalogue))
            assert sort_planes(planes) == pytest.approx(sort_planes(member.planes()), abs=1e-9)


@each_shape
def test_planes_follow_from_written_parameters_to_a_millimetre(shape):
    for member in members(shape):
        parameters, kappa, translation = member.describe()
        written = {name: round(value, 6) for name, value in parameters.items()}
        planes = compute_planes(member.name, written, round(kappa, 6), np.round(translation, 6))
        assert is_same_surface(planes, member)


def draw_members_without_run():
    """Members with a slope that runs over nothing: its rectangle ends where it begins."""
    half, inf = np.array([6.0, 4.0]), np.inf
    for gap in (0.0, 1e-9, 1e-7, 1e-5):
        for eave, slope in ((inf, 0.0), (5.0, 0.3)):
            eaves, slopes = np.array([inf, inf, 5.0, eave]), np.array([0, 0, 0.3, slope])
            yield Member(0.4, np.zeros(2), half, eaves, slopes, 5.0 + gap)
        # the ridge lies on the eave in front, or just behind the other
        eaves, slopes = np.array([5.0, 5.0 - 8.0 * 0.5 + gap]), np.array([2.0, 0.5])
        for order in (slice(None), slice(None, None, -1)):
            sides = np.array([inf, inf, *eaves[order]]), np.array([0, 0, *slopes[order]])
            yield Member(-1.0, np.ones(2), half, *sides)


def test_what_runs_over_nothing_is_written_so_that_it_can_be_read():
    """Slopes do not follow from lengths of nothing: such a member is given side by side."""
    for member in draw_members_without_run():
        words, kappa, place = member.describe()
        written = {name: round(value, 6) for name, value in words.items()}
        refuse_no_shape(member.name, written, "part 0")
        assert is_same_surface(compute_planes(member.name, written, kappa, place), member)


@each_shape
def test_turning_the_axes_keeps_surface_plan_and_name(shape):
    for member in members(shape):
        turned, xy = member, strew_over_plan(member)
        expected = compute_lowest(member.planes(), xy)
        for _ in range(4):
            turned = turned.turn()
            assert compute_lowest(turned.planes(), xy) == pytest.approx(expected, abs=1e-9)
            assert shapely.equals_exact(plan_of(turned), plan_of(member), 1e-9, normalize=True)
            assert turned.name == member.name
        assert turned.kappa == pytest.approx(member.kappa)


SIDES = {"left": (-1, 0), "right": (1, 0), "front": (0, -1), "back": (0, 1)}


def plan_of(member):
    return shapely.Polygon(list_corners(member))


@each_shape
def test_however_its_axes_were_turned_a_member_is_described_alike(shape):
    for member in members(shape):
        described = member.describe()
        assert described[0] == pytest.approx(member.turn().describe()[0], abs=1e-9)
        canonical = member.canonical()
        assert canonical.has == canonical.canonical().has
        assert canonical.kappa == canonical.canonical().kappa


@each_shape
def test_a_member_over_its_whole_plan_is_the_lowest_of_its_planes(shape):
    for member in members(shape, 6):
        part = member.part([plan_of(member)])
        xy = strew_over_plan(member)
        assert part.type == member.name
        assert part.pieces[0].height_at(xy) == pytest.approx(
            compute_lowest(member.planes(), xy), abs=1e-9
        )
        assert part.translation[2] == pytest.approx(member.base)


@each_shape
def test_eaves_lie_where_the_parameters_say(shape):
    """In the middle of a side its own plane is as high above T_L as its eave, and as steep as its
    pitch.
    """
    for member in (member for member in members(shape) if any(member.has)):
        parameters, kappa, translation = member.describe(as_catalogue=False)
        c, s = math.cos(kappa), math.sin(kappa)
        half = 0.5 * np.array([parameters["length"], parameters["width"]])
        planes = compute_planes(member.name, parameters, kappa, translation)
        for name in (name for name in SIDES if f"eave_{name}" in parameters):
            way = np.array(SIDES[name]) @ np.array([[c, s], [-s, c]])
            middle = translation[:2] + (half @ np.abs(SIDES[name])) * way
            pitch = math.tan(math.radians(parameters[f"pitch_{name}"]))
            rise = planes @ (*middle, 1.0) - translation[2] - parameters[f"eave_{name}"]
            assert (np.abs(planes[:, :2] @ -way - pitch) + np.abs(rise)).min() < 1e-9


@pytest.mark.parametrize("name", [name for name, shape in CATALOGUE.items() if shape.is_of_family])
def test_a_shape_of_the_catalogue_is_told_by_its_own_parameters(name):
    """A regular member's description is that of the catalogue: the primitive of these parameters
    has the same planes.
    """
    primitive = get(name)
    rng = np.random.default_rng(len(name))
    for _ in range(10):
        width = rng.uniform(6.0, 12.0)
        theta_p = primitive.typical(width, width * rng.uniform(1.2, 2.5), rng.uniform(1.5, 4.0))
        theta = primitive.to_theta(theta_p, rng.uniform(-1.5, 1.5), rng.normal(0.0, 20.0, 3))
        planes = compute_planes(name, *primitive.from_theta(theta))
        expected = np.concatenate([piece.planes for piece in primitive.part(theta).pieces])
        assert planes == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    "shape", [v for p in CATALOGUE.values() if p.is_of_family for v in p.variants], ids=name_shape
)
def test_a_member_like_a_shape_is_described_in_its_words(shape):
    """What `fit_roof` and the union call such a roof, and by which parameters, is one thing."""
    rng = np.random.default_rng(5)
    for _ in range(10):
        drawn = shape.draw_parameters(rng, rng.uniform(6.0, 12.0))
        theta = shape.to_theta(drawn, rng.uniform(-1.5, 1.5), rng.normal(0, 20, 3))
        theta_p, kappa, translation = shape.from_theta(shape.canonical_theta(theta))
        member = read_member(shape.name, theta_p, kappa, translation)
        if member.name == shape.name:  # an asymmetric gable whose slopes are drawn equal is a gable
            description, kappa_named, place = member.describe()
            assert description == pytest.approx(theta_p)
            period = math.pi if shape.half_turn_symmetric else 2 * math.pi
            assert math.remainder(kappa_named - kappa, period) == pytest.approx(0.0, abs=1e-9)
            assert place == pytest.approx(translation)


@pytest.mark.parametrize("lower", [0, 1])
def test_an_asymmetric_gable_of_all_but_even_eaves_has_deviations_of_its_changes_alone(lower):
    """Which eave is the lower decides from where it is described; a change of a millimetre must
    not.
    """
    member = planted_gable(eaves=(3.0, 3.0 + 1e-4 * (1 - 2 * lower)))
    steps = 1e-3 * np.eye(4)[2:]
    changes = stack_members([replace(member, eaves=member.eaves + step) for step in steps])
    sigma = member.part([plan_of(member)], None, changes).sigma
    assert 0.0 < max(sigma.values()) < 0.01


def test_a_part_has_deviations_of_its_own_parameters_where_changes_have_more():
    """A side that rises along itself after a change has a skew, and had none before."""
    member = draw_member(np.random.default_rng(3), "side_hip", regular=False).canonical()
    straight = replace(member, leans=np.zeros(4), eaves=member.eaves + [0.0, 0.1, 0.2, 0.3])
    side = straight.sides[0]
    changed = replace(straight, slopes=straight.slopes * 1.01)
    skewed = replace(changed, leans=np.where(np.arange(4) == side, 0.01, 0.0))
    outline = [shapely.Polygon(list_corners(straight))]
    straight_sigma, skewed_sigma = (
        straight.part(outline, None, stack_members([one])).sigma for one in (changed, skewed)
    )
    assert skewed_sigma == pytest.approx(straight_sigma) and straight_sigma


@pytest.mark.parametrize("regular", [False, True])
@each_shape
def test_several_members_are_measured_as_each_of_them(shape, regular):
    member = draw_member(np.random.default_rng(3), shape, regular=regular).canonical()
    kind = get(shape) if regular else None
    if not regular and any(member.has):
        member = add_cants(np.random.default_rng(4), member)
    singles = [
        replace(
            member,
            half=member.half + change,
            eaves=member.eaves + change,
            slopes=member.slopes * (1.0 + change),
            cants=member.cants + [[0.0], [change], [change], [change]],
        )
        for change in (0.0, 1e-3, 0.02)
    ]
    looks_alike = member.turn(2).has == member.has  # else it is seen from one side alone
    for kappa in [member.turn(quarters).kappa for quarters in (range(4) if looks_alike else (0,))]:
        together = stack_members(singles).measure_as(kind, kappa)
        separate = [members.measure_as(kind, kappa) for members in singles]
        assert all(list(one) == list(together) for one in separate)
        for name, values in together.items():
            each = [one[name] for one in separate]
            assert np.broadcast_to(values, 3) == pytest.approx(each, abs=1e-12)


def stack_members(members):
    """Members of one direction as one that is several."""

    def stack(field, axis=1):
        return np.stack([getattr(member, field) for member in members], axis=axis)

    sides = map(stack, ("centre", "half", "eaves", "slopes"))
    cants = stack("cants", 2)
    return Member(members[0].kappa, *sides, stack("top", 0), stack("leans"), cants)


@each_shape
def test_a_cant_rises_square_from_its_wall(shape):
    """Where its parameters say that its wall is, a cant is as high as its eave, and along it all
    the way.
    """
    for seed in range(4):
        rng = np.random.default_rng(seed)
        member = draw_member(rng, shape)
        if not any(member.has):
            continue
        parameters, kappa, translation = add_cants(rng, member).describe()
        wall_names = [name.split("_")[1] for name in parameters if name.startswith("facing_")]
        planes = read_member(member.name, parameters, kappa, translation).planes()
        last = len(planes) - member.has_top
        for cant, plane in zip(wall_names, planes[last - len(wall_names) : last], strict=True):
            facing, distance, eave, pitch = (
                parameters[f"{name}_{cant}"] for name in ("facing", "distance", "eave", "pitch")
            )
            out = kappa + math.radians(facing)
            way = np.array([math.cos(out), math.sin(out)])
            wall = translation[:2] + distance * way
            places = wall + np.outer([-2.0, 0.0, 2.0], [-way[1], way[0]])
            expected = translation[2] + eave
            assert places @ plane[:2] + plane[2] == pytest.approx(expected, abs=1e-9)
            assert math.degrees(math.atan(-plane[:2] @ way)) == pytest.approx(pitch, abs=1e-9)


def planted_gable(eaves):
    """An asymmetric gable in its canonical direction with these eaves in front and at the back."""
    parameters = {"width": 8.0, "length": 12.0, "pitch_front": 50.0, "pitch_back": 30.0}
    parameters |= {"eave_front": eaves[0] - 3.0, "eave_back": eaves[1] - 3.0}
    return read_member("asymmetric_gable", parameters, 0.4, np.array([1.0, 2.0, 3.0])).canonical()


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_name_stands_for_itself_its_kin_or_nothing(name):
    assert name_among(name, ()) == name_among(name, (name, "flat")) == name
    kin = {other for names in KIN if name in names for other in names}
    for other in CATALOGUE:
        assert name_among(name, (other,)) == (other if other == name or other in kin else None)


def test_what_is_no_type_or_lacks_a_parameter_is_told_in_a_sentence():
    with pytest.raises(FitError, match=r"expected a roof type .* got 'igloo'"):
        compute_planes("igloo", {"pitch_front": 30.0}, 0.0, np.zeros(3))
    parameters, kappa, translation = draw_member(np.random.default_rng(0), "corner").side_by_side()
    del parameters["eave_front"]
    with pytest.raises(FitError, match="expected the parameter eave_front of the roof type corner"):
        compute_planes("corner", parameters, kappa, translation)
