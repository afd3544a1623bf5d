"""392 real New York roofs, as one primitive each or as compounds.

They are fitted to all points and judged on those of the roof.

python -m benchmarks.nyc [--compounds] [--quick] [--data FILE]: point-surface distance (PSD, to the
bounded roof surfaces) of the points with face > 0, beside the IoU of the plan with the points'
alpha shape, since a larger outline games the PSD. `--compounds` reconstructs each roof without a
footprint, of as many parts as the evidence pays for.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from hiproof.evaluate.metrics import iou, plan_outline, psd
from hiproof.fit.single import fit_roof
from hiproof.geometry.alpha_shape import alpha_shape
from hiproof.method import reconstruct
from hiproof.model import Fit, Solid

DATA = Path("../shared/data/roofn3d/nyc_roofs.npz")


def fit_points(points: np.ndarray, compounds: bool) -> tuple[Fit | Solid, str, int]:
    """Return the roof of `points` (n, 3), its type and number of parts.

    The type is that of its largest part.
    """
    if not compounds:
        fit = fit_roof(points)
        return fit, fit.type, 1
    building = reconstruct(points)
    return building.solid, building.type, len(building.parts)


def main() -> None:
    """Print mean, median and tail of the PSD over roofs.

    The types chosen and the worst ten follow.
    """
    parser = argparse.ArgumentParser(
        description="PSD of one primitive a roof on real New York roofs"
    )
    parser.add_argument("--quick", action="store_true", help="every eighth roof")
    parser.add_argument("--compounds", action="store_true", help="several parts a roof")
    parser.add_argument("--data", type=Path, default=DATA, help="nyc_roofs.npz")
    arguments = parser.parse_args()
    with np.load(arguments.data) as data:
        points, face, offset = data["points"].astype(float), data["face"], data["offset"]
    indices = np.arange(0, len(offset) - 1, 8 if arguments.quick else 1)
    distance, overlap, parts = np.zeros((3, len(indices)))
    types = Counter()
    for k, i in enumerate(indices):
        roof = slice(offset[i], offset[i + 1])
        fit, type, parts[k] = fit_points(points[roof], arguments.compounds)
        judged = points[roof][face[roof] > 0]
        distance[k] = psd(fit, judged).mean()
        overlap[k] = iou(plan_outline(fit), alpha_shape(judged[:, :2]))
        types[type] += 1
    print(
        f"PSD over {len(indices)} roofs: mean {distance.mean():.4f}, median "
        f"{np.median(distance):.4f}, ",
        end="",
    )
    print(
        f"90th percentile {np.percentile(distance, 90):.4f} m; {100 * np.mean(distance > 0.3):.1f} "
        "% above 0.3 m"
    )
    print(f"IoU with the alpha shape: mean {overlap.mean():.3f}, median {np.median(overlap):.3f}")
    print(f"parts a roof: {parts.mean():.2f}")
    print("types: " + ", ".join(f"{name} {count}" for name, count in types.most_common()))
    worst = np.argsort(-distance)[:10]
    print("worst ten: " + ", ".join(f"{indices[k]} ({distance[k]:.2f})" for k in worst))


if __name__ == "__main__":
    main()
