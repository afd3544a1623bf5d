"""The classes of points that may hold roofs: those named, or all where none is a building's."""

from __future__ import annotations

import warnings
from collections import Counter

import numpy as np

from ...errors import InputError, InputWarning
from ...log import count_things
from ...read.points.pointcloud import iter_points
from ...read.points.runs import RUN_POINTS
from ...settings import ReadSettings, Settings

# looked at at once to learn the classes: one chunk of LAZ, which is decoded whole
PEEK_POINTS = RUN_POINTS


def settle_classes(clouds: tuple[str, ...], settings: Settings) -> Settings:
    """Return settings with the classes that may hold roofs.

    The settings also say where roofs are to be found by shape or stand alone.

    Classes other than the default that were asked for are taken as they are. Otherwise all classes
    but ground, water, noise, low vegetation and bridges may hold roofs where no point has the
    building class, and one line says so. Raises InputError where no class of the clouds may.
    """
    read = settings.read
    if read.roofs == "class" or (
        read.roofs == "auto" and read.building_classes != ReadSettings().building_classes
    ):
        return settings
    with warnings.catch_warnings():
        # what is to be said of the points the step that sorts them says
        warnings.simplefilter("ignore", InputWarning)
        counts = count_classes(clouds, read.building_classes if read.roofs == "auto" else ())
    if read.roofs == "auto" and (not counts or any(counts[c] for c in read.building_classes)):
        return settings
    # with scipy.ndimage: not where the clouds have a building class
    from ...classify.buildings import NO_ROOFS

    selected_counts = sorted(counts.keys() - {*NO_ROOFS, *read.ground_classes})
    present = ", ".join(f"{c} ({count_things(n, 'point')})" for c, n in sorted(counts.items()))
    if not selected_counts:
        raise InputError(
            f"expected points that may be roofs, got classes {present}, all of them ground, water, "
            "noise, low vegetation or bridges; say which class holds roofs with --building-class, "
            "or update a run with --roofs class where no building stands any more"
        )
    if read.roofs == "auto":
        warnings.warn(
            f"the clouds have no building class ({', '.join(map(str, read.building_classes))}) but "
            f"{present}: roofs are looked for among the points of class "
            f"{', '.join(map(str, selected_counts))}; say otherwise with --building-class",
            InputWarning,
        )
    roofs = "shape" if read.roofs == "auto" else read.roofs
    return settings.replace({"read": {"roofs": roofs, "building_classes": selected_counts}})


def count_classes(clouds: tuple[str, ...], is_enough: tuple[int, ...]) -> Counter[int]:
    """Count points by class, of all readable files.

    A file without classes counts as 0. Counting ends at a point of class `is_enough`.
    """
    counts: Counter[int] = Counter()
    for name in clouds:
        try:
            for chunk in iter_points(name, PEEK_POINTS):
                counts.update({c: int(n) for c, n in enumerate(np.bincount(chunk.classes)) if n})
                if any(counts[c] for c in is_enough):
                    return counts
        except MemoryError:
            raise
        except Exception:
            continue  # the step that sorts points tells of it
    return counts
