"""Are roofs called what they are?

The demo's 26 buildings and 12 labelled real roofs through `reconstruct`.

usage: python -m benchmarks.named_roofs [--data ../shared/data/roofn3d/labelled]

The demo's buildings are reconstructed under their footprints: `main` counts those whose largest
part has the true type, `all` those with the true number of parts, each found with its type
(matching.py says how). The labelled roofs come without footprints and are right where the largest
part has the label, an asymmetric gable counting as a gable; how many parts they have is printed
beside. Every building that is not right is named.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path

import numpy as np

from hiproof import read_footprints, read_points, reconstruct
from hiproof.geometry.point_grid import assign_points
from hiproof.model import Building, Footprint, Part, Roof
from hiproof.simulate import SimBuilding, demo_files, read_truth

from .compounds import compare_parts
from .judging import SHARED
from .matching import list_right_types

BUILDING_CLASS = 6


def read_demo() -> list[tuple[SimBuilding, np.ndarray, Footprint]]:
    """Return true building, points (n, 3) and footprint of the demo's houses.

    All are in world metres.
    """
    files = demo_files()
    cloud = read_points(files["cloud"])
    points = cloud.xyz[cloud.classification == BUILDING_CLASS]
    footprints = list(read_footprints(files["footprints"]))
    truth = {
        record["id"]: read_truth(record)
        for record in json.loads(files["truth"].read_text())["buildings"]
    }
    indices = assign_points(points, footprints)
    return [(truth[f.id], points[index], f) for index, f in zip(indices, footprints, strict=True)]


def move_parts(roof: Roof, origin: np.ndarray) -> tuple[Part, ...]:
    """Return the parts of `roof` in the frame at `origin` (3,), world."""
    shift = roof.frame.origin - origin
    return tuple(
        dataclasses.replace(
            part,
            translation=part.translation + shift,
            pieces=tuple(piece.move(shift) for piece in part.pieces),
        )
        for part in roof.parts
    )


def name_parts(parts: tuple[Part, ...]) -> str:
    return ", ".join(part.type for part in parts)


def judge_types(truth: SimBuilding, model: Building) -> tuple[bool, bool]:
    """Return whether the largest part, and whether all, have their types.

    All parts have to be there.
    """
    largest = max(truth.roof.parts, key=lambda part: part.area)
    main = model.type in list_right_types(largest, hidden=False)
    _, all_right, _ = compare_parts(truth.roof, move_parts(model.roof, truth.roof.frame.origin))
    return main, all_right


def report_demo() -> str:
    lines, right = [], []
    for truth, points, footprint in read_demo():
        model = reconstruct(points, footprint)
        right.append(judge_types(truth, model))
        if not all(right[-1]):
            lines.append(
                f"  {footprint.id} ({truth.kind}): {name_parts(truth.roof.parts)} taken for "
                f"{name_parts(model.parts)}"
            )
    main, n_all_right = np.sum(right, axis=0)
    return "\n".join([f"demo: main type {main}, all parts {n_all_right} of {len(right)}", *lines])


def report_labelled(folder: Path) -> str:
    lines, right, parts = [], 0, []
    files = sorted(folder.glob("*/*.pts"))
    for path in files:
        model = reconstruct(np.loadtxt(path)[:, :3])
        name = "gable" if model.type == "asymmetric_gable" else model.type
        right += name == path.parent.name
        parts.append(len(model.parts))
        if name != path.parent.name:
            lines.append(f"  {path.parent.name} {path.stem} taken for {name_parts(model.parts)}")
    return "\n".join(
        [
            f"labelled roofs: {right} of {len(files)} right, {np.mean(parts):.2f} parts a roof",
            *lines,
        ]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=SHARED / "data/roofn3d/labelled")
    arguments = parser.parse_args()
    print(report_demo(), flush=True)
    print(report_labelled(arguments.data))


if __name__ == "__main__":
    main()
