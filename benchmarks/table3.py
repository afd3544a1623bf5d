"""The paper's Table 3: errors of dimensions and translation over simulated roofs. python -m benchmarks.table3 [--quick]"""

from __future__ import annotations

import argparse

import numpy as np

from hiproof.fit.single import fit_roof
from hiproof.settings import Settings

from .roofs import DENSITY, NOISE_RMSE_M, TrueRoof, paper_noise, random_roof, scan

TYPES = ("pyramid", "gable", "hip")
PAPER = {"pyramid": (0.120, 4.37, 0.020), "gable": (0.217, 5.55, 0.046), "hip": (0.462, 5.90, 0.030)}


def main() -> None:
    """Print RMSE of dimensions (m and %) and of the translation (m) by type, beside the paper's."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="5 roofs x 4 trials a type instead of 20 x 30")
    parser.add_argument("--objective", default="likelihood", choices=("likelihood", "paper"))
    parser.add_argument("--density", type=float, default=DENSITY, help="points a square metre")
    arguments = parser.parse_args()
    roofs, trials = (5, 4) if arguments.quick else (20, 30)
    every: list[np.ndarray] = []
    print(f"{'type':8} {'dims m':>8} {'dims %':>7} {'T m':>8} {'sigma ratio':>12}   (the paper's dims m, %, T m)")
    for name in TYPES:
        errors = np.array(list(errors_of(name, roofs, trials, arguments.objective, arguments.density)))
        every.append(errors)
        print(f"{name:8} {summary(errors)}   {PAPER[name]}")
    print(f"{'all':8} {summary(np.concatenate(every))}   (0.266, 5.27, 0.032)")
    if arguments.objective == "likelihood":
        ridge, slope = against_cramer_rao(roofs, trials, arguments.density)
        print(
            f"gable against the Cramer-Rao bound of least squares: ridge height {ridge:.2f}, slope {slope:.2f} times it"
        )


def errors_of(name: str, roofs: int, trials: int, objective: str, density: float):
    """One row a fit: mean square of dimension errors, of relative ones, of the translation's, of errors over sigma."""
    rng, settings = np.random.default_rng(20), Settings.from_dict({"fit": {"types": [name], "objective": objective}})
    for _ in range(roofs):
        roof = random_roof(name, rng)
        for _ in range(trials):
            yield squared_errors(roof, fit_roof(scan(roof, density, rng), settings=settings))


def squared_errors(roof: TrueRoof, fit) -> np.ndarray:
    """Mean squares (4,) of one fit's errors."""
    truth = np.array(list(roof.theta_p.values()))
    error = np.array([fit.parameters[key] for key in roof.theta_p]) - truth
    translation = fit.translation + fit.global_translation - roof.translation
    sigma = np.array([fit.sigma.get(key, np.nan) for key in roof.theta_p])
    rows = error**2, (error / truth) ** 2, translation**2, (error / sigma) ** 2
    return np.array([np.mean(row) for row in rows])


def against_cramer_rao(roofs: int, trials: int, density: float) -> tuple[float, float]:
    """RMSE of a gable's ridge height and slope over their Cramer-Rao bound, for normal noise of the same variance."""
    rng, only_gables = np.random.default_rng(23), Settings.from_dict({"fit": {"types": ["gable"]}})
    sigma = NOISE_RMSE_M * np.std(paper_noise(100_000, rng))
    scores = []
    for _ in range(roofs):
        roof = random_roof("gable", rng)
        slope, ridge = 2 * roof.theta_p["height"] / roof.theta_p["width"], roof.translation[2] + roof.theta_p["height"]
        for _ in range(trials):
            points = scan(roof, density, rng)
            fit = fit_roof(points, settings=only_gables)
            c, s = np.cos(roof.kappa), np.sin(roof.kappa)
            u, v = ((points[:, :2] - roof.translation[:2]) @ np.array([[c, -s], [s, c]])).T
            design = np.column_stack([np.ones(len(u)), -np.abs(v), slope * np.sign(v), slope * np.sign(v) * u])
            bound = sigma * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
            height = fit.parameters["height"]
            found = fit.translation[2] + fit.global_translation[2] + height, 2 * height / fit.parameters["width"]
            scores.append(((found[0] - ridge) / bound[0], (found[1] - slope) / bound[1]))
    return tuple(np.sqrt(np.mean(np.square(scores), axis=0)))


def summary(errors: np.ndarray) -> str:
    """RMSEs of rows of `squared_errors`, formatted."""
    dims, relative, translation, ratio = np.sqrt(errors.mean(axis=0))
    return f"{dims:8.4f} {100 * relative:7.2f} {translation:8.4f} {ratio:12.2f}"


if __name__ == "__main__":
    main()
