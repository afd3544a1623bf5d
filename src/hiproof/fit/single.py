"""One primitive fitted to the points of one roof: the door to both objectives."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from ..errors import FitError
from ..frames import LocalFrame
from ..geometry.point_in_polygon import find_inside
from ..log import count_things
from ..model import Fit
from ..primitives import CATALOGUE, get
from ..primitives.contract import (
    CX,
    CY,
    HALF_LENGTH,
    HALF_WIDTH,
    KAPPA,
    Q0,
    RECTANGLE,
    Primitive,
    place_vertices,
)
from ..read.plausible import is_plausible
from ..settings import Settings
from .direction import outline_rectangle
from .likelihood import Estimate, find_covariance, fit_heights, fit_likelihood, plan_extents

FEWEST_POINTS = 4  # points; a plane and one to contradict it
THINNEST = 1e-6  # smallest ratio of extents in plan that is not a line
UNTOLD = 100.0  # m, rad; a deviation as large is none: heights tell no direction of a level roof
# Points of a round roof lie so near its axis (shares of the first radius), and to its surface.
HULL_REACH, HULL_SIGMAS = 1.3, 4.0
HULL_ROUNDS = 2  # The first plan of a half disc is far too narrow.
# A regular plan may lie so much further (m, in the mean) from the points than a free one.
FARTHER_M = 0.01
WIDTH_ROUNDS = 2  # Rounds in which points are taken from within a regular plan.
# What points determine of regular plans. Of a spire, they show no width.
REGULAR = {
    "broach": (CX, CY, KAPPA),
    "hexagonal_spire": (CX, CY, KAPPA),
    "onion": (CX, CY, HALF_WIDTH),
}
HULL_SPACINGS = 0.3  # The hull of points lies so much inside of what they are drawn from.


def fit_roof(
    points: np.ndarray,
    outline: shapely.Polygon | None = None,
    settings: Settings | None = None,
    weights: np.ndarray | None = None,
    type_log_prior: dict[str, float] | None = None,
) -> Fit:
    """Fit the roof primitive that explains `points` best.

    points          (n, 3) metres in any frame; points that are not finite, or not on Earth, are
                    dropped, and their order does not matter
    outline         a given plan, in the frame of `points`: the roof covers its rectangle in the
                    roof's own direction, and
                    only heights, slopes and ridge are fitted, to the points inside it
    settings        `fit.types` are the names of the catalogue to choose among, all by default;
                    `fit.objective` is the likelihood
                    (fit/likelihood.py) or "paper" (fit/paper.py, the published method)
    weights         (n,) probability of each point of being roof, 1 by default
    type_log_prior  natural logarithm of each type's probability before its points are seen, 0 by
                    default

    Raises FitError where no roof can be determined: no or fewer than four such points that may be
    roof, all in one place or on a line, an outline that is no polygon. SettingsError for types that
    the catalogue does not hold.

    >>> import numpy as np
    >>> x, y = np.meshgrid(np.linspace(-6, 6, 25), np.linspace(-4, 4, 17))
    >>> gable = np.stack([x.ravel(), y.ravel(), 8 - 0.7 * np.abs(y.ravel())], axis=1)
    >>> fit = fit_roof(gable)
    >>> fit.type, round(fit.parameters["height"], 1)
    ('gable', 2.8)
    >>> fit_roof(gable, settings=Settings.from_dict({"fit": {"types": ["flat", "hip"]}})).type
    'hip'
    """
    settings = settings or Settings()
    names = checked_types(settings.fit.types)
    cloud = usable_points(points, weights, outline)
    if settings.fit.objective == "paper":
        from .paper import fit_paper

        return fit_paper(cloud[:, :3], settings.fit.types, outline, settings)
    frame = LocalFrame.around(cloud)
    local = np.column_stack([frame.to_local(cloud[:, :3]), cloud[:, 3]])
    outline_local = None if outline is None else shapely.transform(outline, frame.to_local)
    taus = settings.fit.side_softness_m
    estimate = fit_likelihood(local, names, outline_local, taus, type_log_prior)
    if outline is None and estimate.primitive.rim != RECTANGLE:
        estimate = fit_within_hull(local, estimate)
    if outline is None and estimate.primitive.name in REGULAR:
        estimate = make_regular(local, estimate)
    if outline is not None and estimate.primitive.name == "barrel":
        estimate = fit_at_right_angles(local, estimate)
    return as_fit(estimate, frame, len(local))


def fit_within_hull(cloud: np.ndarray, estimate: Estimate) -> Estimate:
    """Fit a round roof's heights again, over the hull of the points (n, 4) on it.

    A rectangle's sides are too narrow for it: hardly any points lie where a circle touches them.
    The covariance stays that of the free plan.
    """
    shape, theta, noise = estimate.primitive, estimate.theta.copy(), estimate.noise
    reach_m = HULL_SIGMAS * noise.sigma
    for _ in range(HULL_ROUNDS):
        farthest = np.hypot(*(np.array(shape.rim) * theta[[HALF_LENGTH, HALF_WIDTH]]).T).max()
        reach = np.hypot(*(cloud[:, :2] - theta[:2]).T) <= HULL_REACH * farthest
        distance = np.abs(cloud[:, 2] - shape.height_at(theta, cloud[:, :2]))
        on_roof = cloud[reach & (distance <= reach_m)]
        hull = shapely.convex_hull(shapely.multipoints(on_roof[:, :2]))
        if not isinstance(hull, shapely.Polygon):
            break
        hull = shapely.buffer(hull, HULL_SPACINGS * math.sqrt(hull.area / len(on_roof)))
        inside = cloud[find_inside(hull, *cloud[:, :2].T)]
        theta[:Q0] = outline_rectangle(hull, theta[KAPPA])
        theta, noise = fit_heights(inside, shape, theta)
        slopes = np.hypot(*shape.plane_values(theta)[:, :2].T)
        reach_m = HULL_SIGMAS * noise.sigma * math.hypot(1.0, float(slopes.mean()))
    return replace(estimate, theta=theta, noise=noise)


def fit_at_right_angles(cloud: np.ndarray, estimate: Estimate) -> Estimate:
    """Fit the heights of a vault over a given plan again, by distances at right angles.

    Points (n, 4) that lie beside their place in plan lie far off in height where it is steep. A
    vault ends where its walls do, or within them: it errs as far as points alone tell another one.
    """
    shape = estimate.primitive
    theta, noise = fit_heights(cloud, shape, estimate.theta)
    by_points, _ = fit_heights(cloud, shape, theta, (HALF_WIDTH,))
    error = by_points - theta
    error[HALF_LENGTH] = 0.0
    covariance = find_covariance(cloud, shape, theta, ()) + np.outer(error, error)
    return replace(estimate, theta=theta, covariance=covariance, noise=noise)


def make_regular(cloud: np.ndarray, estimate: Estimate) -> Estimate:
    """Fit a spire or an onion as long as wide, if points (n, 4) lie as near then.

    A width that these do not show keeps the variance of the free plan.
    """
    shape, theta = estimate.primitive, estimate.theta.copy()
    theta[[HALF_WIDTH, HALF_LENGTH]] = theta[[HALF_WIDTH, HALF_LENGTH]].min()
    free = REGULAR[shape.name]
    for _ in range(WIDTH_ROUNDS):
        inside = cloud[np.hypot(*(cloud[:, :2] - theta[:2]).T) <= theta[HALF_WIDTH]]
        theta, noise = fit_heights(inside, shape, theta, free)
    _, before = fit_heights(inside, shape, estimate.theta)
    if noise.sigma > before.sigma + FARTHER_M:
        return estimate
    width_variance = max(estimate.covariance[k, k] for k in (HALF_WIDTH, HALF_LENGTH))
    width_variance *= HALF_WIDTH not in free
    covariance = find_covariance(inside, shape, theta, free, width_variance)
    return replace(estimate, theta=theta, covariance=covariance, noise=noise)


def checked_types(types: tuple[str, ...]) -> tuple[str, ...]:
    """Return known `types` in the catalogue's order; all for an empty tuple.

    Raises SettingsError for an unknown one.
    """
    for name in types:
        get(name)
    return tuple(name for name in CATALOGUE if not types or name in types)


def usable_points(
    points: np.ndarray, weights: np.ndarray | None, outline: shapely.Polygon | None
) -> np.ndarray:
    """Return finite points inside the outline, in lexicographic order.

    They are (n, 4): x, y, z, weight.

    Raises FitError for too few.
    """
    points = np.asarray(points, float)
    if points.ndim != 2 or points.shape[1] < 3:
        raise FitError(
            f"expected points of shape (n, 3), got {points.shape}; give x, y and z in metres"
        )
    if outline is not None and not isinstance(outline, shapely.Polygon):
        raise FitError(
            f"expected a polygon of shapely as outline, got {type(outline).__name__}; give one "
            "polygon"
        )
    weights = np.ones(len(points)) if weights is None else np.asarray(weights, float)
    if weights.shape != (len(points),) or not np.all((weights >= 0) & (weights <= 1)):
        raise FitError(
            f"expected {len(points)} weights between 0 and 1, got shape {weights.shape}; give one "
            "a point"
        )
    finite = is_plausible(points[:, :3])
    cloud = np.column_stack([points[finite, :3], weights[finite]])
    text = "finite points"
    if outline is not None:
        cloud = cloud[find_inside(outline, cloud[:, 0], cloud[:, 1])]
        text = "finite points inside the outline"
    count = np.count_nonzero(cloud[:, 3])
    if count < FEWEST_POINTS:
        raise FitError(
            f"expected at least {FEWEST_POINTS} {text} to fit a roof, got {count} of "
            f"{len(points)} given; "
            "a flat roof at their median height is all that can be said"
        )
    cloud = cloud[np.lexsort(cloud.T[::-1])]
    narrow, wide = plan_extents(cloud[:, :2])
    if narrow <= max(THINNEST * wide, 1e-6):
        shape = "in one place" if wide < 1e-6 else "on one line in plan"
        raise FitError(
            f"expected points spread over a roof, got {count_things(len(cloud), 'point')} {shape}; "
            "add "
            "points beside it"
        )
    return cloud


def as_fit(estimate: Estimate, frame: LocalFrame, points_used: int) -> Fit:
    """Return the estimate in the terms of the paper.

    They are theta_p, kappa, T_L, T_G, standard deviations, vertices and faces.
    """
    theta_p, kappa, translation = estimate.primitive.from_theta(estimate.theta)
    shape = estimate.primitive.variant(theta_p)
    sigma = find_deviations(shape, estimate.theta, estimate.covariance)
    vertices = place_vertices(shape.vertices(theta_p), kappa, translation)
    return Fit(
        type=shape.name,
        parameters=theta_p,
        kappa=kappa,
        translation=translation,
        global_translation=frame.origin,
        sigma=sigma,
        objective="likelihood",
        value=estimate.value,
        bic=estimate.bics[shape.name],
        bics=estimate.bics,
        points_used=points_used,
        noise_m=estimate.noise.sigma,
        outlier_share=estimate.noise.eps,
        evaluations=estimate.evaluations,
        part=shape.part(estimate.theta, sigma),
        vertices=frame.to_world(vertices),
        faces=shape.faces,
    )


def find_deviations(
    shape: Primitive, theta: np.ndarray, covariance: np.ndarray
) -> dict[str, float]:
    """Find standard deviations by name, by the delta method.

    Gradients of the named formulas go through theta's covariance (9, 9).

    What the points do not tell has none, as in a fit of several parts; what a given outline tells
    is exact, 0, but for the width of a vault.
    """
    values = theta[HALF_WIDTH:]
    names = {**shape.measures, "t_z": shape.eave}
    gradients = np.zeros((len(names), 9))
    for row, measure in zip(gradients, names.values(), strict=True):
        row[HALF_WIDTH:] = measure.gradient(values)
    variances = np.einsum("ij,jk,ik->i", gradients, covariance, gradients)
    sigma = {
        name: math.sqrt(max(variance, 0.0)) for name, variance in zip(names, variances, strict=True)
    }
    for name, k in (("kappa", KAPPA), ("t_x", 0), ("t_y", 1)):
        sigma[name] = math.sqrt(max(covariance[k, k], 0.0))
    return {name: deviation for name, deviation in sigma.items() if deviation < UNTOLD}
