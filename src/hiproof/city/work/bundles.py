"""Bundles: the input of buildings that hiproof failed on.

With a bundle the failure can be repeated.

A bundle is a folder `failures/NAME` in the output folder of a run:

    points.laz         the points that the building saw, in world metres: class 6 may be roof, 2 is
                       ground, 1 the rest; extra dimensions hold the exact coordinates
    footprint.geojson  its outline in world metres, without the attributes of the input
    settings.toml      the settings of the run
    terrain.csv        heights of the terrain model where they were looked up, if there is one
    failure.json       the id, the version, the reference system, the building's override, and the
                       error that ended the search for buildings there, if one did
    traceback.txt      what went wrong

A run keeps at most 20. They go when the buildings are solved, or when the run begins anew.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ... import __version__
from ...errors import ErrorReport, InputError, raise_interrupt
from ...log import LOGGER
from ...masking import mask, masked_values
from ...model import Footprint
from ...parametric.override import NOTE_KEYS, Override, read_override
from ...read.points.las import translate_errors
from ...read.points.pointcloud import in_box
from ...settings import Settings
from ...write.files import whole_folder
from ..plan.overrides import OVERRIDES_FILE
from ..plan.work_plan import Job, WorkPlan, neighbourhood
from .bundle_folders import FACTS, FAILURES_FOLDER, bundles_in, folder_name
from .ground import TerrainModel
from .sort import POINT_KINDS

MOST_BUNDLES = 20  # Bundles of a run: more failures have the same few causes, and take space.
CLASSES = dict(zip(POINT_KINDS, (6, 2, 1, 18), strict=True))  # ASPRS classes by the kind of points.
# Extra dimensions (float64); LAZ rounds to SCALE_M.
EXACT_COLUMNS = ("exact_x", "exact_y", "exact_z")
SCALE_M = 0.001  # Steps (m) of the LAZ coordinates; enough to look at.
MARGIN_M = 2.0  # Points so far beyond a building's reach complete its outermost ground cells.


class RecordedTerrain:
    """Terrain heights at the places where they were looked up; unknown elsewhere."""

    def __init__(self, source: str, rows: np.ndarray):
        """Index `rows` (n, 4) of recorded heights.

        A row is x, y, the height, and 1 where the raster holds a code for "no data".
        """
        self.source = source
        self.known = {(x, y): (z, coded) for x, y, z, coded in rows.tolist()}

    def rows_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return what was recorded (n, 2) at `xy_world` (n, 2)."""
        rows = [self.known.get((x, y), (np.nan, 0.0)) for x, y in xy_world.tolist()]
        return np.array(rows, float).reshape(-1, 2)

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return heights (n,) at `xy_world` (n, 2), NaN where none was recorded."""
        return self.rows_at(xy_world)[:, 0]

    def is_coded_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return whether (n,) the raster held a "no data" code at `xy_world` (n, 2)."""
        return self.rows_at(xy_world)[:, 1] > 0.0


class TerrainRecorder:
    """A terrain model that notes the `places` (n, 2) where it is looked up."""

    def __init__(self, model: TerrainModel):
        self.model, self.source = model, model.source
        self.places: list[np.ndarray] = []

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the model's heights (n,) at `xy_world` (n, 2)."""
        self.places.append(xy_world[:, :2])
        return self.model.height_at(xy_world)

    def is_coded_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return whether (n,) the raster holds a "no data" code at `xy_world` (n, 2)."""
        self.places.append(xy_world[:, :2])
        return self.model.is_coded_at(xy_world)

    def make_rows(self) -> np.ndarray:
        """Make the rows (n, 4) of a `RecordedTerrain`, of all places noted."""
        xy = np.concatenate([np.zeros((0, 2)), *self.places])
        heights, coded = self.model.height_at(xy), self.model.is_coded_at(xy)
        return np.unique(np.column_stack([xy, heights, coded]), axis=0)


def keep_failure(
    root: Path,
    load: Callable[[], dict[str, np.ndarray]],
    plan: WorkPlan,
    job: Job,
    trace: str,
    terrain: TerrainRecorder | None,
) -> None:
    """Log the traceback of a failed building and keep its bundle; failing that, warn.

    `root` is the run's own folder, and `load` returns the points of the building's work tile, by
    kind. `terrain` has noted where the building looked up the terrain model, None without one.
    """
    LOGGER.info("building %s failed:\n%s", job.id, trace)
    if not plan.settings.city.keep_failures:
        return
    try:
        folder = root.parent / FAILURES_FOLDER / folder_name(job.id)
        if folder.exists() or len(bundles_in(root.parent)) < MOST_BUNDLES:
            save_bundle(folder, root, load(), plan, job, trace, terrain)
            if len(bundles_in(root.parent)) > MOST_BUNDLES:  # another process was faster
                shutil.rmtree(folder)
    except Exception as error:
        raise_interrupt(error)
        LOGGER.warning(
            "the input of building %s could not be kept in %s: %s", job.id, FAILURES_FOLDER, error
        )


def save_bundle(
    folder: Path,
    root: Path,
    points: dict[str, np.ndarray],
    plan: WorkPlan,
    job: Job,
    trace: str,
    terrain: TerrainRecorder | None,
) -> None:
    """Write the bundle `folder`, whole or not at all.

    `points` (n, 3) by kind are those of the building's work tile.
    """
    with whole_folder(folder) as temporary:
        write_points(temporary / "points.laz", crop_points(points, plan, job))
        write_outline(temporary / "footprint.geojson", job)
        (temporary / "settings.toml").write_text(plan.settings.to_toml(), encoding="utf-8")
        (temporary / "traceback.txt").write_text(mask(trace), encoding="utf-8", errors="replace")
        if terrain is not None:
            lines = [",".join(map(repr, row)) for row in terrain.make_rows().tolist()]
            (temporary / "terrain.csv").write_text(
                "\n".join(["x,y,z,coded", *lines]) + "\n", encoding="utf-8"
            )
        facts = {
            "hiproof": __version__,
            "id": job.id,
            "has_footprint": job.footprint is not None,
            "names": list(plan.list_names(job)),
            "crs": plan.crs_wkt,
            "cityjson_translate": plan.translate.tolist(),
            "terrain": None if terrain is None else terrain.source,
            "override": override_record(root, job),
            "error": job.error,
        }
        (temporary / FACTS).write_text(
            json.dumps(masked_values(facts), indent=1) + "\n", encoding="utf-8"
        )


def crop_points(points: dict[str, np.ndarray], plan: WorkPlan, job: Job) -> dict[str, np.ndarray]:
    """Return a tile's points (n, 3), by kind, that the building may see."""
    reaches = {
        "roof": max(plan.around_m, plan.beyond_m),
        "ground": plan.terrain_reach_m,
        "low": plan.terrain_reach_m,
        "noise": plan.around_m,
    }
    return {
        kind: xyz[in_box(xyz, neighbourhood(job, reaches[kind] + MARGIN_M))]
        for kind, xyz in points.items()
    }


def write_points(path: Path, points: dict[str, np.ndarray]) -> None:
    """Write points (n, 3) by kind as LAZ, with exact coordinates beside those of the format."""
    import laspy

    xyz = np.concatenate(list(points.values()))
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.add_extra_dims([laspy.ExtraBytesParams(name, "f8") for name in EXACT_COLUMNS])
    header.scales = np.full(3, SCALE_M)
    header.offsets = np.floor(xyz.min(axis=0)) if len(xyz) else np.zeros(3)
    cloud = laspy.LasData(header, laspy.ScaleAwarePointRecord.zeros(len(xyz), header=header))
    cloud.x, cloud.y, cloud.z = xyz.T
    for name, values in zip(EXACT_COLUMNS, xyz.T, strict=True):
        cloud[name] = values
    numbers = [CLASSES[kind] for kind in points]
    cloud.classification = np.repeat(numbers, list(map(len, points.values())))
    cloud.write(path)


def read_exact_points(path: Path) -> dict[str, np.ndarray]:
    """Read the points (n, 3) by kind from `write_points`.

    Raises InputError for other files.
    """
    import laspy

    with translate_errors(path):
        cloud = laspy.read(path)
        xyz = np.column_stack([np.asarray(cloud[name], float) for name in EXACT_COLUMNS])
        classes = np.asarray(cloud.classification)
    return {kind: xyz[classes == number] for kind, number in CLASSES.items()}


def write_outline(path: Path, job: Job) -> None:
    """Write the building's outline as GeoJSON, with its id alone."""
    geometry = None if job.area.is_empty else shapely.geometry.mapping(job.area)
    feature = {"type": "Feature", "properties": {"id": job.id}, "geometry": geometry}
    path.write_text(
        json.dumps({"type": "FeatureCollection", "features": [feature]}) + "\n", encoding="utf-8"
    )


def override_record(root: Path, job: Job) -> dict[str, Any] | None:
    """Return the building's override without its note, None where there is none."""
    path = root / OVERRIDES_FILE
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        index, record = json.loads(line)
        if index == job.index:
            return {key: value for key, value in record.items() if key not in NOTE_KEYS}
    return None


def load_bundle(
    folder: Path,
) -> tuple[WorkPlan, dict[str, np.ndarray], RecordedTerrain | None, Override | None]:
    """Read a bundle: a plan of its building, points, terrain and override.

    Points are by kind.

    Raises InputError or SettingsError, one sentence, for a folder that is none.
    """
    folder = Path(folder)
    try:
        facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))
        (feature,) = json.loads((folder / "footprint.geojson").read_text(encoding="utf-8"))[
            "features"
        ]
        geometry = feature["geometry"]
        area = shapely.Polygon() if geometry is None else shapely.geometry.shape(geometry)
        footprint = Footprint(facts["id"], area, {}) if facts["has_footprint"] else None
        job = Job(0, facts["id"], area, footprint, facts["error"] and ErrorReport(*facts["error"]))
        names = (str(facts["names"][0]), str(facts["names"][1]))
        translate = np.array(facts["cityjson_translate"], float)
        override = None if facts["override"] is None else read_override(facts["override"])
        terrain = None
        if facts["terrain"] is not None:
            rows = np.loadtxt(folder / "terrain.csv", delimiter=",", skiprows=1, ndmin=2)
            terrain = RecordedTerrain(str(facts["terrain"]), rows.reshape(-1, 4))
    except (
        OSError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        shapely.errors.ShapelyError,
    ) as error:
        raise InputError(
            f"expected a folder that a run kept of a failed building at {folder}, got: {error}; it "
            f"lies in the run's folder {FAILURES_FOLDER}"
        ) from error
    settings = Settings.from_toml(folder / "settings.toml")
    # the outline lies where the run had moved it
    settings = settings.replace({"reconstruct": {"align": "off"}})
    plan = WorkPlan((job,), {"0_0_0": (0,)}, facts["crs"], settings, {0: names}, translate)
    return plan, read_exact_points(folder / "points.laz"), terrain, override
