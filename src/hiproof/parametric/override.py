"""Overrides: what a person fixes of one building, and the fit keeps.

The points determine the rest. Where they contradict an override, a remark says so.

An override is an object with the building's `id` and any of

    type, types       the type of the part that shows the largest area; types that parts may have
    parts             how many parts at most, or the parts themselves as in parameters.jsonl (with
                      `origin`, perhaps `outline`)
    ridge_height, eave_height     of that part, world metres
    fixed             further parameters of that part by name
    z_ground          height of the ground, world metres
    block_height      a flat block so high above its ground
    leave_out         true: no model
    note, who, when   kept in the building's detail
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely

from ..compose.readable import MOST_PARTS
from ..data_files import Values
from ..errors import FitError, HiproofError, InputError
from ..frames import LocalFrame
from ..model import Building, Footprint, as_xyz
from ..read.models.damage import excerpt
from ..read.plausible import HIGHEST_BUILDING_M, HIGHEST_LAND_M, LOWEST_LAND_M
from ..settings import Settings
from ..stages.footprint import align_footprint, start_building
from ..stages.ground import Ground, find_ground, query_terrain
from ..stages.outline import to_local
from ..stages.points import usable
from ..stages.remarks import add_remark
from ..stages.solid import add_installations, add_overhangs, open_passages, reach_terrain
from ..status import Doubt, Status
from ..write.attribute_list import TABLES
from ..write.parameters import building_record, outline_record
from .building import build
from .edit import rebuild
from .record import number, numbers_by_name, place, polygon, read_value, require_mapping
from .refit import measure_building

SHAPING = ("type", "types", "ridge_height", "eave_height", "fixed")
NOTE_KEYS = ("note", "who", "when")
KEYS = (
    "id",
    *SHAPING,
    "parts",
    "origin",
    "outline",
    "z_ground",
    "block_height",
    "leave_out",
    *NOTE_KEYS,
)

# Difference (m) between a ground given and the terrain from which on it is remarked: a code for
# "unknown", or another height system. Ground levels of registers differ less from the lowest
# terrain along the walls.
FAR_GIVEN_GROUND_M = 5.0

# Least and largest possible value of keys that are numbers. Codes such as -9999 lie beyond.
RANGES = {
    **dict.fromkeys(("z_ground", "ridge_height", "eave_height"), (LOWEST_LAND_M, HIGHEST_LAND_M)),
    "block_height": (0.1, HIGHEST_BUILDING_M),
    "parts": (1.0, float(MOST_PARTS)),
}


@dataclass(frozen=True)
class Override:
    """A checked override, None or empty where it fixes nothing; `fixed` also has heights."""

    id: str
    type: str | None = None
    types: tuple[str, ...] = ()
    most_parts: int | None = None
    parts: list[Values] | None = None
    origin: np.ndarray | None = None
    outline: list[Any] | None = None
    fixed: dict[str, float] = field(default_factory=dict)
    z_ground: float | None = None
    block_height: float | None = None
    leave_out: bool = False
    told: str = ""


def read_override(record: Values) -> Override:
    """Read an override from an object.

    Raises InputError, one sentence, where it cannot be or contradicts itself.

    >>> read_override({"id": "a", "type": "hip", "ridge_height": 12.4}).fixed
    {'ridge_height': 12.4}
    """
    record = {
        k: v for k, v in require_mapping(record, "an override").items() if v is not None and v != ""
    }
    id = str(record.get("id", ""))
    text = f"the override of {id!r}"
    if not id:
        raise InputError("expected the id of a building in every override, got none; give one")
    has_list = isinstance(record.get("parts"), list)
    # a line of parameters.jsonl is an override; its type and types are what came of the fit
    if has_list:
        ignored = set(TABLES["building"].names) - {"id", "parts", "origin", "outline", "z_ground"}
        record = {key: value for key, value in record.items() if key not in ignored}
    other = [name for name in record if name not in KEYS]
    if other:
        raise InputError(
            f"expected {', '.join(KEYS)} in {text}, got also {', '.join(other[:8])}; remove it"
        )
    refuse_contradictions(record, has_list, text)
    fixed = numbers_by_name(record.get("fixed", {}), f"fixed of {text}")
    numbers = {
        key: check_number(key, record[key], text)
        for key in RANGES
        if key in record and not (key == "parts" and has_list)
    }
    fixed |= {key: numbers[key] for key in ("ridge_height", "eave_height") if key in numbers}
    count = numbers.get("parts")
    if count is not None and count != int(count):
        raise InputError(
            f"expected a whole number of parts from 1 in {text}, got {count:g}; or give a list of "
            "parts"
        )
    types = read_types(record, text)
    if "outline" in record:
        polygon(record["outline"], f"outline of {text}")
    return Override(
        id=id,
        type=record.get("type"),
        types=types,
        most_parts=None if count is None else int(count),
        parts=record["parts"] if has_list else None,
        origin=place(record["origin"], f"origin of {text}") if "origin" in record else None,
        outline=record.get("outline"),
        fixed=fixed,
        z_ground=numbers.get("z_ground"),
        block_height=numbers.get("block_height"),
        leave_out=bool(record.get("leave_out", False)),
        told=describe_override(record, has_list),
    )


def check_number(key: str, value: Any, where: str) -> float:
    """Check the number of a key of RANGES; raises InputError where no building has it."""
    result, (lower, upper) = number(value, f"{key} of {where}"), RANGES[key]
    if not lower <= result <= upper:
        raise InputError(
            f"expected {key} from {lower:g} to {upper:g} in {where}, got {result:g}; leave it out "
            "where unknown"
        )
    return result


def refuse_contradictions(record: Values, has_list: bool, where: str) -> None:
    """Raise InputError where values exclude each other, or one is neither yes nor no."""
    if record.get("leave_out", False) not in (True, False):
        raise InputError(
            f"expected true or false as leave_out of {where}, got {excerpt(record['leave_out'])}; "
            "say which"
        )
    single = {
        "leave_out": (bool(record.get("leave_out")), (*SHAPING, "parts", "block_height")),
        "block_height": ("block_height" in record, (*SHAPING, "parts")),
        "a list of parts": (has_list, SHAPING),
    }
    for name, (is_given, neighbours) in single.items():
        against = [key for key in neighbours if key in record]
        if is_given and against:
            raise InputError(
                f"expected {name} without {', '.join(neighbours)} in {where}, got also "
                f"{against[0]}; keep one"
            )
    if has_list and "origin" not in record:
        raise InputError(
            f"expected the origin of its parts in {where}, got none; copy that of parameters.jsonl"
        )


def read_types(record: Values, where: str) -> tuple[str, ...]:
    """Read the types, commas between them, that parts may have, none without any."""
    given_types = record.get("types", ())
    names = given_types.split(",") if isinstance(given_types, str) else given_types
    if not isinstance(names, (list, tuple)) or ("types" in record and not names):
        raise InputError(
            f"expected a list of roof types as types of {where}, got {excerpt(given_types)}; name "
            "one at least"
        )
    types = tuple(name.strip() if isinstance(name, str) else name for name in names)
    for name in (*types, record.get("type", "flat")):
        read_value(name, "roof_type", f"a type of {where}")
    if types and record.get("type", types[0]) not in types:
        raise InputError(
            f"expected the type among the types in {where}, got {record['type']!r}; keep one of "
            "them"
        )
    return types


def describe_override(record: Values, has_list: bool) -> str:
    """Describe the override in words, for the building's detail."""
    phrases = [
        f"{name} {record[name]}"
        for name in (*SHAPING, "z_ground", "block_height")
        if name in record
    ]
    phrases += (
        ["parts given"] if has_list else [f"parts {record['parts']}"] if "parts" in record else []
    )
    note = ", ".join(str(record[name])[:200] for name in NOTE_KEYS if name in record)
    return (
        "overridden: "
        + ", ".join(phrases or ["left out"] if record.get("leave_out") else phrases)
        + (f" ({note})" if note else "")
    )


def overridden(
    override: Override,
    points: np.ndarray,
    footprint: shapely.Polygon | Footprint | None = None,
    terrain: Any = None,
    settings: Settings | None = None,
    id: str = "building",
    ground: np.ndarray | None = None,
    neighbours: Sequence[shapely.Polygon] = (),
) -> Building:
    """Reconstruct a building with its override; the rest is as in `hiproof.reconstruct`."""
    points, settings = as_xyz(points), settings or Settings()
    building = start_building(footprint, id)
    if override.leave_out:
        return dataclasses.replace(building, status=Status.LEFT_OUT, detail=override.told)
    try:
        if override.parts is not None or override.block_height is not None:
            result = build_given(override, points, building, terrain, settings, footprint)
        else:
            arguments = points, footprint, terrain, settings, id, ground
            result = fit_within(override, *arguments, neighbours)
    except HiproofError as error:
        result = dataclasses.replace(building, status=Status.NOT_BUILT, detail=str(error))
    z_ground = override.z_ground
    if z_ground is not None and result.built is not None:
        if result.solid.vertices[:, 2].min() < z_ground - 1e-3:
            result = add_remark(result, "the ground given lies above its lowest eave")
    result = add_overhangs(result, points, neighbours, settings)
    result = add_remark(result, remark_given_ground(result, z_ground, terrain))
    return add_remark(result, override.told)


def remark_given_ground(building: Building, z_ground: float | None, terrain: Any) -> str:
    """Return a remark where the given ground is far from the terrain under it, else ""."""
    if z_ground is None or terrain is None or building.built is None:
        return ""
    heights, source = query_terrain(terrain, shapely.get_coordinates(building.roof.world_outline))
    if (
        not np.isfinite(heights).any()
        or abs(gap := z_ground - float(np.nanmin(heights))) < FAR_GIVEN_GROUND_M
    ):
        return ""
    return (
        f"{Doubt.GROUND_GIVEN_ELSEWHERE.value} {abs(gap):.1f} m "
        f"{'above' if gap > 0 else 'below'} the {source}"
    )


def build_given(
    override: Override,
    points: np.ndarray,
    building: Building,
    terrain: Any,
    settings: Settings,
    given: shapely.Polygon | Footprint | None = None,
) -> Building:
    """Return the building of the given parts or block.

    `given` is its footprint with passages. It is measured on its points where there are any, and
    its footprint is moved as a run moves it.
    """
    building, footprint, of_footprint = align_footprint(building, points, settings)
    points, outline, status = usable(points, footprint)
    if status is Status.BAD_FOOTPRINT and override.outline is None:
        return dataclasses.replace(building, status=status, detail=status.value)
    frame = (
        LocalFrame(override.origin)
        if override.origin is not None
        else choose_frame(points, outline)
    )
    local = frame.to_local(points)
    rings = override.outline or outline_record(to_local(outline, frame))
    if rings is None:
        raise InputError(
            "expected an outline, or a footprint, of a building whose parts are given, got "
            "neither; give one"
        )
    area = polygon(rings, "outline")
    walls = settings.reconstruct.walls
    ground = choose_ground(override, area, local, frame, terrain, walls)
    parts = override.parts
    if parts is None and override.block_height is not None:
        parts = [describe_block(rings, ground.z + override.block_height - frame.origin[2])]
    created = build_over_ground(building, Status.MODELLED, frame, rings, ground, parts, settings)
    created = dataclasses.replace(created, detail="as given")
    created = measure_building(created, local) if len(local) else created
    created = reach_terrain(created, ground, settings)
    created = open_passages(created, ground, given)
    created = add_installations(created, local, settings)
    return add_remark(created, of_footprint)


def build_over_ground(
    building: Building,
    status: Status,
    frame: LocalFrame,
    rings: Any,
    ground: Ground,
    parts: Any,
    settings: Settings,
) -> Building:
    """Return the building of `parts` over the outline `rings` and a ground, with a status."""
    record = {
        "id": building.id,
        "status": status.code,
        "origin": frame.origin.tolist(),
        "outline": rings,
        "z_ground": ground.z,
        "ground_source": ground.source,
        "parts": parts,
    }
    created = build(record, settings.compose)
    return dataclasses.replace(
        created,
        detail=status.value,
        terrain_intersection=ground.intersection,
        attributes=building.attributes,
        footprint=created.footprint if building.footprint is None else building.footprint,
        shift=building.shift,
    )


def describe_block(rings: Any, z_local: float) -> Values:
    """Return the object of a level part over the outline `rings`."""
    position = [0.0, 0.0, z_local]
    rows = {"type": "flat", "parameters": {}, "position": position, "rotation": 0.0}
    return rows | {"outlines": [rings]}


def choose_frame(points: np.ndarray, outline: shapely.Polygon | None) -> LocalFrame:
    """Return the frame about the points, about the outline without points."""
    if len(points):
        return LocalFrame.around(points)
    if outline is None:
        raise InputError("expected points or a footprint of a block, got neither; give a footprint")
    corners = shapely.get_coordinates(outline)  # those of courtyards too
    return LocalFrame.around(np.column_stack([corners, np.zeros(len(corners))]))


def choose_ground(
    override: Override,
    outline: shapely.Polygon,
    points: np.ndarray,
    frame: LocalFrame,
    terrain: Any,
    walls: str,
) -> Ground:
    """Return the ground: as given, else the terrain's."""
    ground = find_ground(
        outline, points if len(points) else np.zeros((1, 3)), frame, terrain, walls=walls
    )
    if override.z_ground is not None:
        return dataclasses.replace(ground, z=override.z_ground, source="override")
    if not len(points) and ground.source.startswith("assumed"):
        raise InputError(
            "expected the height of the ground (z_ground) where neither points nor terrain tell "
            "it, got none; give it"
        )
    return ground


def fit_within(
    override: Override,
    points: np.ndarray,
    footprint: shapely.Polygon | Footprint | None,
    terrain: Any,
    settings: Settings,
    id: str,
    ground: np.ndarray | None,
    neighbours: Sequence[shapely.Polygon],
) -> Building:
    """Fit the building and hold what is given."""
    from ..method import reconstruct

    types = override.types or ((override.type,) if override.type else ())
    changes = {"types": types} if types else {}
    # whoever says how a building is says that it stands
    settings = settings.replace({"fit": changes, "reconstruct": {"empty_footprints": "model"}})
    level = settings.replace({"write": {"lods": ("2.2",)}})  # overhangs follow the last change
    building = reconstruct(points, footprint, terrain, level, id, ground, neighbours=neighbours)
    if building.built is None:
        return building
    changed = False
    while override.most_parts is not None and len(building.parts) > override.most_parts:
        shown_m2 = building.model.visible_m2
        building, changed = building.without_part(shown_m2.index(min(shown_m2))), True
    main = building.model.main
    if override.type and building.parts[main].type != override.type:
        building, changed = building.with_part(main, type=override.type), True
    if changed:
        building = try_refit(building, points, {})
    if override.fixed:
        building = building.with_part(main, **override.fixed)
        fixed = {main: (*building.parts[main].parameters, "z")}
        building = try_refit(building, points, fixed)
    if override.z_ground is not None:
        record = building_record(building) | {
            "z_ground": override.z_ground,
            "ground_source": "override",
        }
        repeat = rebuild(building, record)
        detail = "; ".join(  # but for the remark of a doubt that no longer holds
            remark
            for remark in building.detail.split("; ")
            if Doubt.GROUND_ABOVE_EAVES.value not in remark
        )
        repeat = dataclasses.replace(repeat, quality=building.quality, grade=building.grade)
        building = dataclasses.replace(repeat, status=building.status, detail=detail)
    return building


def try_refit(
    building: Building, points: np.ndarray, fixed: dict[int, tuple[str, ...]]
) -> Building:
    """Refit the building; return it as it is where its points are too few."""
    try:
        return building.refit(points, fixed)
    except FitError:
        return building
