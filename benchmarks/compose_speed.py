"""Time of composing and checking one building.

`python -m benchmarks.compose_speed` measures process time after one warm-up.

Prints, for each kind of generated roof and for a typical compound building (five pieces over a
footprint of twelve vertices), the median and the largest time of `compose` (its check included) and
of `check_solid` alone.
"""

from __future__ import annotations

import time

import numpy as np
import shapely
from tests.roof_zoo import KINDS, gable_planes, generate_roof, random_planes, roof

from hiproof.compose import check_solid, compose
from hiproof.model import Piece

ROOFS_A_KIND = 200


def make_compound(seed: int):
    """Make a house with wings, a lower extension and a dormer.

    It has five pieces over twelve vertices.
    """
    rng = np.random.default_rng(seed)
    boxes = [(0, 0, 14, 8), (14, 1, 19, 7), (4, 8, 9, 13), (-3, 2, 0, 6), (6, 2, 8, 4)]
    planes = [
        gable_planes(7, 4, 9, rng.uniform(0.4, 1.2), 0),
        *(random_planes(rng, box) - [0, 0, 3] for box in boxes[1:]),
    ]
    pieces = [Piece(shapely.box(*box), k) for box, k in zip(boxes, planes, strict=True)]
    return roof(pieces, shapely.union_all([piece.outline for piece in pieces]))


def time_call(run, argument) -> tuple[float, object]:
    start = time.process_time()
    result = run(argument)
    return 1e3 * (time.process_time() - start), result


def main() -> None:
    compose(make_compound(0), 0.0)
    cases = {kind: [generate_roof(kind, seed) for seed in range(ROOFS_A_KIND)] for kind in KINDS}
    cases["compound, 5 pieces"] = [make_compound(seed) for seed in range(ROOFS_A_KIND)]
    print(
        f"{'kind':20} {'faces':>6} {'compose ms, median':>19} {'largest':>8} "
        f"{'check ms, median':>17}"
    )
    for kind, roofs in cases.items():
        composed = [time_call(lambda product: compose(product, 0.0), product) for product in roofs]
        checked = [time_call(check_solid, solid)[0] for _, solid in composed]
        times, faces = [ms for ms, _ in composed], [len(solid.faces) for _, solid in composed]
        print(
            f"{kind:20} {np.median(faces):6.0f} {np.median(times):19.2f} {max(times):8.2f} "
            f"{np.median(checked):17.3f}"
        )


if __name__ == "__main__":
    main()
