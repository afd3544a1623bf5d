"""Point files that lie or are damaged, each with what hiproof must say of it; all are made from one
small town.
"""

import re
import struct
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np

from read.test_pointcloud import write_copc
from tiny_town import make_town

# where a field stands in the header of LAS, by the ASPRS specification
FIELDS = {
    **{
        "data start": ("<I", 96),
        "vlr count": ("<I", 100),
        "record length": ("<H", 105),
        "count 1.2": ("<I", 107),
    },
    **{
        "x scale": ("<d", 131),
        "z scale": ("<d", 147),
        "x offset": ("<d", 155),
        "y offset": ("<d", 163),
    },
    **{"x max": ("<d", 179), "x min": ("<d", 187), "y max": ("<d", 195), "z max": ("<d", 211)},
    **{
        "evlr start": ("<Q", 235),
        "evlr count": ("<I", 243),
        "count": ("<Q", 247),
        "vlr length": ("<H", 375 + 20),
    },
}


@dataclass(frozen=True)
class Damaged:
    """A file at `path` of which hiproof must say something that `sentence` (a regular expression)
    finds.
    """

    name: str
    path: Path
    sentence: str


def damaged_clouds(folder: Path, seed: int = 0) -> list[Damaged]:
    """Write every damaged cloud into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    sound = sound_clouds(folder / "sound")
    cases = {}
    for name, (ending, raw) in sound.items():
        cases |= {
            f"{kind} in {name}": (ending, *case) for kind, case in header_lies(name, raw).items()
        }
    cases |= laz_lies(sound) | copc_lies(sound) | text_and_ply() | garble(sound, seed)
    results = []
    for name, (ending, content, sentence) in cases.items():
        path = folder / (re.sub(r"[^\w.+-]", "_", name) + ending)
        path.write_bytes(content)
        results.append(Damaged(name, path, sentence))
    return results


def sound_clouds(folder: Path) -> dict[str, tuple[str, bytes]]:
    """The town in every kind of LAS, (ending, content) by name."""
    folder.mkdir(parents=True, exist_ok=True)
    town = make_town(2, 3.0)
    kinds = {"las 1.2": ("1.2", 1, ".las"), "las 1.4": ("1.4", 6, ".las")}
    kinds |= {"laz 1.2": ("1.2", 1, ".laz"), "laz 1.4": ("1.4", 6, ".laz")}
    clouds = {}
    for name, (version, point_format, ending) in kinds.items():
        path = folder / (name.replace(" ", "_") + ending)
        write_las(path, town, version, point_format)
        clouds[name] = (ending, path.read_bytes())
    copc = write_copc(folder / "a.copc.laz", town.xyz, town.classification)
    return clouds | {"copc": (".copc.laz", copc.read_bytes())}


def write_las(path: Path, town, version: str, point_format: int) -> None:
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = [0.001] * 3, np.floor(town.xyz.min(axis=0))
    las = laspy.LasData(header)
    las.x, las.y, las.z = town.xyz.T
    las.classification = town.classification
    las.return_number = las.number_of_returns = np.ones(len(town.xyz), np.uint8)
    las.write(path)


def replace_field(raw: bytes, field: str, value: float) -> bytes:
    form, place = FIELDS[field]
    changed = bytearray(raw)
    struct.pack_into(form, changed, place, value)
    return bytes(changed)


def read_field(raw: bytes, field: str) -> float:
    form, place = FIELDS[field]
    return struct.unpack_from(form, raw, place)[0]


def header_lies(name: str, raw: bytes) -> dict[str, tuple[bytes, str]]:
    """One field of the header changed: (content, sentence) by what was done."""
    count = "count 1.2" if "1.2" in name else "count"
    true = read_field(raw, count)
    lies = {
        "count 0": (count, 0, "0 points"),
        "half the count": (count, true // 2, f"{true // 2} points"),
        "one point more": (count, true + 1, f"{true + 1} points|cannot be decoded"),
        "largest count": (count, 2**32 - 1, "4294967295 points"),
        "scale 0": ("x scale", 0.0, "scale"),
        "negative scale": ("z scale", -0.001, "scale"),
        "scale not a number": ("x scale", np.nan, "scale"),
        "scale 1e300": ("x scale", 1e300, "scale"),
        "scale doubled": ("x scale", 0.002, "bounds"),
        "scale halved": ("z scale", 0.0005, "bounds"),
        "offset 1e12": ("x offset", 1e12, "bounds"),
        "offset 1e300": ("y offset", 1e300, "offset"),
        "offset moved by 64 m": ("y offset", read_field(raw, "y offset") + 64, "bounds"),
        "bound 1e300": ("x max", 1e300, "bounds"),
        "bound infinite": ("y max", np.inf, "bounds"),
        "bound not a number": ("z max", np.nan, "bounds"),
        "bounds swapped": ("x min", read_field(raw, "x max") + 10, "bounds"),
        "bound too narrow": ("x max", read_field(raw, "x max") - 10, "bounds"),
        "vlr count": ("vlr count", 2**32 - 1, "4294967295 records"),
        "record length 0": ("record length", 0, "0 bytes each"),
        "record length 65535": ("record length", 65535, "points|cannot be decoded"),
        "data beyond the end": ("data start", len(raw) + 1000, "byte"),
        "data at 0": ("data start", 0, "byte"),
    }
    if "1.2" not in name:
        lies["count of a million millions"] = (count, 10**12, "1000000000000 points")
        lies["evlr count"] = ("evlr count", 2**32 - 1, "4294967295 records")
    changed = {
        damage: (replace_field(raw, field, value), sentence)
        for damage, (field, value, sentence) in lies.items()
    }
    if "laz" in name or name == "copc":
        place = 227 if "1.2" in name else 375  # COPC's own record, else LASzip's
        changed["record of 65535 bytes"] = (pack(raw, "<H", place + 20, 65535), "record")
    changed["cut in half"] = (raw[: len(raw) // 2], "cut off|truncated|byte")
    changed["cut inside the header"] = (raw[:150], "header")
    return changed


def pack(raw: bytes, form: str, place: int, *values: int) -> bytes:
    changed = bytearray(raw)
    struct.pack_into(form, changed, place, *values)
    return bytes(changed)


def laz_lies(sound: dict) -> dict[str, tuple[str, bytes, str]]:
    """LASzip's table of chunks: where it stands, how many there are, and the table itself."""
    cases = {}
    for name in ("laz 1.2", "laz 1.4"):
        ending, raw = sound[name]
        start = int(read_field(raw, "data start"))
        table = struct.unpack_from("<q", raw, start)[0]
        lies = {
            "4 billion chunks": ("<I", table + 4, 2**32 - 1, "4294967295 chunks"),
            "no chunk": ("<I", table + 4, 0, "chunk table"),
            "two chunks": ("<I", table + 4, 2, "chunk"),
            "garbled chunk sizes": ("<I", table + 8, 0xFFFFFFFF, "chunk"),
            "chunk table beyond the end": ("<q", start, len(raw) + 5, "chunk table"),
            "chunk table before the points": ("<q", start, 10, "chunk table"),
        }
        for damage, (form, place, value, sentence) in lies.items():
            cases[f"{damage} in {name}"] = (ending, pack(raw, form, place, value), sentence)
    return cases


def copc_lies(sound: dict) -> dict[str, tuple[str, bytes, str]]:
    """COPC's hierarchy of pages and nodes; the sound file ends with one page of one node."""
    ending, raw = sound["copc"]
    page = struct.unpack_from("<Q", raw, 375 + 54 + 40)[0]
    itself = pack(raw, "<Qii", page + 16, page, 32, -1)
    lies = {
        "page points to itself": (itself, "itself"),
        "page beyond the end": (pack(raw, "<Q", 375 + 54 + 40, len(raw)), "page"),
        "page of no bytes": (pack(raw, "<Q", 375 + 54 + 48, 0), "0 points"),
        "page of a billion bytes": (pack(raw, "<Q", 375 + 54 + 48, 10**9), "page"),
        "node of two billion points": (pack(raw, "<i", page + 28, 2**31 - 1), "2147483647"),
        "node beyond the end": (pack(raw, "<Q", page + 16, len(raw)), "node"),
        "node of negative size": (pack(raw, "<i", page + 24, -5), "node"),
        "octree of no width": (pack(raw, "<d", 375 + 54 + 24, 0.0), "octree"),
        "octree elsewhere": (pack(raw, "<d", 375 + 54, 0.0), "octree"),
    }
    return {f"{damage} in copc": (ending, *case) for damage, case in lies.items()}


def text_and_ply() -> dict[str, tuple[str, bytes, str]]:
    """Text and PLY that break off, overflow or say what cannot be."""
    ply = "ply\nformat {} 1.0\nelement vertex {}\n{}end_header\n"
    xyz = "property double x\nproperty double y\nproperty double z\n"
    binary, values = "binary_little_endian", np.arange(9.0).tobytes()
    rows = "85010.0 446012.0 7.0\n85011.0 446012.0 7.0\n"
    return {
        "one line of 1e300": (".xyz", f"{rows}1e300 447500 5 6\n".encode(), r"1e\+300"),
        "height of 1e300": (".xyz", f"{rows}85000 446000 1e300\n".encode(), r"1e\+300"),
        "only a byte order mark": (".xyz", b"\xef\xbb\xbf", "x y z"),
        "utf-16": (".txt", rows.encode("utf-16"), "UTF-16"),
        "only blank lines": (".csv", b"\n" * 50, "x y z"),
        "repeated property": (
            ".ply",
            (ply.format(binary, 3, xyz + "property float x\n")).encode() + values,
            "twice",
        ),
        "superscript count": (
            ".ply",
            ply.format("ascii", "²", xyz).encode() + b"1 2 3\n",
            "vertices",
        ),
        "count of a million millions in ply": (
            ".ply",
            ply.format(binary, 10**12, xyz).encode() + values,
            "vertices",
        ),
        "the same in ascii": (
            ".ply",
            ply.format("ascii", 10**12, xyz).encode() + b"1 2 3\n",
            "vertices",
        ),
        "count of 4000 digits": (
            ".ply",
            ply.format(binary, "9" * 4000, xyz).encode() + values,
            "vertices",
        ),
        "negative count": (".ply", ply.format(binary, -3, xyz).encode() + values, "vertices"),
        "coordinate 1e300 in ply": (
            ".ply",
            ply.format("ascii", 1, xyz).encode() + b"1e300 2 3\n",
            r"1e\+300",
        ),
    }


def garble(sound: dict, seed: int) -> dict[str, tuple[str, bytes, str]]:
    """Bytes of the compressed points themselves overwritten at random."""
    rng, cases = np.random.default_rng(seed), {}
    for name in ("laz 1.2", "laz 1.4", "copc"):
        ending, raw = sound[name]
        start = int(read_field(raw, "data start")) + 100
        changed = bytearray(raw)
        for place in rng.integers(start, len(raw) - 300, 40):
            changed[place] ^= int(rng.integers(1, 256))
        cases[f"garbled points in {name}"] = (
            ending,
            bytes(changed),
            "bounds|cannot be decoded|chunk",
        )
    return cases
