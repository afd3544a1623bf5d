"""Checks of the header of a LAS, LAZ or COPC file, before any number of it is used.

Every count is held against the file's size: of records, of points, of LASzip's chunks, of COPC's
pages and nodes. Scales, offsets and bounds are held against each other. The layouts are those of
ASPRS' LAS 1.4 R15, of LASzip's record and chunk table (Isenburg 2013), and of the COPC
specification 1.0.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import BinaryIO, NamedTuple

import lazrs
import numpy as np

from ..plausible import MOST_HEIGHT, MOST_PLAN, Implausible, compute_bounds

HEADER_BYTES = {0: 227, 1: 227, 2: 227, 3: 235, 4: 375, 5: 393}  # by minor version
# encoding, version, day and year of the file, sizes, points, their bounds, what lies behind them
HEADER = struct.Struct("<6xH82xHHHIIBHI5I12dQQIQ")
RECORD_BYTES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)  # by point format, without extra bytes
# LAZ's bit in the point format, its size of chunks that vary, its compressor of layered chunks
COMPRESSED, VARIABLE_CHUNKS, LAYERED = 0x80, 2**32 - 1, 3
# units of a coordinate's last digit; no survey is coarser, a damaged header is
COARSEST_SCALE = 10.0
MOST_CHUNK_POINTS = 10_000_000  # a decoder makes room for a whole chunk; LASzip's own have 50,000
ITEMS = np.dtype([("kind", "<u2"), ("bytes", "<u2"), ("version", "<u2")])  # of LASzip's record
NODES = np.dtype([("key", "<i4", 4), ("start", "<u8"), ("bytes", "<i4"), ("points", "<i4")])


class Octree(NamedTuple):
    """COPC's octree: `nodes` (n,) of NODES with points, in the file's order, and their cubes.

    The cubes reach from `lower` to `upper` (n, 3), wider by what rounding may move a point.
    """

    nodes: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


@dataclass(frozen=True)
class LasFacts:
    """The fields of the public header block, and the file's `size` in bytes.

    Arrays are (3,): x, y, z. `created` are the day of a year and that year. `points_end` is the
    first byte that no point may take: of waveforms, of extended records, or the end. `laszip` is
    the record that tells how points are compressed; only COPC has an `octree`; `projection` are
    the records of the CRS.
    """

    size: int
    created: tuple[int, int]
    has_gps_time: bool
    data_start: int
    compressed: bool
    point_bytes: int
    count: int
    count_by_return: int
    points_end: int
    scales: np.ndarray
    offsets: np.ndarray
    mins: np.ndarray
    maxs: np.ndarray
    laszip: bytes = b""
    octree: Octree | None = None
    projection: dict[int, bytes] = field(default_factory=dict)

    @property
    def rounding(self) -> np.ndarray:
        """How far (3,) rounding may put a point outside bounds: some writers use 1 cm."""
        return 0.01 + self.scales


def read_facts(file: BinaryIO) -> LasFacts:
    """Read and check the header of an open file; raises Implausible with the reason."""
    size = file.seek(0, 2)
    file.seek(0)
    facts, sections = parse_header(file.read(max(HEADER_BYTES.values())), size)
    records = dict(record for section in sections for record in iterate_records(file, *section))
    facts = replace(
        facts,
        laszip=records.get(("laszip encoded", 22204), b""),
        projection={n: content for (u, n), content in records.items() if u == "LASF_Projection"},
    )
    points = (facts.points_end - facts.data_start) // facts.point_bytes
    if facts.compressed:
        points = compressed_points(file, facts)
    if points != facts.count:
        raise Implausible(
            f"its header tells of {facts.count} points, its data of {points}; it is truncated or "
            "damaged"
        )
    if facts.count:
        check_coordinates(facts)
    return with_octree(file, facts, records["copc", 1]) if ("copc", 1) in records else facts


# Sections of records: where they start and end, their number, and the form of the head of each.
Section = tuple[int, int, int, str]


def parse_header(head: bytes, size: int) -> tuple[LasFacts, tuple[Section, ...]]:
    """Parse the public header block from `head`, the file's first bytes, and tell of records."""
    if head[:4] != b"LASF" or len(head) < HEADER_BYTES[0]:
        raise Implausible(f"it ends after {size} bytes, inside its header; it is truncated")
    major, minor = head[24], head[25]
    if major != 1 or minor not in HEADER_BYTES or len(head) < HEADER_BYTES[minor]:
        raise Implausible(
            f"its header is that of LAS {major}.{minor} in a file of {size} bytes; 1.0 to 1.5 are "
            "known"
        )
    # what an older version does not have is 0
    values = HEADER.unpack(head[: HEADER_BYTES[minor]].ljust(HEADER.size, b"\0")[: HEADER.size])
    encoding, day, year, header_bytes, data_start, records, kind, point_bytes, count = values[:9]
    wave_start, far_start, far_count, long_count = values[26:]
    point_format = kind & ~COMPRESSED
    if minor >= 4:
        legacy, count = count, long_count
        # a writer may leave the old field at 0 although older readers know the points' format: LAS
        # 1.4 allows it
        if point_format < 6 and legacy not in (0, count) and count <= 2**32 - 1:
            raise Implausible(
                f"its header tells of {count} points and, in the field for older readers, of "
                f"{legacy}"
            )
    ends = [wave_start if encoding & 2 else 0, far_start if far_count else 0]
    points_end = min([size, *filter(None, ends)])
    if not HEADER_BYTES[minor] <= header_bytes <= data_start <= points_end:
        raise Implausible(
            f"its header of {header_bytes} bytes tells of points from byte {data_start} to "
            f"{points_end}; it is truncated or damaged"
        )
    if point_format >= len(RECORD_BYTES) or point_bytes < RECORD_BYTES[point_format]:
        raise Implausible(
            f"its header tells of points of format {point_format} in {point_bytes} bytes each"
        )
    numbers = np.array(values[14:26])
    facts = LasFacts(
        size,
        (day, year),
        bool(encoding & 1),
        data_start,
        bool(kind & COMPRESSED),
        point_bytes,
        count,
        sum(values[9:14]),
        points_end,
        scales=numbers[:3],
        offsets=numbers[3:6],
        maxs=numbers[6::2],
        mins=numbers[7::2],
    )
    return facts, (
        (header_bytes, data_start, records, "<2x16sHH32x"),
        (far_start, size, far_count, "<2x16sHQ32x"),
    )


def iterate_records(
    file: BinaryIO, start: int, end: int, count: int, form: str
) -> Iterator[tuple[tuple[str, int], bytes]]:
    """Yield the records of a section as ((user id, number), content), none beyond its place."""
    head_bytes = struct.calcsize(form)
    if start + count * head_bytes > end:
        raise Implausible(
            f"its header tells of {count} records from byte {start} on, where only "
            f"{end - start} are left"
        )
    for _ in range(count):
        file.seek(start)
        user, number, length = struct.unpack(form, file.read(head_bytes))
        start += head_bytes + length
        if start > end:
            raise Implausible(
                f"its record {number} ends at byte {start}, beyond byte {end}; it is truncated "
                "or damaged"
            )
        content = file.read(length) if length <= 0xFFFF else b""
        yield (user.split(b"\0")[0].decode("latin-1"), number), content


def compressed_points(file: BinaryIO, facts: LasFacts) -> int:
    """Return the points in LASzip's chunks, or the header's number where versions leave it open.

    Raises Implausible for a table of chunks that does not fit the file: a decoder would make room
    for what it says.
    """
    laszip = facts.laszip
    if len(laszip) < 34:
        raise Implausible(
            "its header tells of compressed points, but how they are compressed it does not say"
        )
    compressor, chunk_points, items = struct.unpack_from("<H10xI16xH", laszip)
    described = np.frombuffer(laszip[34:][: (len(laszip) - 34) // 6 * 6], ITEMS)
    item_bytes = described["bytes"][:items].sum(dtype=int)
    if item_bytes != facts.point_bytes:
        raise Implausible(
            f"its header tells of points of {facts.point_bytes} bytes, its compressor of "
            f"{item_bytes}"
        )
    if compressor < 2:
        return facts.count
    sizes, last = read_chunk_table(file, facts)
    if max(sizes, default=0) > MOST_CHUNK_POINTS:
        raise Implausible(
            f"it tells of chunks of {max(sizes)} points; up to {MOST_CHUNK_POINTS} are read"
        )
    if chunk_points == VARIABLE_CHUNKS or not sizes:
        return sum(sizes)
    full = (len(sizes) - 1) * chunk_points
    if compressor == LAYERED:  # whose last chunk declares its points after its first one
        file.seek(last + facts.point_bytes)
        return full + struct.unpack("<I", file.read(4).ljust(4, b"\0"))[0]
    # the only second count: the last chunk of older formats has none
    if facts.count_by_return > facts.count:
        return facts.count_by_return
    if not full < facts.count <= full + chunk_points:
        raise Implausible(
            f"its header tells of {facts.count} points, its chunks hold from {full + 1} to "
            f"{full + chunk_points}"
        )
    return facts.count


def read_chunk_table(file: BinaryIO, facts: LasFacts) -> tuple[list[int], int]:
    """Return the points of each chunk, or the full number of any, and where the last begins."""
    file.seek(facts.data_start)
    start, table = facts.data_start + 8, struct.unpack("<q", file.read(8).ljust(8, b"\xff"))[0]
    if table == -1:  # written as a stream: the place stands at the end
        file.seek(facts.size - 8)
        table = struct.unpack("<q", file.read(8))[0]
    if not start <= table <= facts.points_end - 8:
        raise Implausible(
            f"its chunk table is said to be at byte {table} of {facts.size}; it is truncated or "
            "damaged"
        )
    file.seek(table)
    count = struct.unpack("<4xI", file.read(8))[0]
    if count * facts.point_bytes > table - start:  # the first point of a chunk is stored as it is
        raise Implausible(
            f"it tells of {count} chunks of points in {table - start} bytes; it is damaged"
        )
    file.seek(facts.data_start)
    chunks = lazrs.read_chunk_table(file, lazrs.LazVlr(facts.laszip)) if count else []
    if sum(length for _, length in chunks) != table - start:
        raise Implausible(
            f"its chunk table does not add up to its {table - start} bytes of points; it is damaged"
        )
    return [points for points, _ in chunks], table - (chunks[-1][1] if chunks else 0)


def check_coordinates(facts: LasFacts) -> None:
    """Check that whole numbers of 32 bits, scaled and offset, reach the bounds."""
    if not ((facts.scales > 0) & (facts.scales <= COARSEST_SCALE)).all():
        raise Implausible(
            f"its header has the scales {format_list(facts.scales)}; they must be above 0 and at "
            "most 10"
        )
    reach = 2.0**31 * facts.scales + facts.rounding
    limit = np.array([MOST_PLAN, MOST_PLAN, MOST_HEIGHT])
    ordered = (facts.mins <= facts.maxs) & (np.maximum(abs(facts.mins), abs(facts.maxs)) <= limit)
    reached = (facts.mins >= facts.offsets - reach) & (facts.maxs <= facts.offsets + reach)
    if not (ordered & reached).all():
        raise Implausible(
            f"its header's bounds {format_span(facts.mins, facts.maxs)} cannot be those of "
            f"coordinates with the offset ({format_list(facts.offsets)}) and the scale "
            f"({format_list(facts.scales)})"
        )


def with_octree(file: BinaryIO, facts: LasFacts, info: bytes) -> LasFacts:
    """Return the facts with the octree, whose cube and points fit bounds and header."""
    if len(info) < 160:
        raise Implausible(f"its COPC record has {len(info)} bytes instead of 160")
    *centre, half, _, page, page_bytes = struct.unpack_from("<5d2Q", info)
    lower, upper = np.array(centre) - half, np.array(centre) + half
    is_inside = (facts.mins >= lower - facts.rounding) & (facts.maxs <= upper + facts.rounding)
    if facts.count and not is_inside.all():
        raise Implausible(
            f"its octree of half width {half:g} about ({format_list(centre)}) does not hold its "
            "header's bounds"
        )
    nodes = walk_pages(file, facts, page, page_bytes)
    points = nodes["points"].sum(dtype=np.int64)
    if points != facts.count:
        raise Implausible(
            f"its header tells of {facts.count} points, the nodes of its octree of {points}"
        )
    side = np.ldexp(2 * half, -nodes["key"][:, :1])
    corner = lower + nodes["key"][:, 1:] * side
    octree = Octree(nodes, corner - facts.rounding, corner + side + facts.rounding)
    return replace(facts, octree=octree)


def walk_pages(file: BinaryIO, facts: LasFacts, page: int, page_bytes: int) -> np.ndarray:
    """Return all nodes that hold points, in the file's order, visiting every page once."""
    waiting, visited, result = [(page, page_bytes)], set(), [np.empty(0, NODES)]
    while waiting:
        start, length = waiting.pop()
        if start in visited:
            raise Implausible(
                f"its octree's page at byte {start} points to itself or is pointed to twice"
            )
        if length < 0 or start + length > facts.size:
            raise Implausible(
                f"its octree's page of {length} bytes at byte {start} is beyond its {facts.size} "
                "bytes"
            )
        visited.add(start)
        file.seek(start)
        nodes = np.frombuffer(file.read(length // NODES.itemsize * NODES.itemsize), NODES)
        fixed = nodes[nodes["points"] > 0]
        ends = fixed["start"] + np.maximum(fixed["bytes"], 0).astype(np.uint64)
        is_beyond = (fixed["bytes"] <= 0) | (ends > facts.points_end)
        if is_beyond.any() or (nodes["points"] < -1).any():
            raise Implausible(
                f"a node of its octree's page at byte {start} is beyond its points or of negative "
                "size"
            )
        result.append(fixed)
        below = nodes[nodes["points"] == -1]
        waiting += zip(below["start"].tolist(), below["bytes"].tolist(), strict=True)
    nodes = np.concatenate(result)
    return nodes[np.argsort(nodes["start"], kind="stable")]


def check_points(xyz: np.ndarray, facts: LasFacts) -> tuple[np.ndarray, np.ndarray]:
    """Return lowest and highest (3,) of points (n, 3); Implausible outside the header's."""
    lower, upper = compute_bounds(xyz) if len(xyz) else (facts.mins, facts.maxs)
    if not ((lower >= facts.mins - facts.rounding) & (upper <= facts.maxs + facts.rounding)).all():
        raise Implausible(
            f"it has points from {format_span(lower, upper)}, outside its header's bounds "
            f"{format_span(facts.mins, facts.maxs)}; its header or its points are damaged"
        )
    return lower, upper


def check_all_points(lower: np.ndarray, upper: np.ndarray, facts: LasFacts) -> None:
    """Raise Implausible where points from `lower` to `upper` (3,) fall short of the bounds."""
    if not ((lower <= facts.mins + SHORT) & (upper >= facts.maxs - SHORT)).all():
        raise Implausible(
            f"its points reach from {format_span(lower, upper)}, its header's bounds from "
            f"{format_span(facts.mins, facts.maxs)}; its scale, its count or its bounds are wrong"
        )


# How far the points may fall short of the header's bounds, in the file's unit: some producers write
# those of the tile.
SHORT = 1.0


def format_span(lower: np.ndarray, upper: np.ndarray) -> str:
    return f"({format_list(lower)}) to ({format_list(upper)})"


def format_list(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.10g}" for value in values)
