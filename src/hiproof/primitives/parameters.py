"""The parameters of each roof type, and whether given ones make a shape of it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..errors import FitError, InputError
from .cants import CANTED, MEASURES, list_cants
from .catalogue import CATALOGUE
from .contract import LEVEL, SIDES, Parameters
from .family import COMPONENTS, list_eaves

# Parameters of a member's sides and cants; a part that has one gives all of its shape side by side.
SIDED = CANTED | {f"{what}_{side}" for side in SIDES for what in ("pitch", "eave", "skew")}

# degrees; steeper is a wall, and its height at an edge is beyond any file's digits
STEEPEST_DEG = 89.0
MOST_SHOWN_NAMES = 8  # names in a sentence; more would hide what is said


def refuse_no_shape(kind: str, parameters: Parameters, where: str) -> None:
    """Raise InputError where `parameters` make no shape of the type `kind`.

    `parameters` are finite numbers by name.

    >>> refuse_no_shape("gable", {"width": -8.0, "length": 12.0, "height": 3.0}, "part 0")
    Traceback (most recent call last):
    hiproof.errors.InputError: expected a positive width of part 0, got -8; give metres
    """
    if kind not in CATALOGUE:
        raise InputError(
            f"expected a roof type ({', '.join(CATALOGUE)}) in {where}, got {kind!r}; choose one"
        )
    for name in ("width", "length"):
        if name in parameters and not parameters[name] > 0.0:
            raise InputError(
                f"expected a positive {name} of {where}, got {parameters[name]:g}; give metres"
            )
    if kind == "flat":
        refuse_other_names(kind, parameters, [], ["width", "length"], where)
    elif not SIDED & parameters.keys():
        refuse_other_names(
            kind, parameters, CATALOGUE[kind].variant(parameters).parameters, [], where
        )
        refuse_falling(kind, parameters, where)
    else:
        refuse_no_member(kind, parameters, where)


def refuse_other_names(
    kind: str,
    parameters: Parameters,
    required: Sequence[str],
    allowed: Sequence[str],
    where: str,
) -> None:
    """Raise InputError where a parameter is missing or is none of the type's."""
    missing = [name for name in required if name not in parameters]
    other = [name for name in parameters if name not in (*required, *allowed)]
    if missing or other:
        got = (
            f"none for {', '.join(missing)}"
            if missing
            else f"also {', '.join(other[:MOST_SHOWN_NAMES])}"
        )
        raise InputError(
            f"expected the parameters {', '.join(required) or 'width, length'} of the type {kind} "
            f"in {where}, got {got}; `hiproof build --shapes` lists those of every type"
        )


def refuse_falling(kind: str, parameters: Parameters, where: str) -> None:
    """Raise InputError where a plane falls from its eave or stands upright."""
    shape = CATALOGUE[kind]
    try:
        theta = shape.variant(parameters).to_theta(parameters)
        shape.from_theta(theta)
        q = theta[6:]
    except FitError as error:
        raise InputError(f"{where}: {error}") from error
    except ZeroDivisionError:
        q = np.full(3, np.inf)
    slopes = [value for value, (lower, _) in zip(q, shape.bounds, strict=False) if lower >= 0.0]
    steepest = math.tan(math.radians(STEEPEST_DEG))
    if not all(0.0 <= slope <= steepest for slope in slopes):
        text = ", ".join(f"{name} {value:g}" for name, value in parameters.items())
        raise InputError(
            f"expected planes that rise from the eaves by less than {STEEPEST_DEG:g} degrees, got "
            f"the roof type {kind} with {text} "
            f"in {where}; is one of its sizes negative, or too long?"
        )


def refuse_no_member(kind: str, parameters: Parameters, where: str) -> None:
    """Raise InputError where each side's parameters make no member of the family."""
    if kind in COMPONENTS:
        refuse_other_names(kind, parameters, list(CATALOGUE[kind].parameters), [], where)
    side_parameters = list_side_parameters(kind)
    skews = [name.replace("pitch", "skew") for name in side_parameters if name.startswith("pitch_")]
    cants = [f"{measure}_{cant}" for cant in list_cants(parameters) for measure in MEASURES]
    refuse_other_names(kind, parameters, [*side_parameters, *cants], skews, where)
    for name, value in parameters.items():
        lower = 0.0 if name.startswith("pitch_") else -STEEPEST_DEG
        if name.startswith(("pitch_", "skew_")) and not lower <= value <= STEEPEST_DEG:
            raise InputError(
                f"expected {name} between {lower:g} and {STEEPEST_DEG:g} degrees in {where}, got "
                f"{value:g}; give degrees"
            )


def list_parameters(kind: str) -> tuple[str, ...]:
    """Return the names of the parameters of an ordinary roof of a type.

    >>> list_parameters("hip"), list_parameters("corner")
    (('width', 'length', 'height', 'ridge_length'), ('width', 'length', 'height', 'end_height'))
    """
    return CATALOGUE[kind].parameters


def list_side_parameters(kind: str) -> tuple[str, ...]:
    """Return the names of each side's own parameters, without the rare skews and cants."""
    shape = CATALOGUE[kind]
    of_sides = [
        f"{subject}_{SIDES[side]}" for side in list_eaves(shape) for subject in ("pitch", "eave")
    ]
    return ("width", "length", *(["height"] if LEVEL in shape.sides else []), *of_sides)
