"""Optional packages: an extra of the install brings each, and one sentence names it."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from .errors import InputError


def import_extra(package: str, extra: str, purpose: str, alternative: str = "") -> Any:
    """Import the module `package` for a `purpose`.

    Raises InputError where it cannot be imported, with the `extra` that brings it. `alternative` is
    how to do without, where that is another way to what was asked for.

    >>> import_extra("maths", "all", "sums")
    Traceback (most recent call last):
    hiproof.errors.InputError: ...
    """
    try:
        return import_module(package)
    except ImportError as error:
        advice = f"try: pip install 'hiproof[{extra}]'" + (
            f", or {alternative}" if alternative else ""
        )
        raise InputError(
            f"expected the package {package} for {purpose}, got: {error}; {advice}"
        ) from error
