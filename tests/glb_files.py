"""Binary glTF read by a few lines of our own."""

import json
import struct

import numpy as np

KINDS = {5126: "<f4", 5125: "<u4", 5123: "<u2", 5121: "u1"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


def parse_glb(path):
    """The JSON document and the binary buffer of the file at `path`."""
    data = path.read_bytes()
    magic, version, length = struct.unpack("<III", data[:12])
    assert (magic, version, length) == (0x46546C67, 2, len(data))
    size, kind = struct.unpack("<II", data[12:20])
    assert kind == 0x4E4F534A and size % 4 == 0
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def view_bytes(document, binary, index):
    view = document["bufferViews"][index]
    assert view["byteOffset"] % 8 == 0 and view["byteOffset"] + view["byteLength"] <= len(binary)
    return binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]


def accessor_values(document, binary, index):
    """The values (n,) or (n, k) of an accessor, whose bounds are those it says."""
    accessor = document["accessors"][index]
    width = WIDTHS[accessor["type"]]
    values = np.frombuffer(
        view_bytes(document, binary, accessor["bufferView"]), KINDS[accessor["componentType"]]
    )
    values = values.reshape(-1, width) if width > 1 else values
    assert len(values) == accessor["count"]
    if "min" in accessor:
        assert values.min(axis=0).tolist() == accessor["min"]
        assert values.max(axis=0).tolist() == accessor["max"]
    return values
