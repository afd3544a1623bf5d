"""Point clouds from LAS, LAZ, COPC, text and PLY files by content and ending, in chunks."""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import numpy as np

from ...errors import InputError, warn
from ...frames import METRES, Box, Units
from ...log import count_things
from ...model import PointCloud
from ...settings import Settings
from ..crs import (
    UnknownCRS,
    describe_crs,
    find_units,
    names_place,
    parse_crs,
    same_heights,
    same_horizontal,
    vertical_crs,
)
from ..plausible import MOST_HEIGHT, MOST_PLAN, compute_bounds, is_plausible
from ..remote import FilePath, is_url, locate
from . import las, ply, text
from .las_crs import las_crs
from .runs import RUN_POINTS


class Reader(NamedTuple):
    """A kind of point file: its name, its endings, and its reader.

    Files start with given bytes (none in text). They are read in chunks of coordinates (n, 3) and
    classes (n,) or None, of so many points at most.
    """

    name: str
    suffixes: tuple[str, ...]
    start: bytes
    chunks: Callable[[FilePath, int], Iterator[las.Chunk]]


TEXT_SUFFIXES = (".xyz", ".txt", ".csv", ".pts", ".asc", ".xyzc")
# A further kind of point file is a module and a line here. Only "las" is asked for more: parts of a
# file, a CRS.
READERS = {
    "las": Reader("LAS, LAZ, COPC", (".las", ".laz"), b"LASF", las.las_chunks),
    "ply": Reader("PLY", (".ply",), b"ply", ply.ply_chunks),
    "text": Reader("text (" + " ".join(TEXT_SUFFIXES) + ")", TEXT_SUFFIXES, b"", text.text_chunks),
}

POINT_SUFFIXES = tuple(suffix for reader in READERS.values() for suffix in reader.suffixes)
FORMAT_NAMES = " or ".join(", ".join(reader.name for reader in READERS.values()).rsplit(", ", 1))
CONVERT_FIRST = "{}; convert it first (`pdal translate {{path}} {{laz}}`)"
UNPACK_FIRST = "a packed file; unpack it first: {} {{path}}"
# what files of other kinds are, by their first bytes, and what to do with them
OTHER_KINDS = {
    b"ASTM-E57": CONVERT_FIRST.format("E57"),
    b"# .PCD": CONVERT_FIRST.format("PCD"),
    b"\x1f\x8b": UNPACK_FIRST.format("gunzip"),
    b"PK\x03\x04": UNPACK_FIRST.format("unzip"),
    b"BZh": UNPACK_FIRST.format("bunzip2"),
    b"\xfd7zX": UNPACK_FIRST.format("unxz"),
    b"7z\xbc\xaf": UNPACK_FIRST.format("7z x"),
}
CHUNK_POINTS = 5 * RUN_POINTS  # 30 MB while they are sorted

COARSE_STEP_M = (
    # coordinates in larger steps are told of: they add a third of it to the noise, as much as a
    # good scanner has
    0.05
)
# that text rounds to, or 32 bits at a national grid's coordinates
STEPS = (1.0, 0.5, 0.25, 0.2, 0.125, 0.1, 0.0625)
STEP_POINTS = (100, 10_000)  # fewer say nothing of steps, more nothing new


@dataclass(frozen=True)
class PointFileHeader:
    """The count, bounds and CRS that a point file states.

    `bounds` are (xmin, ymin, zmin, xmax, ymax, zmax) in the file's own unit. `steps` are those in
    which its coordinates come, in plan and in height, in its unit too: 0 where they are fine or not
    known.
    """

    path: str
    bounds: tuple[float, float, float, float, float, float]
    count: int
    crs: Any = None
    steps: tuple[float, float] = (0.0, 0.0)


def read_points(
    *paths: str | Path, settings: Settings | None = None, box: Box | None = None
) -> PointCloud:
    """Read all points of the files, folders or wildcards `paths`.

    They are in world metres. Those outside `box` in plan are left out. Classes are kept, NaN and
    infinite coordinates dropped with an InputWarning. The CRS is `settings.read.crs` where that is
    given, else the files' own; coordinates in feet are made metres, and `units` of the cloud tells
    what they were. Raises InputError for what is missing, unreadable, empty, in degrees, or in
    different CRSs.
    """
    files, read = expand_paths(paths), (settings or Settings()).read
    headers = [las_file_header(file) for file in files]
    crs_of = {str(file): h and h.crs for file, h in zip(files, headers, strict=True)}
    crs = common_crs(crs_of, parse_crs(read.crs), read.unit)
    units = find_units(crs, "the point cloud", read.unit)
    warn_coarse([header for header in headers if header], units)
    clouds = [chunk for file in files for chunk in iter_points(file, box=box, units=units)]
    xyz = np.concatenate([cloud.xyz for cloud in clouds]) if clouds else np.empty((0, 3))
    if not len(xyz):
        place, advice = "", "check the file"
        if box is not None:
            place = f" inside the box {tuple(map(float, box))}"
            advice = "check the box against the files' bounds and CRS"
        names = ", ".join(map(str, files))
        raise InputError(f"expected points{place} in {names}, got none; {advice}")
    return PointCloud(xyz, join_classes(clouds), crs, tuple(map(str, files)), units)


def iter_points(
    path: FilePath,
    chunk_points: int | None = None,
    box: Box | None = None,
    runs: np.ndarray | None = None,
    units: Units = METRES,
    noted: list[np.ndarray] | None = None,
) -> Iterator[PointCloud]:
    """Yield the points of one file in chunks, so that memory stays bounded.

    A chunk has at most `chunk_points` (CHUNK_POINTS) points and no CRS.

    `units` are those of the file's coordinates; the points, and `box`, are in world metres.

    Only a COPC file with a `box` comes as a single chunk, which holds the points in the box. Of LAS
    and LAZ only the `runs` (k, 2) of points, [first, end), are read where they are given, and where
    these lie goes to `noted` (see runs.py). Raises InputError as `read_points` does, an empty file
    excepted, which yields nothing.
    """
    kind, limit = file_kind(path), chunk_points or CHUNK_POINTS
    # whose points lie within its header's bounds, and these are plausible (las_header.py)
    if kind == "las":
        chunks = las.las_chunks(
            path, limit, None if box is None else box_in_file(box, units), runs, noted
        )
    else:
        chunks = plausible_chunks(READERS[kind].chunks(path, limit), path)
    for xyz, classes in chunks:
        xyz = xyz if units.are_metres else units.to_metres(xyz)
        if box is not None:
            xyz, classes = select_classes(xyz, classes, in_box(xyz, box))
        if len(xyz):
            yield PointCloud(xyz, classes, None, (str(path),), units)


def plausible_chunks(chunks: Iterator[las.Chunk], path: FilePath) -> Iterator[las.Chunk]:
    """Yield chunks without points that lack coordinates; raises for impossible places."""
    dropped = 0
    for xyz, classes in chunks:
        refuse_implausible(xyz, path)
        keep = np.all(np.isfinite(xyz), axis=1)
        if not keep.all():
            dropped += int((~keep).sum())
            xyz, classes = select_classes(xyz, classes, keep)
        yield xyz, classes
    if dropped:
        warn(path, f"{count_things(dropped, 'point')} with NaN or infinite coordinates left out")


def as_input_error(error: Exception, path: FilePath) -> InputError:
    """Turn an exception of reading a file into its InputError, so that others go on."""
    if isinstance(error, InputError):
        return error
    return InputError(
        f"expected a point cloud that can be read at {path}, got {type(error).__name__}: {error}; "
        "copy or download it again, or write it anew as LAZ"
    )


def refuse_implausible(xyz: np.ndarray, path: FilePath) -> None:
    """Raise InputError for finite coordinates (n, 3) that no place on Earth has."""
    if not len(xyz) or is_plausible(compute_bounds(xyz)).all():
        return
    mask = ~is_plausible(np.nan_to_num(xyz, posinf=0.0, neginf=0.0))
    if mask.any():
        point = ", ".join(f"{value:g}" for value in xyz[np.argmax(mask)])
        raise InputError(
            f"expected coordinates up to {MOST_PLAN:g} and heights up to {MOST_HEIGHT:g} in "
            f"{path}, got the point {point}; put it right or leave it out"
        )


def read_header(path: FilePath) -> PointFileHeader:
    """Return bounds, count and CRS by a header of LAS, LAZ, COPC, or a pass over others."""
    header = las_file_header(path)
    if header is not None:
        return header
    count, lower, upper, steps = 0, np.full(3, np.inf), np.full(3, -np.inf), (0.0, 0.0)
    for cloud in iter_points(path):
        steps = steps if count else find_steps(cloud.xyz)
        count += len(cloud)
        lowest, highest = compute_bounds(cloud.xyz)
        lower, upper = np.minimum(lower, lowest), np.maximum(upper, highest)
    return PointFileHeader(str(path), (*lower.tolist(), *upper.tolist()), count, steps=steps)


def list_boxes(headers: list[PointFileHeader]) -> np.ndarray:
    """Return the boxes (n, 4) in plan that headers state, in the unit of their files."""
    return np.array([header.bounds for header in headers], float).reshape(-1, 6)[:, [0, 1, 3, 4]]


def las_file_header(path: FilePath) -> PointFileHeader | None:
    """Return the header of a LAS, LAZ or COPC file, None for another kind."""
    if file_kind(path) != "las":
        return None
    facts = las.read_checked_facts(path)
    bounds = (*facts.mins.tolist(), *facts.maxs.tolist())
    steps = (float(max(facts.scales[:2])), float(facts.scales[2]))
    return PointFileHeader(str(path), bounds, facts.count, las_crs(facts.projection), steps)


def find_steps(xyz: np.ndarray) -> tuple[float, float]:
    """Return the largest of STEPS in which coordinates (n, 3) come.

    One is for plan, one for height. It is 0 where coordinates are finer or too few.

    >>> find_steps(np.arange(600.0).reshape(-1, 3) * [0.5, 1.0, 0.01])
    (0.5, 0.0)
    """
    minimum, limit = STEP_POINTS
    if len(xyz) < minimum:
        return 0.0, 0.0
    result = []
    for gap in np.split(xyz[:limit] - xyz[:1], [2], axis=1):
        steps = (s for s in STEPS if np.allclose(gap, s * np.rint(gap / s), rtol=0, atol=1e-4))
        result.append(next(steps, 0.0))
    return result[0], result[1]


def warn_coarse(headers: list[PointFileHeader], units: Units) -> None:
    """Warn once of coordinates (in `units`) in steps over COARSE_M, as roofs are no finer."""
    coarse = {}
    for header in headers:
        ways = ("plan", header.steps[0] * units.plan), ("height", header.steps[1] * units.height)
        phrases = [f"{m:.3g} m in {way}" for way, m in ways if m > COARSE_STEP_M]
        if phrases:
            coarse[header.path] = " and ".join(phrases)
    for path, steps in list(coarse.items())[:1]:
        warn(
            f"{path}{format_others(list(coarse))}",
            f"coordinates come in steps of {steps}, and roofs "
            "are no finer; write the file anew from its source with steps of 0.01 m or less",
        )


def expand_paths(paths: tuple[FilePath, ...]) -> list[FilePath]:
    """Return the files of paths, (sorted) folders and wildcards, each once, in order."""
    if not paths:
        raise InputError(
            "expected at least one point cloud, got none; name a file, a folder or a wildcard"
        )
    files: dict[str, FilePath] = {}
    for path in paths:
        for file in expand_path(path):
            files.setdefault(locate(file), file)
    return list(files.values())


def expand_path(path: FilePath) -> list[FilePath]:
    if is_url(path):
        return [path]
    folder = Path(path)
    if folder.is_dir():
        result = sorted(
            p for p in folder.iterdir() if p.suffix.lower() in POINT_SUFFIXES and p.is_file()
        )
        if not result:
            raise InputError(
                f"expected point files in the folder {path}, got none; it may hold {FORMAT_NAMES}"
            )
        return drop_other_text(result)
    if folder.exists():
        return [folder]
    matches = sorted(
        match for match in glob.glob(str(path), recursive=True) if Path(match).is_file()
    )
    if not matches:
        raise InputError(
            f"expected a point cloud at {path}, got no such file; check the path (or the wildcard)"
        )
    return [Path(match) for match in matches]


def drop_other_text(files: list[Path]) -> list[FilePath]:
    """Drop the text files of a folder without points, such as notes, if others are there."""
    others = [
        file
        for file in files
        if file.suffix.lower() in TEXT_SUFFIXES and not text.is_of_points(file)
    ]
    if not 0 < len(others) < len(files):
        return list(files)
    remainder = ", ".join(file.name for file in others)
    warn(files[0].parent, f"text without points is left aside: {remainder}")
    return [file for file in files if file not in others]


def file_kind(path: FilePath) -> str:
    """Return one of READERS, by the first bytes, else by the ending.

    Raises InputError for anything else. An address is not opened for it: it goes by its ending, and
    is LAS without one of the others'.
    """
    if is_url(path):
        suffix = Path(urlsplit(str(path)).path).suffix.lower()
        return next((kind for kind, reader in READERS.items() if suffix in reader.suffixes), "las")
    try:
        with open(path, "rb") as file:
            head = file.read(8)
    except OSError as error:
        raise InputError(
            f"expected a readable point cloud at {path}, got: {error.strerror or error}; check the "
            "path"
        ) from error
    suffix = Path(path).suffix.lower()
    if not head:
        raise InputError(f"expected points in {path}, got an empty file; copy or download it again")
    for kind, reader in READERS.items():
        if head.startswith(reader.start) if reader.start else suffix in reader.suffixes:
            return kind
    for start, other in OTHER_KINDS.items():
        if head.startswith(start):
            got = other.format(path=path, laz=Path(path).with_suffix(".laz"))
            raise InputError(f"expected {FORMAT_NAMES} at {path}, got {got}")
    got = (
        "something else" if suffix in POINT_SUFFIXES else f"a file ending in {suffix or 'nothing'}"
    )
    raise InputError(
        f"expected {FORMAT_NAMES} at {path}, got {got} that starts with {head[:4]!r}; "
        "if it is text with x y z on each line, rename it to .xyz"
    )


def common_crs(crs_of: dict[str, Any], arguments: Any, unit: str) -> Any:
    """Return the one CRS of point files, from what each names.

    It is `arguments` where that is a CRS, else the files' own. Files that name none go with those
    that do, and files overruled by `arguments` go with it, with an InputWarning each. Raises
    InputError, naming both files, where two disagree, and for a CRS that cannot be understood while
    neither `arguments` nor a `unit` stands in for it.
    """
    named_crs = {}
    for path, crs in crs_of.items():
        if not isinstance(crs, UnknownCRS | None):
            named_crs[path] = crs
        elif crs is not None and arguments is None and unit == "auto":
            # its unit might be any
            raise InputError(
                f"expected a coordinate reference system that PROJ understands in {path}, got "
                f"{crs.reason}; name the right one with --crs, or its unit alone with --unit"
            )
    if arguments is not None:
        overruled = [path for path, crs in named_crs.items() if not same_horizontal(crs, arguments)]
        if overruled:
            warn(
                f"{overruled[0]}{format_others(overruled)}",
                f"taken in {describe_crs(arguments)}, as "
                f"told, although its header names {describe_crs(named_crs[overruled[0]])}",
            )
        return arguments
    first = next(iter(named_crs), "")
    for path, crs in named_crs.items():
        refuse_two(named_crs[first], first, crs, path)
    unnamed = [path for path in crs_of if path not in named_crs]
    if named_crs and unnamed:
        warn(
            f"{unnamed[0]}{format_others(unnamed)}",
            f"names no CRS; taken in {describe_crs(named_crs[first])} as {first} is",
        )
    return max(named_crs.values(), key=lambda crs: vertical_crs(crs) is not None, default=None)


def refuse_other_crs(files: list[FilePath], crs: Any, source: str) -> None:
    """Raise InputError where a file names another CRS than `crs`, which `source` named."""
    for file in files if crs is not None else ():
        header = las_file_header(file)  # text and PLY never name a CRS
        other = None if header is None else header.crs
        if not isinstance(other, UnknownCRS) and names_place(other):
            refuse_two(crs, source, other, str(file))


def refuse_two(first: Any, first_source: str, second: Any, second_source: str) -> None:
    """Raise InputError where two CRSs differ in plan or in heights."""
    if first != second and not (same_horizontal(first, second) and same_heights(first, second)):
        raise InputError(
            f"expected all clouds in one CRS, got {describe_crs(first)} in {first_source} and "
            f"{describe_crs(second)} in {second_source}; reproject one of them, or say with --crs "
            "which is right where a header is wrong"
        )


def format_others(paths: list[str]) -> str:
    return f" and {len(paths) - 1} more" if len(paths) > 1 else ""


def join_classes(clouds: list[PointCloud]) -> np.ndarray | None:
    """Return all clouds' classes, 0 for a file without, None where no file has any."""
    if all(cloud.classification is None for cloud in clouds):
        return None
    return np.concatenate([cloud.classes for cloud in clouds])


def select_classes(
    xyz: np.ndarray, classes: np.ndarray | None, keep: np.ndarray
) -> tuple[np.ndarray, np.ndarray | None]:
    return xyz[keep], None if classes is None else classes[keep]


def box_in_file(box: Box, units: Units) -> Box:
    """Return a box in the file's unit around `box`, wider where rounding could cut it."""
    if units.are_metres:
        return box
    (xmin, ymin), (xmax, ymax) = units.from_metres(np.reshape(box, (2, 2))) + [[-0.01], [0.01]]
    return float(xmin), float(ymin), float(xmax), float(ymax)


def in_box(xyz: np.ndarray, box: Box | np.ndarray) -> np.ndarray:
    x, y = xyz[:, 0], xyz[:, 1]
    return (x >= box[0]) & (y >= box[1]) & (x <= box[2]) & (y <= box[3])
