"""The common shift between two surveys, and how much unchanged roofs differ.

What cannot have grown comes first: the median height of the new ground over the earlier one. New
points lie over the earlier roofs by dz - a dx - b dy, where (a, b) is the roof's slope and (dx, dy,
dz) the shift. A robust least squares over a sample of buildings estimates it, starting at the
ground's height, so roofs that changed are outliers however many they are. A shift that ground and
roofs do not share, or that few roofs carry, is not taken off. A hash of places draws the sample: it
does not depend on tiles.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import shapely

from ..city.plan.registration import SAMPLE_CELL_M, hash_cell
from ..city.plan.work_plan import WorkPlan
from ..errors import InputError, InputWarning, SettingsError
from ..geometry.thin import hashes
from ..log import count_things
from ..model import Roof
from ..settings import ReadSettings
from .cells import (
    SurveyNoise,
    compare_points,
    find_slopes,
    select_inner,
    shrink_outline,
)
from .clusters import flag_cells

MOST_POINTS = 400
"""Points of a building that are used: more tell the roof's own errors rather than the shift."""

SHIFT_SCALE_M = 0.25
"""Residuals beyond are outliers (m)."""

LONGEST_SHIFT_M = 1000.0
"""Longest shift (m) that may be given: reference systems lie up to hundreds of metres apart."""

STARTS_M, SHIFT_ROUNDS = (-0.5, 0.0, 0.5), 8
"""Shifts (m) to the east and to the north from which an estimate starts, and its steps. Where most
roofs rose, some of these fit a shift, too, so the best of nine estimates counts.
"""

USUAL_ASIDE_M = 0.2
"""Horizontal difference (m) that two surveys usually have."""

PRIOR_M = 2 * USUAL_ASIDE_M
"""Standard deviation (m) of the horizontal shift before any roof is seen; flat roofs tell none. A
tighter one halves the shift of few roofs."""

PRIOR = np.diag([PRIOR_M**-2, PRIOR_M**-2, 0.0])
"""What is known of a shift before, as a normal matrix (1/m2)."""

ROOF_ERROR_M = 0.05
"""Standard deviation (m) of what points say of a building, or of the ground: that of two strips."""

CLEAR_SIGMAS = 3.0
"""A shift smaller than so many of its standard deviations is not applied."""

SAME_HEIGHT_M = 0.1
"""Roofs and ground may lie so far apart (m) between surveys, by grass that was higher or ground
points that were chosen otherwise."""

MOST_GROUND_M = 5.0
"""Height (m) by which ground may lie apart between surveys. Beyond it units or systems differ: feet
and metres, or heights over the ellipsoid and the sea."""

CARRIED_BESIDE_GROUND, CARRIED_ALONE = 0.1, 2 / 3
"""Least share of the roofs' area that has to lie where a shift puts it: where the ground shows the
same shift, and where there is no ground."""

LEAST_SLOPE = 0.1  # mean gradient of a roof from which on it shows a shift aside

FEWEST_ROOFS = 8
"""Roofs from which on their noise is estimated rather than assumed, and carry a shift alone."""

FEWEST_ASIDE = 4
"""Roofs that have to lie elsewhere together: chance brings two or three changed ones together."""

FEWEST_TILT_PLACES = 6
"""Places with ground from which on a tilt is looked for: a plane takes three."""

LEAST_TILT_M, TILT_SIGMAS = 0.1, 5.0
"""Least height (m) by which a tilt raises one end of the area over the other, and least number of
its standard deviations."""

CHANGED_SHARE, MOST_STRAY = 0.3, 0.02
"""Share of the roofs that may have changed: those with the most stray cells do not count. Where
more have, the share of stray cells is bounded: seven times that of usual roofs."""

REPEATED_SHARE = 0.1
"""Share of a roof's new points that are earlier ones, from which on these were given again: no two
pulses have the same coordinates but by chance."""

LEAST_M = 0.02
"""Least noise (m): coordinates come in centimetres."""


ENOUGH_ROOFS = 60
"""Sampled roofs: they tell the shift within a centimetre, and their noise to a tenth of it."""


class SampledRoof(NamedTuple):
    """A building's earlier roof, with points (n, 3) of both surveys.

    Points are in the roof's frame, `old` is None where unknown. `ground` (m, 5) are places around
    it in the world, how much higher the new ground lies there, and its slope in x and y.
    """

    roof: Roof
    old: np.ndarray | None
    new: np.ndarray
    ground: np.ndarray = np.zeros((0, 5))


@dataclass(frozen=True)
class SurveyShift:
    """How far (x, y, z in m) the new survey lies beside the earlier one.

    `sigma` has the standard deviations. `agreeing` of so many `roofs` lie where the shift puts
    them, and the ground at so many `places` shows it, by `ground` (m). `repeated` of the roofs have
    the points of the earlier survey, `moved` lie elsewhere together with the ground around them,
    and `aside` together elsewhere in the plan. `tilt` (m) is how much higher one end of the area
    lies than the other. With a `doubt`, a sentence, the shift is not applied. `noise` is what is
    left between unchanged roofs.
    """

    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sigma: tuple[float, float, float] = (PRIOR_M, PRIOR_M, ROOF_ERROR_M)
    roofs: int = 0
    agreeing: int = 0
    places: int = 0
    ground: float = 0.0
    repeated: int = 0
    moved: int = 0
    aside: int = 0
    tilt: float = 0.0
    doubt: str = ""
    noise: SurveyNoise = field(default_factory=SurveyNoise)

    @property
    def clear_xyz(self) -> np.ndarray:
        """What (3,) is taken off the new points: the shift where it is clear."""
        xyz, sigma = np.array(self.xyz), np.array(self.sigma)
        return np.where((np.abs(xyz) > CLEAR_SIGMAS * sigma) & (not self.doubt), xyz, 0.0)

    @property
    def is_contradicted(self) -> bool:
        """Whether it was given, and most roofs and the ground, if any, lie elsewhere."""
        is_given = not any(self.sigma) and any(self.xyz)
        is_off = not self.places or abs(self.ground - self.xyz[2]) > SHIFT_SCALE_M
        return is_given and is_off and 2 * self.agreeing < self.roofs

    @property
    def rests_on(self) -> str:
        """What the shift rests on, in words."""
        roofs = f"{self.agreeing} of {count_things(self.roofs, 'sampled roof')}"
        places = count_things(self.places, "place")
        return f"the ground at {places} and {roofs}" if self.places else roofs

    @property
    def misfit(self) -> str:
        """How the survey lies after a shift that was given, in words."""
        roofs = f"{self.agreeing} of {count_things(self.roofs, 'sampled roof')} on the earlier ones"
        off = self.ground - self.xyz[2]
        return roofs + (f" and the ground {off:+.2f} m off" if self.places else "")

    def to_dict(self) -> dict[str, Any]:
        """Return the shift for JSON."""
        return dataclasses.asdict(self) | {"applied": self.clear_xyz.tolist()}

    @staticmethod
    def from_dict(record: dict[str, Any]) -> SurveyShift:
        """Read what `to_dict` gave."""
        values = {name: value for name, value in record.items() if name != "applied"}
        return SurveyShift(**values | {"noise": SurveyNoise(**values["noise"])})

    def refuse_other_heights(self, name: str) -> None:
        """Raise InputError where heights of the survey `name` are of another unit or system."""
        if self.doubt and abs(self.ground) > MOST_GROUND_M:
            raise InputError(
                f"{name}: {self.doubt}; its heights seem to be of another unit or system. "
                "Transform them, pass their shift with --shift EAST,NORTH,UP, or --shift off if "
                "the ground did move"
            )
        if self.is_contradicted and abs(self.ground - self.xyz[2]) > MOST_GROUND_M:
            raise InputError(
                f"{name}: expected --shift to put the survey on the earlier one, got "
                f"{self.misfit}; leave it out to have it estimated"
            )

    def warn(self, name: str) -> None:
        """Warn (InputWarning) of what the shift of the survey `name` does not explain."""
        x, y, z = self.xyz
        is_estimated, elsewhere = self.sigma[2] > 0 and not self.doubt, self.roofs - self.agreeing
        is_aside = math.hypot(x, y) > USUAL_ASIDE_M
        contradicts_ground = bool(self.places) and elsewhere > self.agreeing
        contradicts_ground &= not (self.doubt or self.is_contradicted)
        doubts = {
            f"{self.doubt}; no shift is taken off. If the survey is shifted, pass it with --shift "
            "EAST,NORTH,UP": self.doubt,
            f"the shift that was given puts {self.misfit}. Roofs there count as changed; leave out "
            "--shift to have it estimated": self.is_contradicted,
            f"{elsewhere} of {self.roofs} sampled roofs lie elsewhere than the ground between the "
            "surveys, so they count as changed; if the ground is wrong, pass the shift of the "
            "survey with --shift EAST,NORTH,UP": contradicts_ground,
            f"the shift of {z:+.2f} m in height rests on roofs alone ({self.rests_on}), because no "
            "ground around them lies in both surveys. It would hide that all roofs were raised or "
            "lowered alike. If they were, pass --shift off, and if the shift is known, --shift "
            "EAST,NORTH,UP": is_estimated and not self.places and self.clear_xyz[2],
            f"{self.repeated} of {self.roofs} sampled roofs have the points of the earlier survey, "
            "which show no change; name the clouds of the new survey alone": self.repeated,
            f"{self.moved} of {self.roofs} sampled roofs lie elsewhere together with the ground "
            "around them: strips of a survey do not fit each other, or the ground moved. Such "
            "roofs count as raised or lowered; check their ground first": self.moved
            and not (self.doubt or self.tilt),
            f"{self.aside} of {self.roofs} sampled roofs lie together elsewhere in the plan: "
            "strips of a survey do not fit each other. Roofs there count as changed; correct the "
            "strips, or update with the files of one at a time": self.aside,
            f"the shift of {x:+.2f} m to the east and {y:+.2f} m to the north rests on "
            f"{self.agreeing} of {self.roofs} sampled roofs. So few may show their own changes or "
            "another shift; if it is known, pass --shift EAST,NORTH,UP": is_estimated
            and self.agreeing < FEWEST_ROOFS
            and is_aside,
            f"the surveys are tilted to each other, by {self.tilt:.2f} m from one end to the "
            "other. No tilt is taken off, so smaller changes of height are not found; correct the "
            "heights of the strips for these": self.tilt,
        }
        for sentence, holds in doubts.items():
            if holds:
                warnings.warn(f"{name}: {sentence}", InputWarning)


def read_shift(text: str) -> tuple[float, float, float] | None:
    """Return the shift that a user gives, None where it is to be estimated.

    Raises SettingsError for anything else.

    >>> read_shift("auto"), read_shift("off"), read_shift("0.1,-0.2,43")
    (None, (0.0, 0.0, 0.0), (0.1, -0.2, 43.0))
    """
    if text in ("auto", "off"):
        return None if text == "auto" else (0.0, 0.0, 0.0)
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(abs(value) <= LONGEST_SHIFT_M for value in (x, y, z)):
        raise SettingsError(
            f"expected --shift auto, off or three numbers such as 0.1,-0.2,0.05, got {text!r:.40}; "
            f"they are metres to the east, to the north and up, up to {LONGEST_SHIFT_M:g}"
        )
    return x, y, z


def draw_buildings(plan: WorkPlan) -> set[int]:
    """Return the numbers of the sampled buildings.

    Their order follows from their places alone: by the hash of their square, then by place.
    """
    jobs = [job for job in plan.jobs if not job.area.is_empty]
    lower = shapely.bounds([job.area for job in jobs]).reshape(-1, 4)[:, :2]
    squares = np.floor(lower / SAMPLE_CELL_M).astype(np.int64)
    order = sorted(
        range(len(jobs)), key=lambda k: (hash_cell(tuple(squares[k].tolist())), *lower[k].tolist())
    )
    return {jobs[k].index for k in order[:ENOUGH_ROOFS]}


def register_surveys(samples: Iterable[SampledRoof], read: ReadSettings) -> SurveyShift:
    """Estimate the shift of the new points of `samples` from the earlier ones.

    `read` may fix it, and bounds it.
    """
    samples, fixed = list(samples), read_shift(read.shift)
    pairs = [(sample, make_rows(sample)) for sample in samples]
    pairs = [(sample, row) for sample, row in pairs if len(row[0])]
    if not pairs:
        return SurveyShift() if fixed is None else SurveyShift(fixed, (0.0, 0.0, 0.0))
    rows = [rows for _, rows in pairs]
    ground = measure_ground(samples)
    heights = [float(np.median(residuals)) for _, residuals in rows]
    if fixed is not None:
        shift, sigma = np.array(fixed), np.zeros(3)
    else:
        shift, sigma = solve_shift(rows, ground, float(np.median(heights)))
        shift[:2] *= any(shows_aside(row, shift) for row in rows)
        if len(ground):  # slopes that face one way leave their height open, the ground does not
            sigma[2] = min(sigma[2], ROOF_ERROR_M)
    level, aside = measure_level(ground, shift), count_aside(rows, ground, shift)
    ground[:, 2] += ground[:, 3:] @ shift[:2]
    offsets = np.array([np.median(residuals - design @ shift) for design, residuals in rows])
    is_agreeing = np.abs(offsets) < SHIFT_SCALE_M
    rises = [measure_level(sample.ground, shift) - shift[2] for sample, _ in pairs]
    is_moved = (np.abs(rises) > SAME_HEIGHT_M) & (np.abs(offsets - rises) < SAME_HEIGHT_M)
    is_moved &= [len(sample.ground) > 0 for sample, _ in pairs]
    origins = np.array([sample.roof.frame.origin[:2] for sample, _ in pairs])
    roofs = np.column_stack([origins, offsets])
    result = SurveyShift(
        tuple(np.round(shift, 4).tolist()),
        tuple(np.round(sigma, 4).tolist()),
        len(rows),
        int(is_agreeing.sum()),
        len(ground),
        round(level, 4),
        sum(repeats_points(sample) for sample, _ in pairs),
        int(is_moved.sum()),
        aside,
        measure_tilt(ground, roofs) if len(ground) else measure_tilt(roofs[is_agreeing], roofs),
    )
    areas = np.array([sample.roof.outline.area for sample, _ in pairs])
    if fixed is None:
        share = float(areas[is_agreeing].sum() / areas.sum())
        doubt = find_doubt(result, share, float(np.median(heights)), read.largest_shift_m)
        result = dataclasses.replace(result, doubt=doubt)
    moved = [sample._replace(new=sample.new - result.clear_xyz) for sample, _ in pairs]
    offsets = offsets + shift[2] - result.clear_xyz[2]
    unchanged = [s for s, value in zip(moved, offsets, strict=True) if abs(value) < SHIFT_SCALE_M]
    noise = measure_noise(unchanged)
    tilted = max(noise.roof, round(result.tilt / math.sqrt(12), 4))  # of evenly spread places
    return dataclasses.replace(result, noise=dataclasses.replace(noise, roof=tilted))


def count_aside(
    rows: list[tuple[np.ndarray, np.ndarray]], ground: np.ndarray, shift: np.ndarray
) -> int:
    """Return how many roofs the common `shift` (3,) leaves off, and another one in the plan fits.

    Changes lead each its own way, so only strips that lie aside bring several together.
    """
    left = [row for row in rows if not fits(row, shift)]
    if len(left) < FEWEST_ASIDE:
        return 0
    other = solve_shift(left, ground, 0.0)[0]
    count = sum(fits(row, other) for row in left)
    is_other = math.hypot(*(other - shift)[:2]) > USUAL_ASIDE_M
    return count if is_other and count >= FEWEST_ASIDE else 0


def shows_aside(row: tuple[np.ndarray, np.ndarray], shift: np.ndarray) -> bool:
    """Return whether a roof has slopes, and most of its points lie where a `shift` (3,) puts them.

    One slope that became steeper lies where a shift aside puts it, but not those that face others.
    """
    design, residuals = row
    off = np.abs(residuals - design @ shift)
    is_steep = np.hypot(*design[:, :2].T).mean() > LEAST_SLOPE
    return bool(is_steep and np.quantile(off, CARRIED_ALONE) < 2 * SAME_HEIGHT_M)


def fits(row: tuple[np.ndarray, np.ndarray], shift: np.ndarray) -> bool:
    """Return whether a shift (3,) puts most points of a roof on it."""
    design, residuals = row
    return bool(np.median(np.abs(residuals - design @ shift)) < SAME_HEIGHT_M)


def measure_level(ground: np.ndarray, shift: np.ndarray) -> float:
    """Return how much higher the new ground lies (n, 5), 0 without any.

    What slopes show of a `shift` aside is taken off.
    """
    return float(np.median(ground[:, 2] + ground[:, 3:] @ shift[:2])) if len(ground) else 0.0


def repeats_points(sample: SampledRoof) -> bool:
    """Return whether new points of a roof are its earlier ones."""
    if sample.old is None or not len(sample.new):
        return False
    is_old = np.isin(hashes(sample.new), hashes(sample.old))
    return bool(is_old.mean() > REPEATED_SHARE)


def measure_ground(samples: list[SampledRoof]) -> np.ndarray:
    """Return places, how much higher the new ground lies there, and its slopes (n, 5)."""
    places = [np.median(s.ground, axis=0) for s in samples if len(s.ground)]
    return np.array(places).reshape(-1, 5)


def measure_tilt(places: np.ndarray, roofs: np.ndarray) -> float:
    """Return by how much (m) heights at `places` (n, 3 or more) rise across them.

    It is 0 where that is unclear, or where `roofs` (m, 3) do not lean alike: then the ground moved.

    >>> x, y = np.meshgrid(np.arange(5) * 50.0, np.arange(5) * 50.0)
    >>> places = np.column_stack([x.ravel(), y.ravel(), 0.002 * x.ravel()])
    >>> measure_tilt(places, places - [0, 0, 0.2]), measure_tilt(places, places * [1, 1, 0])
    (0.4, 0.0)
    """
    if len(places) < FEWEST_TILT_PLACES:
        return 0.0
    xy, z = places[:, :2] - places[:, :2].mean(axis=0), places[:, 2]
    design, weight = np.column_stack([xy, np.ones(len(xy))]), np.ones(len(xy))
    for _ in range(10):
        normal = design.T @ (weight[:, None] * design)
        if np.linalg.cond(normal) > 1e12:
            return 0.0  # in a line
        plane = np.linalg.solve(normal, design.T @ (weight * z))
        misfit = z - design @ plane
        scatter = max(1.4826 * float(np.median(np.abs(misfit))), LEAST_M / 2)
        weight = np.maximum(1 - (misfit / (4 * scatter)) ** 2, 0.0) ** 2
    rise = float(np.ptp(xy @ plane[:2]))
    leaning = (roofs[:, :2] - places[:, :2].mean(axis=0)) @ plane[:2]
    misfits = [np.minimum(np.abs(roofs[:, 2] - z), SHIFT_SCALE_M) for z in (leaning, 0.0)]
    if misfits[0].sum() > misfits[1].sum():
        return 0.0
    covariance = scatter**2 * np.linalg.inv(normal)[:2, :2]
    sigmas = math.sqrt(plane[:2] @ np.linalg.solve(covariance, plane[:2]))
    return round(rise, 4) if rise > LEAST_TILT_M and sigmas > TILT_SIGMAS else 0.0


def find_doubt(estimate: SurveyShift, share: float, roofs_m: float, largest_m: float) -> str:
    """Return why a shift is not to be taken off, "" where nothing speaks against it.

    `share` of the roofs' area lies where the shift puts it, `roofs_m` is the roofs' median height.
    """
    z, lies = estimate.xyz[2], f"({', '.join(f'{value:+.2f}' for value in estimate.xyz)}) m"
    is_shared = share >= CARRIED_BESIDE_GROUND and abs(z - estimate.ground) <= SAME_HEIGHT_M
    if estimate.places and not is_shared:
        return (
            f"expected ground and roofs to lie alike between the surveys, got the ground "
            f"{estimate.ground:+.2f} m higher, and the roofs {roofs_m if share < 0.5 else z:+.2f} m"
        )
    if not estimate.clear_xyz.any():
        return ""
    if max(map(abs, estimate.xyz)) > largest_m:
        return (
            f"expected surveys within {largest_m:g} m of each other (read.largest_shift_m), got "
            f"{lies} by {estimate.rests_on}"
        )
    if not estimate.places and (estimate.agreeing < FEWEST_ROOFS or share < CARRIED_ALONE):
        return (
            f"expected a shift that most of {FEWEST_ROOFS} roofs or more show where there is no "
            f"ground, got {lies} by {estimate.rests_on}"
        )
    return ""


def make_rows(sample: SampledRoof) -> tuple[np.ndarray, np.ndarray]:
    """Return the design (n, 3) and the residuals (n,) of a building's new points.

    What the earlier roof itself is off its own points is taken off.
    """
    roof, old, new, _ = sample
    inner = shrink_outline(roof.outline)
    points, residuals = select_inner(roof, inner, new)
    if old is not None:
        own = select_inner(roof, inner, old)[1]
        residuals = residuals - (np.median(own) if len(own) else np.nan)
    step = max(1, len(points) // MOST_POINTS)
    points, residuals = points[::step], residuals[::step]
    slopes = find_slopes(roof, points[:, :2])
    known = np.isfinite(slopes).all(axis=1) & np.isfinite(residuals)
    return np.column_stack([-slopes, np.ones(len(slopes))])[known], residuals[known]


def solve_shift(
    rows: list[tuple[np.ndarray, np.ndarray]], ground: np.ndarray, roofs_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the shift (3,) and its standard deviations from the rows of buildings.

    Each estimate starts at the height of the `ground` (n, 5), or without any at that of the roofs.
    Errors of a building's points go together, so the variance is that between buildings (a sandwich
    estimate).
    """
    found = []
    for start in itertools.product(STARTS_M, STARTS_M):
        shift = np.array([*start, 0.0])
        shift[2] = measure_level(ground, shift) if len(ground) else roofs_m
        for _ in range(SHIFT_ROUNDS):
            _, inverse, gradients = weigh_rows(rows, shift)
            shift = shift + inverse @ (gradients.sum(axis=0) - PRIOR @ shift)
        found.append((*weigh_rows(rows, shift), shift))
    _, inverse, gradients, shift = min(found, key=lambda item: item[0])
    covariance = inverse @ (gradients.T @ gradients + PRIOR) @ inverse
    return shift, np.sqrt(np.diag(covariance) + ROOF_ERROR_M**2 / len(rows) / 4)


def weigh_rows(
    rows: list[tuple[np.ndarray, np.ndarray]], shift: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the price of a shift (3,), the inverse of its normal matrix, and gradients (n, 3).

    Every building has the weight of one observation of ROOF_ERROR_M, with Tukey's biweight.
    """
    normal, gradients, price = PRIOR.copy(), [], float(shift @ PRIOR @ shift) / 2
    for design, residuals in rows:
        misfit = residuals - design @ shift
        near = np.maximum(1 - (misfit / SHIFT_SCALE_M) ** 2, 0.0)
        weight = near**2 / (ROOF_ERROR_M**2 * len(residuals))
        normal += design.T @ (weight[:, None] * design)
        gradients.append(design.T @ (weight * misfit))
        price += (SHIFT_SCALE_M / ROOF_ERROR_M) ** 2 * float((1 - near**3).mean()) / 6
    return price, np.linalg.inv(normal + 1e-9 * np.eye(3)), np.array(gradients)


def measure_noise(samples: list[SampledRoof]) -> SurveyNoise:
    """Measure how much unchanged roofs differ.

    Most roofs are unchanged, so medians tell it.
    """
    usual = SurveyNoise()
    scatter, differences, middles, strays = [], [], [], []
    for sample in samples:
        c = compare_points(sample.roof, sample.old, sample.new, usual)
        compared = c.is_compared
        if compared.sum() < 4:
            continue
        d, expected = c.difference[compared], c.sigma[compared] ** 2 - usual.variance
        middles.append(float(np.median(d)))
        differences.append((d - middles[-1]) ** 2 / 0.455 - expected)
        strays.append(float(flag_cells(c).sum() / compared.sum()))
        scatter.append(measure_scatter(c.number, c.over))
    if len(middles) < FEWEST_ROOFS:
        return usual
    cell = np.sqrt(max(float(np.median(np.concatenate(differences))), LEAST_M**2))
    middle = np.median(np.abs(np.array(middles) - np.median(middles))) * 1.4826
    point = np.nanmedian(scatter)
    usual_strays = np.sort(strays)[: max(1, round((1 - CHANGED_SHARE) * len(strays)))]
    values = {"point": point, "cell": cell, "roof": max(middle, LEAST_M)}
    rounded = {name: round(max(float(v), LEAST_M), 4) for name, v in values.items()}
    stray = min(float(np.mean(usual_strays)), MOST_STRAY)
    return SurveyNoise(**rounded, stray=round(stray, 5))


def measure_scatter(number: np.ndarray, values: np.ndarray) -> float:
    """Return the scatter of values (n,) about the median of their cell (n,)."""
    ordered, n = values[np.lexsort([values, number])], np.bincount(number)
    start, has = np.cumsum(n) - n, n >= 3
    spread = ordered[start[has] + (3 * n[has]) // 4] - ordered[start[has] + n[has] // 4]
    return float(np.median(spread) / 1.349) if len(spread) else float("nan")
