"""Make roof shapes of the rows of data/shapes.toml, which explains its columns.

Rows of data/measures.toml say more of their parameters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import CodeType
from typing import Any

import numpy as np

from ..data_files import Values, read_data_file
from .algebra import SYMBOLS, U, V, formula, q0, q1, q2, q3
from .contract import (
    HALF_LENGTH,
    HALF_WIDTH,
    KAPPA,
    Q0,
    SIDES,
    SLOPE_MAX,
    SLOPE_MIN,
    SPIRE_SLOPE_MAX,
    DerivedStart,
    Parameters,
    Primitive,
    Shape,
    Vote,
)

FORMULAS = dict(zip(SYMBOLS, (V, U, q0, q1, q2, q3), strict=True))
LIMITS = {
    "slope": (SLOPE_MIN, SLOPE_MAX),
    "spire": (SLOPE_MIN, SPIRE_SLOPE_MAX),
    "steepest": SLOPE_MAX,
}
BASICS: Values = {"__builtins__": {}, "pi": math.pi, "min": min, "max": max, "range": range}
SHAPE_ROWS: dict[str, Values] = read_data_file("shapes")
PARAMETER_ROWS: dict[str, dict[str, str]] = read_data_file("measures")
for name, row in SHAPE_ROWS.items():
    SHAPE_ROWS[name] = SHAPE_ROWS.get(row.get("like", ""), {}) | row


@cache
def compile_text(text: str) -> CodeType:
    return compile(f"({text})", "shapes.toml", "eval")


def evaluate(text: str, names: Values, definitions: Mapping[str, str] | None = None) -> Any:
    """Return the value of an expression, with the values of `definitions` named.

    Raises KeyError for a name that has no value.

    >>> evaluate("height / v, 0.0", {"height": 3.0}, {"v": "4.0 / 2"})
    (1.5, 0.0)
    """
    values = {**BASICS, **names}
    try:
        for name, part in (definitions or {}).items():
            values[name] = eval(compile_text(part), values)
        return eval(compile_text(text), values)
    except NameError as error:
        raise KeyError(error.name) from error


@dataclass(frozen=True)
class RowFunctions:
    """What a row's expressions say of parameters; they may name `constants`."""

    row: Values
    constants: Values
    names: tuple[str, ...]

    def shape(self, p: Parameters) -> Shape:
        v, u = p["width"] / 2, p["length"] / 2
        q = evaluate(self.row["q"], {**p, **self.constants, "u": u, "v": v})
        return (v, u, *q, *[0.0] * (4 - len(q)))

    def corners(self, p: Parameters) -> Any:
        names = {**p, **self.constants, "u": p["length"] / 2, "v": p["width"] / 2}
        return evaluate(self.row["corners"], names, self.row.get("where"))

    def typical(self, width: float, length: float, height: float) -> dict[str, float]:
        sizes = {"width": width, "length": length, "height": height}
        return self.choose_sizes(self.row.get("typical", {}), sizes)

    def draw(self, rng: np.random.Generator, width: float) -> dict[str, float]:
        chances = {
            "uniform": lambda start, end: float(rng.uniform(start, end)),
            "slope": lambda start, end: math.tan(math.radians(rng.uniform(start, end))),
            "integers": lambda start, end: float(rng.integers(start, end)),
            "random": rng.random,
        }
        return self.choose_sizes(self.row["draw"], {"width": width, **chances})

    def choose_sizes(self, texts: Mapping[str, str], names: Values) -> dict[str, float]:
        """Return the parameters of sizes that are chosen one after the other."""
        chosen = {**self.constants, **names}
        for name, text in texts.items():
            chosen[name] = evaluate(text, chosen)
        return {name: chosen[name] for name in self.names}


def make_shape(key: str, constants: Values | None = None, **changes: Any) -> Primitive:
    """Return a row's shape with `changes`; its expressions may name `constants`."""
    row, constants = SHAPE_ROWS[key], constants or {}
    symbols = {**FORMULAS, **constants}
    measures = {"width": 2 * V, "length": 2 * U} | {
        name: formula(evaluate(text, symbols)) for name, text in row.get("measures", {}).items()
    }
    functions = RowFunctions(row, constants, tuple(measures))
    citygml_code, adv_code, *osm_shapes = row["codes"]
    fields: Values = {
        "name": row.get("variant_of", key),
        "citygml_code": citygml_code,
        "adv_code": adv_code,
        "osm_shape": next(iter(osm_shapes), None),
        "measures": measures,
        "eave": formula(evaluate(row["eave"], symbols)),
        "shape": functions.shape,
        "corners": functions.corners,
        "typical": functions.typical,
        "draw": functions.draw if "draw" in row else None,
        "bounds": evaluate(row.get("bounds", ""), LIMITS),
        "starts": read_starts(row.get("starts", []), symbols),
        "signed": tuple(row.get("signed", ())),
        "more": tuple(make_shape(k) for k, r in SHAPE_ROWS.items() if r.get("variant_of") == key),
    }
    if "planes" in row:
        faces = row["faces"]
        faces = evaluate(faces, constants) if isinstance(faces, str) else faces
        fields["planes"] = tuple(evaluate(row["planes"], symbols))
        fields["faces"] = tuple(map(tuple, faces))
    if "vote" in row:
        vote: Any = {n: tuple(v) if isinstance(v, list) else v for n, v in row["vote"].items()}
        fields["vote"] = Vote(**vote)
    if row.get("canonical"):
        fields["canonical"] = lambda theta: turn_where(row["canonical"], theta)
    if "member" in row:
        fields["read_member"] = lambda member: evaluate(row["member"], name_member(member))
    fields |= {name: row[name] for name in ("legend", "half_turn_symmetric") if name in row}
    return Primitive(**fields | changes)


def read_starts(rows: list[Values], symbols: Values) -> tuple[DerivedStart, ...]:
    """Return a start for each of the quarters of each row."""
    return tuple(
        DerivedStart(
            row["from"],
            evaluate(row["q"], symbols),
            quarters,
            evaluate(row.get("turn", "0.0"), symbols),
        )
        for row in rows
        for quarters in row.get("quarters", [0])
    )


def turn_where(rule: Values, theta: np.ndarray) -> np.ndarray:
    """Return the surface of theta (9,), its axes turned where the rule holds."""
    names = dict(zip(SYMBOLS, theta[HALF_WIDTH:].tolist(), strict=True))
    if not evaluate(rule["when"], names, rule.get("where")):
        return theta
    turned, q = theta.copy(), evaluate(rule["q"], names)
    turned[KAPPA] += rule["quarters"] * math.pi / 2
    if rule["quarters"] % 2:
        turned[[HALF_WIDTH, HALF_LENGTH]] = theta[[HALF_LENGTH, HALF_WIDTH]]
    turned[Q0 : Q0 + len(q)] = q
    return turned


def name_member(member: Any) -> Values:
    """Return by name what a row may say of a member of the family."""
    names = {"v": member.half[1], "ridge": member.apex(1), "top": member.top}
    for side, slope, eave in zip(SIDES, member.slopes, member.eaves, strict=True):
        names |= {side: slope, f"{side}_eave": eave}
    return names
