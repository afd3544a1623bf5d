"""The task of a work tile by name, for processes that have imported nothing yet."""

from __future__ import annotations

from ..city.ledger import Outcome


def update_tile(
    folder: str, tile: str, terrain: str | None = None, avoid: tuple[int, ...] = ()
) -> list[Outcome]:
    """Bring a work tile up to date; see solve.py."""
    from . import solve

    return solve.update_tile(folder, tile, terrain, avoid)
