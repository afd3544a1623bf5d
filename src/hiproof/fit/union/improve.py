"""Make all moves in turn while they lower the objective. Compiled."""

from __future__ import annotations

from ...compiled import compiled
from .around import measure_context
from .edges import NO_GAIN, move_edges
from .facings import face_walls
from .moves import (
    add_planes,
    change_ties,
    drop_planes,
    drop_volumes,
    move_all_edges,
    refit_volume,
)
from .objective import compute_objective
from .volumes import LEVEL, OFFSET0


@compiled
def improve(volumes, scene, value, slopes, rounds):
    """Make all moves in turn, for at most `rounds` rounds.

    It ends earlier if a round brings next to nothing.
    """
    for _ in range(rounds):
        value_before = value
        for k in range(len(volumes)):
            context = measure_context(volumes, scene.U, scene.V, k)
            volumes, value = refit_volume(volumes, scene, value, k, context)
        for k in range(1, len(volumes)):
            context = measure_context(volumes, scene.U, scene.V, k)
            value = move_edges(volumes, scene, k, value, context)
        volumes, value = drop_volumes(volumes, scene, value)
        for k in range(1, len(volumes)):
            volumes, value = change_planes(volumes, scene, value, k, slopes)
        volumes, value = drop_base(volumes, scene, value)
        if value > value_before - 0.05 * scene.unit:
            break
    return volumes, value


@compiled
def change_planes(volumes, scene, value, k, slopes):
    """Make all moves that change which planes volume k has, their ties and facings."""
    context = measure_context(volumes, scene.U, scene.V, k)
    volumes, value = drop_planes(volumes, scene, value, k, context)
    volumes, value = change_ties(volumes, scene, value, k, context)
    volumes, value = face_walls(volumes, scene, value, k, context)
    return add_planes(volumes, scene, value, k, slopes, context)


@compiled
def drop_base(volumes, scene, value):
    """Lower the base below everything, if the volumes can cover the outline alone."""
    if volumes[0, OFFSET0 + LEVEL] <= scene.low - 0.6:
        return volumes, value
    trial = volumes.copy()
    trial[0, OFFSET0 + LEVEL] = scene.low - 0.7
    trial_value = compute_objective(trial, scene)
    if trial_value < value + 0.3 * scene.n:
        trial_value = move_all_edges(trial, scene, trial_value)
    return (trial, trial_value) if trial_value < value - NO_GAIN else (volumes, value)
