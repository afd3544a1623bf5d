"""Streets of houses of known sizes, as the parameters.jsonl of a run."""

import json
import math
from pathlib import Path

from hiproof.enrich.answer import answer
from hiproof.enrich.party import Town
from hiproof.enrich.records import Records, index_records
from sample_parameters import HEAD

WORLD = (85000.0, 446000.0, 0.0)


def place_house(id, x, y, front=6.0, depth=10.0, eave=6.0, rise=0.0, turn=0.0, **attributes):
    """Return a house from (x, y), a gable along the front for a rise, turned by degrees."""
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))

    def rotate(u, v):
        return [c * u - s * v, s * u + c * v]

    corners = [(x, y), (x + front, y), (x + front, y + depth), (x, y + depth)]
    parameters = {"width": depth, "length": front} | ({"height": rise} if rise else {})
    part = {"type": "gable" if rise else "flat", "parameters": parameters, "rotation": turn}
    part["position"] = [*rotate(x + front / 2, y + depth / 2), eave]
    return {
        "id": id,
        "status": "modelled",
        "origin": list(WORLD),
        "outline": [[rotate(*corner) for corner in corners]],
        "parts": [part],
        "z_ground": 0.0,
        "attributes": attributes,
    }


def lose_house(id, x, y, front=6.0, depth=10.0):
    """Return the record of a building without a model."""
    record = place_house(id, x, y, front, depth)
    corners = [[WORLD[0] + u, WORLD[1] + v] for u, v in record["outline"][0]]
    return {"id": id, "status": "no_points", "outline": [corners], "parts": [], "attributes": {}}


def write_street(folder: Path, houses, **head) -> Path:
    """Write the parameters.jsonl of `houses` into `folder`, and return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [json.dumps(line) + "\n" for line in [{**HEAD, **head}, *houses]]
    (folder / "parameters.jsonl").write_text("".join(lines), encoding="utf-8")
    return folder


def open_street(folder: Path, houses, **options) -> Town:
    """Return the town of `houses`, whose file is written into `folder`."""
    path = write_street(folder, houses) / "parameters.jsonl"
    return Town(Records(path, index_records(path)), **options)


def answer_street(folder: Path, houses, **options):
    """Return the answers about `houses` by id."""
    town = open_street(folder, houses, **options)
    answers = [answer(town, number) for number in range(len(town.records))]
    return {result.building.id: result for result in answers}


def list_party(answers):
    """Return the area of every party wall by (building, neighbour)."""
    return {
        (id, other): area
        for id, result in answers.items()
        for other, area in json.loads(result.attributes.get("hiproof_party_walls", "{}")).items()
    }
