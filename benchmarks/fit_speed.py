"""CPU time of fitting one roof, all types tried, after warm-up.

The paper's objective is measured on the same roofs.

python -m benchmarks.fit_speed [--quick]
"""

from __future__ import annotations

import argparse
import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from hiproof.fit.single import fit_roof
from hiproof.primitives import CATALOGUE
from hiproof.settings import Settings

from .roofs import DENSITY, draw_roof, scan

POINTS = 310


def main() -> None:
    """Print median and mean CPU milliseconds a roof, and their ratio.

    Both objectives are measured.
    """
    parser = argparse.ArgumentParser(
        description="CPU time of fit_roof on simulated roofs of about 300 points"
    )
    parser.add_argument(
        "--quick", action="store_true", help="one repetition, the paper's objective on two roofs"
    )
    quick = parser.parse_args().quick
    rng = np.random.default_rng(22)
    clouds = [
        scan(draw_roof(name, rng), DENSITY, rng, outlier_share=0.03)
        for name in CATALOGUE
        for _ in range(2)
    ]
    clouds = [rng.permutation(cloud)[:POINTS] for cloud in clouds]
    fit_roof(clouds[0])
    repetitions = 1 if quick else 7
    model = np.median(
        [[measure_cpu_ms(cloud, "likelihood") for cloud in clouds] for _ in range(repetitions)],
        axis=0,
    )
    print(
        f"likelihood: median {np.median(model):.2f}, mean {model.mean():.2f} ms a roof of {POINTS} "
        "points, all types"
    )
    request = slice(0, len(clouds), 10 if quick else 4)
    fit_roof(
        clouds[0], settings=Settings.from_dict({"fit": {"types": ["flat"], "objective": "paper"}})
    )
    papers = np.array([measure_cpu_ms(cloud, "paper") for cloud in clouds[request]])
    print(
        f"paper:      median {np.median(papers):.0f}, mean {papers.mean():.0f} ms on {len(papers)} "
        "of these roofs"
    )
    print(f"ratio of the means on the same roofs: {papers.mean() / model[request].mean():.0f}")


def measure_cpu_ms(cloud: np.ndarray, objective: str) -> float:
    """Measure the CPU time (ms) of one fit."""
    settings = Settings.from_dict({"fit": {"objective": objective}})
    start = time.process_time()
    fit_roof(cloud, settings=settings)
    return 1e3 * (time.process_time() - start)


if __name__ == "__main__":
    main()
