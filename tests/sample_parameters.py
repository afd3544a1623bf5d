"""A parameters.jsonl written by hand: buildings of several roofs, one with two parts, one with a
hole, one without a model.
"""

import json
from pathlib import Path

HEAD = {
    "hiproof_parameters": 1,
    "crs": "EPSG:7415",
    "unit": "auto",
    "cityjson_offset": [85000.0, 446000.0, 0.0],
    "compose": {},
    "write": {},
}
RING = [[-6.0, -4.0], [6.0, -4.0], [6.0, 4.0], [-6.0, 4.0], [-6.0, -4.0]]
YARD = [[-2.0, -1.0], [-2.0, 1.0], [2.0, 1.0], [2.0, -1.0], [-2.0, -1.0]]
RESIDUALS = {
    "psd_mean": 0.02,
    "psd_std": 0.01,
    "rmse": 0.03,
    "p95": 0.05,
    "share_within_20cm": 0.98,
    "outline_iou": 0.97,
}


def part(kind: str, eave: float = 5.0, **parameters: float) -> dict:
    shape = {"width": 8.0, "length": 12.0, **parameters}
    return {
        "type": kind,
        "parameters": shape,
        "position": [0.0, 0.0, eave],
        "rotation": 0.0,
        "sigma": {"width": 0.02},
    }


def house(id: str, number: int, *parts: dict, rings: list | None = None) -> dict:
    return {
        "id": id,
        "status": "modelled",
        "detail": "",
        "type": parts[0]["type"],
        "origin": [85000.0 + 20 * number, 446000.0, 0.0],
        "parts": list(parts),
        "outline": rings or [RING],
        "shift": [0.0, 0.0],
        "z_ground": 0.0,
        "ground_source": "cloud",
        "terrain_line": [],
        "attributes": {"year": 1905, "name": "mill"},
        "points": 200,
        "residuals": RESIDUALS,
        "types": {parts[0]["type"]: 0.9, "flat": 0.1},
    }


def write_parameters_of_each_kind(path: Path) -> Path:
    """Write the file, and beside it the run.json of the run that it came from."""
    tower = {**part("pyramid", 7.0, height=3.0, width=4.0, length=4.0), "position": [3.0, 1.0, 8.0]}
    buildings = [
        house("gable", 0, part("gable", height=3.0)),
        house("hip and tower", 1, part("hip", height=3.0, ridge_length=4.0), tower),
        house("yard", 2, part("flat"), rings=[RING, YARD]),
        {"id": "lost", "status": "no_points", "detail": "no points", "parts": [], "attributes": {}},
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        "".join(json.dumps(line) + "\n" for line in [HEAD, *buildings]), encoding="utf-8"
    )
    record = {
        "inputs": {"clouds": ["gone.laz"], "bbox": [0, 0, 1, 1]},
        "settings": {"reconstruct": {"align": "auto"}},
    }
    (path.parent / "run.json").write_text(json.dumps(record))
    return path
