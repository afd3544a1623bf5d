"""Point files of one run whose heights do not fit each other."""

import warnings

import numpy as np
import pytest

from hiproof.city.run import Request, reconstruct_area
from hiproof.errors import InputWarning
from tiny_town import make_town, write_cloud, write_footprints

TOWN = make_town(6)
pytestmark = pytest.mark.usefixtures("quick_tiles")  # steps are found before anything is fitted


def run_files(folder, files, classes=TOWN.classification):
    """Reconstruct the town of several files, each a mask of its points and a change of heights."""
    paths = []
    for number, (mask, change) in enumerate(files):
        xyz = TOWN.xyz[mask]
        xyz[:, 2] = change(xyz[:, 2])
        paths.append(str(write_cloud(folder / f"tile_{number}.laz", xyz, classes[mask])))
    footprints = write_footprints(folder / "footprints.geojson", TOWN.footprints)
    reconstruct_area(Request(tuple(paths), str(folder / "out"), str(footprints), processes=1))


def cut_town(overlap):
    """Return which points lie in the western and in the eastern half, and in both so far (m)."""
    x = TOWN.xyz[:, 0]
    middle = np.median(x)
    return x < middle + overlap, x >= middle - overlap


@pytest.mark.parametrize(
    "change, step, overlap",
    [
        (lambda z: z + 43.2, "43.2[0-9] m above", 8.0),
        (lambda z: z - 0.8, "0.[78][0-9] m below", 0.0),
        (lambda z: z - 0.8, "0.[78][0-9] m below", 8.0),
        (lambda z: z / 0.3048, "[0-9.]+ m above", 0.0),
    ],
    ids=["ellipsoid", "a lower datum", "a lower datum in an overlap", "feet"],
)
def test_a_file_in_other_heights_is_named(change, step, overlap, tmp_path):
    west, east = cut_town(overlap)
    with pytest.warns(InputWarning, match=f"tile_1.laz: its ground lies {step} that of .*tile_0"):
        run_files(tmp_path, [(west, np.copy), (east, change)])


def test_a_file_without_classes_in_other_heights_is_named(tmp_path):
    west, east = cut_town(3.0)
    with pytest.warns(InputWarning, match="tile_1.laz: its ground lies 43.[12]"):
        run_files(
            tmp_path, [(west, np.copy), (east, lambda z: z + 43.2)], np.ones(len(TOWN.xyz), int)
        )


@pytest.mark.parametrize("change", [np.copy, lambda z: z + 0.15], ids=["alike", "0.15 m"])
def test_strips_and_tiles_whose_heights_fit_are_joined(change, tmp_path):
    everywhere = np.arange(len(TOWN.xyz)) % 2 == 0
    west, east = cut_town(0.0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run_files(
            tmp_path,
            [(everywhere, np.copy), (~everywhere & west, change), (~everywhere & east, change)],
        )
    assert not [w for w in caught if "its ground lies" in str(w.message)]


def test_a_file_in_feet_on_a_slope_is_named(tmp_path):
    """Its steps differ as much as the ground's heights, but all are tall."""
    west, east = cut_town(0.0)
    slope = 5.0 * (TOWN.xyz[:, 1] - TOWN.xyz[:, 1].min())
    with pytest.warns(InputWarning, match="tile_1.laz: its ground lies [0-9.]+ m above"):
        run_files(
            tmp_path,
            [
                (west, lambda z: z + slope[west] + 20),
                (east, lambda z: (z + slope[east] + 20) / 0.3048),
            ],
        )
