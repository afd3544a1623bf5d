"""Two surveys registered to each other: by the ground first, and by roofs that agree with it."""

import dataclasses
import warnings
from contextlib import nullcontext

import numpy as np
import pytest

from hiproof import InputError, SettingsError
from hiproof.frames import LocalFrame
from hiproof.model import Roof
from hiproof.settings import ReadSettings
from hiproof.simulate import random_building
from hiproof.simulate.roofs import make_part
from hiproof.update.register import SampledRoof, SurveyShift, read_shift, register_surveys
from points_of_roofs import scan_roof as scan

READ = ReadSettings()
SIDE_M = 190.0
SHED = {"width": 8.0, "length": 12.0, "height": 5.0}


def draw_samples(seed, rises, shift=(0.0, 0.0, 0.0), has_ground=True, tilt=0.0, slopes=None):
    """Roofs that rose by `rises`, in surveys that lie beside each other by `shift`. `slopes` (n, 2)
    are those of the ground around them.
    """
    rng, samples = np.random.default_rng(seed), []
    slopes = np.zeros((len(rises), 2)) if slopes is None else slopes
    for rise, slope in zip(rises, slopes, strict=True):
        place = rng.uniform(0, SIDE_M, 2)
        roof = random_building(rng).roof
        roof = dataclasses.replace(roof, frame=LocalFrame(np.array([*place, 0.0])))
        leaning = tilt * place[0] / SIDE_M
        new = scan(rng, roof) + shift + np.array([0.0, 0.0, rise + leaning])
        around = place + rng.uniform(-15, 15, (80 * has_ground, 2))
        dz = shift[2] + leaning - slope @ shift[:2] + rng.normal(0, 0.04, len(around))
        ground = np.column_stack([around, dz, np.tile(slope, (len(around), 1))])
        samples.append(SampledRoof(roof, scan(rng, roof), new, ground))
    return samples


def draw_rises(seed, count, share):
    rng = np.random.default_rng(seed)
    return np.where(np.arange(count) < round(share * count), rng.uniform(0.4, 3.2, count), 0.0)


@pytest.mark.parametrize(
    ("seed", "share", "shift_z"),
    [(0, 0.0, 0.3), (1, 0.2, -0.6), (2, 0.6, 0.0), (0, 0.6, 0.3), (1, 0.75, 0.0), (2, 0.75, -0.6)],
)
def test_however_many_houses_grow_the_shift_is_that_of_the_ground(seed, share, shift_z):
    shift = (0.1, -0.15, shift_z)
    found = register_surveys(draw_samples(seed, draw_rises(seed, 20, share), shift), READ)
    assert not found.doubt
    assert found.clear_xyz[2] == pytest.approx(shift_z, abs=0.03)
    assert np.abs(np.array(found.xyz) - shift).max() < 0.06
    assert (found.roofs, found.agreeing, found.places) == (20, 20 - round(20 * share), 20)
    assert found.noise.roof < 0.05


@pytest.mark.parametrize(("count", "share"), [(10, 0.0), (10, 0.6), (20, 0.6)])
def test_half_a_metre_aside_is_found_where_most_houses_grew(count, share):
    errors = []
    for seed in range(6):
        shift = np.array([*np.random.default_rng(seed).choice([-0.5, 0.5], 2), 0.05])
        found = register_surveys(draw_samples(seed, draw_rises(seed, count, share), shift), READ)
        errors.append(np.abs(found.clear_xyz - shift).max())
    assert sum(error < 0.15 for error in errors) >= 5, np.sort(errors)[-3:]


@pytest.mark.parametrize(("count", "share"), [(3, 0.0), (4, 0.25), (6, 0.6)])
@pytest.mark.parametrize("seed", range(4))
def test_a_shift_aside_that_few_roofs_show_is_right_or_warned_of(seed, count, share):
    shift = np.array([*np.random.default_rng(seed).choice([-0.5, 0.5], 2), 0.05])
    samples = draw_samples(seed, draw_rises(seed, count, share), shift)
    found = register_surveys(samples, READ)
    is_right = np.abs(found.clear_xyz - shift).max() < 0.15
    assert is_right or any("--shift EAST,NORTH,UP" in text for text in catch_warnings(samples))


@pytest.mark.parametrize(
    ("seed", "kind", "percent", "share", "aside"),
    [
        (0, "a slope", 10, 0.0, 0.5),
        (1, "a slope", 30, 0.0, 0.5),
        (2, "a slope", 30, 0.6, 0.3),
        (0, "a valley", 20, 0.6, 0.3),
        (1, "a valley", 30, 0.6, 0.3),
        (2, "a valley", 30, 0.0, 0.5),
    ],
)
def test_a_slope_moved_aside_is_no_height(seed, share, aside, percent, kind):
    rng = np.random.default_rng([seed, percent])
    slopes = np.full((20, 1), percent / 100) * [1.0, 0.4]
    slopes *= rng.choice([-1.0, 1.0], (20, 1)) if kind == "a valley" else 1.0
    shift = np.array([*rng.choice([-aside, aside], 2), 0.05])
    found = register_surveys(
        draw_samples(seed, draw_rises(seed, 20, share), shift, slopes=slopes), READ
    )
    assert not found.doubt and not found.tilt
    assert found.clear_xyz == pytest.approx(shift, abs=0.05)
    assert found.clear_xyz[2] == pytest.approx(0.05, abs=0.03)
    assert found.ground == pytest.approx(0.05, abs=0.03)


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("rise", [3.0, 0.4])
def test_a_change_of_all_houses_is_no_shift(count, rise):
    found = register_surveys(draw_samples(1, [rise] * count), READ)
    assert found.clear_xyz[2] == 0.0
    assert "expected ground and roofs to lie alike" in found.doubt


@pytest.mark.parametrize("rise", [0.0, 0.2, 0.4, 0.7])
@pytest.mark.parametrize("seed", range(3))
def test_slopes_that_face_one_way_and_rose_are_not_moved_aside(seed, rise):
    """A roof moved along its slope is a roof raised: only slopes of other sides tell which."""
    rng, samples = np.random.default_rng(seed), []
    for place in rng.uniform(0, SIDE_M, (9, 2)):
        part = make_part("monopitch", SHED, 0.3, np.array([0.0, 0.0, 6.0]))
        roof = Roof((part,), part.outlines[0], LocalFrame(np.array([*place, 0.0])))
        around = place + rng.uniform(-15, 15, (80, 2))
        ground = np.column_stack([around, rng.normal(0, 0.04, 80), np.zeros((80, 2))])
        samples.append(SampledRoof(roof, scan(rng, roof), scan(rng, roof) + [0, 0, rise], ground))
    found = register_surveys(samples, READ)
    assert found.clear_xyz.tolist() == [0.0, 0.0, 0.0]
    assert ("expected ground and roofs to lie alike" in found.doubt) is (rise > 0.0)


def test_a_shift_that_no_roof_shares_with_the_ground_is_not_taken_off():
    with pytest.warns(UserWarning, match=r"the ground \+0\.30 m higher.*--shift"):
        found = register_surveys(draw_samples(1, [2.0] * 4, (0.0, 0.0, 0.3)), READ)
        found.warn("survey of 2024-05-01")
    assert found.clear_xyz.tolist() == [0.0, 0.0, 0.0]


def test_where_most_roofs_lie_elsewhere_than_the_ground_a_warning_says_so():
    found = register_surveys(draw_samples(2, draw_rises(2, 10, 0.6)), READ)
    with pytest.warns(UserWarning, match="6 of 10 sampled roofs lie elsewhere than the ground"):
        found.warn("survey of 2024-05-01")


@pytest.mark.parametrize(
    ("rises", "is_applied"),
    [([0.5] * 12, True), ([0.5] * 3, False), ([0.9] * 7 + [0.0] * 5, False)],
)
def test_without_ground_most_of_many_roofs_have_to_carry_a_shift(rises, is_applied):
    found = register_surveys(draw_samples(3, rises, has_ground=False), READ)
    assert bool(found.clear_xyz.any()) is is_applied
    assert bool(found.doubt) is not is_applied


@pytest.mark.parametrize(
    ("rise", "has_ground", "given"),
    [
        *((rise, False, "auto") for rise in (-0.6, 0.0, 0.2, 0.6)),
        (0.6, True, "auto"),
        (-0.6, False, "off"),
        (0.6, False, "0,0,0.6"),
    ],
)
def test_a_height_taken_off_warns_where_roofs_alone_show_it(rise, has_ground, given):
    samples = draw_samples(7, [0.0] * 12, (0.3, 0.0, rise), has_ground)
    found = register_surveys(samples, dataclasses.replace(READ, shift=given))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found.warn("survey of 2024-05-01")
    texts = [text for text in map(str, (w.message for w in caught)) if "roofs alone" in text]
    if rise and given == "auto" and not has_ground:
        assert len(texts) == 1
        assert f"{found.xyz[2]:+.2f} m in height rests on roofs alone (12 of 12" in texts[0]
        assert "--shift off" in texts[0]
        assert "--shift EAST,NORTH,UP" in texts[0]
    else:
        assert not texts


def test_a_shift_beyond_the_bound_is_not_taken_off():
    samples = draw_samples(4, [0.0] * 10, (0.0, 0.0, 1.6))
    found = register_surveys(samples, READ)
    assert "within 1 m of each other (read.largest_shift_m)" in found.doubt
    assert not found.clear_xyz.any()
    found = register_surveys(samples, dataclasses.replace(READ, largest_shift_m=2.0))
    assert found.clear_xyz[2] == pytest.approx(1.6, abs=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_a_roof_that_slopes_one_way_takes_its_height_from_the_ground(seed):
    """It may lie aside or higher, so its height alone is not clear."""
    rng, shift = np.random.default_rng(seed), np.array([0.06, -0.05, 0.4])
    part = make_part("monopitch", SHED, 0.3, np.array([0.0, 0.0, 6.0]))
    roof = Roof((part,), part.outlines[0], LocalFrame(np.zeros(3)))
    around = rng.uniform(-15, 15, (80, 2))
    ground = np.column_stack([around, rng.normal(0.4, 0.04, 80), np.zeros((80, 2))])
    sample = SampledRoof(roof, scan(rng, roof), scan(rng, roof) + shift, ground)
    found = register_surveys([sample], READ)
    assert found.clear_xyz[2] == pytest.approx(0.4, abs=0.12) and not found.doubt


@pytest.mark.parametrize("seed", range(6))
def test_roofs_that_became_steeper_are_no_shift_aside(seed):
    """One of their slopes fits a shift, and a level roof fits any."""
    rng, samples = np.random.default_rng(seed), []
    for k, place in enumerate(rng.uniform(0, SIDE_M, (4, 2))):
        width, rise = rng.uniform(7, 10), rng.uniform(2.5, 3.5)
        sizes = {"width": width, "length": width + 3.0}
        roofs = []
        for height in (rise, rise + 0.6):
            kind = "flat" if k == 0 else "gable"
            heights = {} if k == 0 else {"height": height}
            part = make_part(kind, sizes | heights, 0.0, np.array([0.0, 0.0, 5.0]))
            roofs.append(Roof((part,), part.outlines[0], LocalFrame(np.array([*place, 0.0]))))
        around = place + rng.uniform(-15, 15, (80, 2))
        ground = np.column_stack([around, rng.normal(0, 0.04, 80), np.zeros((80, 2))])
        samples.append(SampledRoof(roofs[0], scan(rng, roofs[0]), scan(rng, roofs[1]), ground))
    assert register_surveys(samples, READ).clear_xyz.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(("text", "shift"), [("off", (0, 0, 0)), ("0,0.1,2.5", (0, 0.1, 2.5))])
def test_a_shift_that_is_given_is_taken_off_as_it_is(text, shift):
    read = dataclasses.replace(READ, shift=text)
    for samples in (draw_samples(5, [0.0] * 9, (0.2, 0.0, 0.3)), []):
        found = register_surveys(samples, read)
        assert found.clear_xyz.tolist() == list(shift)
        assert SurveyShift.from_dict(found.to_dict()) == found


def register_given(text, **scene):
    samples = draw_samples(8, [0.0] * 9, (0.0, 0.0, 0.3), **scene)
    return register_surveys(samples, dataclasses.replace(READ, shift=text))


@pytest.mark.parametrize("text, is_wrong", [("0,5,1000", True), ("0,0,-6", True), ("off", False)])
def test_a_shift_that_roofs_and_ground_contradict_by_metres_is_refused(text, is_wrong):
    refused = pytest.raises(InputError, match="got 0 of 9 sampled roofs on the earlier ones")
    with refused if is_wrong else nullcontext():
        register_given(text).refuse_other_heights("survey of 2024-05-01")


@pytest.mark.parametrize("has_ground", [True, False])
@pytest.mark.parametrize("text, told", [("0,0,2", 1), ("0,0,0.3", 0), ("off", 0)])
def test_a_shift_that_roofs_and_ground_contradict_is_told(text, told, has_ground):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        register_given(text, has_ground=has_ground).warn("survey of 2024-05-01")
    sentences = [str(w.message) for w in caught if "shift that was given puts 0 of 9" in str(w)]
    assert len(sentences) == told, caught


@pytest.mark.parametrize("text", ["", "on", "1,2", "1,2,nan", "1;2;3", "0,0,1e300", "-1001,0,0"])
def test_a_shift_that_is_none_is_refused(text):
    with pytest.raises(SettingsError, match="three numbers such as"):
        read_shift(text)


@pytest.mark.parametrize("has_ground", [True, False])
def test_a_tilt_is_seen_and_counts_as_noise(has_ground):
    level = register_surveys(draw_samples(0, [0.0] * 36, has_ground=has_ground), READ)
    assert level.tilt == 0.0
    samples = draw_samples(0, [0.0] * 36, has_ground=has_ground, tilt=0.3)
    tilted = register_surveys(samples, READ)
    assert tilted.tilt == pytest.approx(0.3, abs=0.06)
    assert tilted.noise.roof > 0.07
    with pytest.warns(UserWarning, match="surveys are tilted to each other, by 0.[23]"):
        tilted.warn("survey of 2024-05-01")


@pytest.mark.parametrize(("seed", "share"), [(0, 0.0), (1, 0.3), (2, 0.3)])
def test_ground_that_moved_under_a_part_of_a_town_is_no_tilt(seed, share):
    """A tilt counts as noise, under which smaller changes would not be found."""
    samples = draw_samples(seed, draw_rises(seed, 24, share))
    samples = [
        s._replace(ground=s.ground + [0, 0, 0.6 * (s.roof.frame.origin[0] < SIDE_M / 2), 0, 0])
        for s in samples
    ]
    found = register_surveys(samples, READ)
    assert found.tilt == 0.0
    assert found.noise.roof < 0.06


def test_what_a_shift_rests_on_is_said():
    found = register_surveys(draw_samples(6, draw_rises(6, 10, 0.3)), READ)
    assert found.rests_on == "the ground at 10 places and 7 of 10 sampled roofs"


def catch_warnings(samples):
    """The texts with which a survey of these samples is warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        register_surveys(samples, READ).warn("survey of 2024-05-01")
    return [str(w.message) for w in caught]


@pytest.mark.parametrize(("count", "share"), [(1, 1.0), (12, 1.0), (12, 0.5), (12, 0.1)])
def test_points_of_the_earlier_survey_are_told(count, share):
    """A survey given twice shows no change, and neither do old points among new ones."""
    samples = draw_samples(8, [0.0] * count)
    twice = round(share * count)
    samples[:twice] = [s._replace(new=np.concatenate([s.old, s.new])) for s in samples[:twice]]
    (text,) = catch_warnings(samples)
    assert f"{twice} of {count} sampled roofs have the points of the earlier survey" in text


@pytest.mark.parametrize("up", [-0.4, 0.3, 2.0])
def test_a_strip_that_lies_elsewhere_with_its_ground_is_no_change_in_silence(up):
    samples = draw_samples(9, [0.0] * 16, (0.1, 0.0, 0.05))
    lifted = [
        s._replace(new=s.new + [0, 0, up], ground=s.ground + [0, 0, up, 0, 0]) for s in samples[:4]
    ]
    (text,) = catch_warnings(lifted + samples[4:])
    assert "4 of 16 sampled roofs lie elsewhere together with the ground around them" in text


@pytest.mark.parametrize("seed", range(3))
def test_a_strip_that_lies_aside_is_no_change_in_silence(seed):
    """Half of the roofs lie 0.8 m to the east, so one half or the other counts as changed."""
    strips = [draw_samples(2 * seed + k, [0.0] * 12, [0.8 * k, 0.0, 0.0]) for k in range(2)]
    texts = [text for text in catch_warnings(strips[0] + strips[1]) if "in the plan" in text]
    assert len(texts) == 1 and int(texts[0].split(" of 24")[0].split()[-1]) >= 4


@pytest.mark.parametrize(("seed", "share"), [(0, 0.0), (1, 0.3), (2, 0.3)])
def test_a_usual_survey_gets_no_warning(seed, share):
    rng = np.random.default_rng(seed)
    samples = draw_samples(seed, draw_rises(seed, 20, share), (*rng.normal(0, 0.2, 2), 0.1))
    for k in range(16, 20):  # a terrace beside one house in five
        samples[k] = samples[k]._replace(ground=samples[k].ground + [0, 0, 0.4, 0, 0])
    assert catch_warnings(samples) == []
