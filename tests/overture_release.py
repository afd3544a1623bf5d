"""A release of Overture's layout in small, as files of a folder that is served: a STAC catalogue
and GeoParquet files of several row groups.
"""

import json

import numpy as np
import pyarrow
import pyarrow.parquet
import shapely

RELEASE = "2026-09-23.1"
OSM = {"property": "", "dataset": "OpenStreetMap", "license": "ODbL-1.0", "record_id": "w1@2"}
GOOGLE = {"property": "", "dataset": "Google Open Buildings", "license": "CC-BY-4.0"}


def write_json(path, **content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"stac_version": "1.1.0", **content}), encoding="utf-8")


def links(relation, *addresses):
    return [{"rel": relation, "href": address} for address in addresses]


def building(id, outline, **values):
    """A row: its `outline` in longitude and latitude and what is known of it."""
    return {"id": id, "outline": outline, "sources": [OSM], **values}


def row_table(rows):
    """Arrow's table of rows with the columns of a release's file."""
    boxes = shapely.bounds([row["outline"] for row in rows]).astype(np.float32).tolist()
    columns = {
        "id": pyarrow.string(),
        "geometry": pyarrow.binary(),
        "bbox": pyarrow.struct(
            [(side, pyarrow.float32()) for side in ("xmin", "xmax", "ymin", "ymax")]
        ),
        "names": pyarrow.struct([("primary", pyarrow.string())]),
        "sources": pyarrow.list_(pyarrow.struct([(key, pyarrow.string()) for key in OSM])),
        "height": pyarrow.float64(),
        "min_height": pyarrow.float64(),
        "num_floors": pyarrow.int32(),
        "roof_shape": pyarrow.string(),
        "is_underground": pyarrow.bool_(),
        "building_id": pyarrow.string(),
    }
    is_known = [
        {
            **row,
            "geometry": shapely.to_wkb(row["outline"]),
            "bbox": dict(zip(("xmin", "ymin", "xmax", "ymax"), box, strict=True)),
        }
        for row, box in zip(rows, boxes, strict=True)
    ]
    geometry = {
        "encoding": "WKB",
        "geometry_types": ["Polygon"],
        "bbox": shapely.total_bounds([row["outline"] for row in rows]).tolist(),
        "covering": {"bbox": {s: ["bbox", s] for s in ("xmin", "ymin", "xmax", "ymax")}},
    }
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": geometry}}
    schema = pyarrow.schema(list(columns.items()), {"geo": json.dumps(geo)})
    return pyarrow.Table.from_pylist(is_known, schema=schema)


def write_release(folder, address, files, row_group_size=4):
    """Write a catalogue of two releases, of which the older one is gone, into `folder`, served at
    `address`; `files` are lists of rows by type.
    """
    base_address = f"{address}/{RELEASE}"
    older = links("child", f"{address}/2026-08-19.0/catalog.json")
    write_json(
        folder / "catalog.json",
        id="Overture Releases",
        latest=RELEASE,
        links=[*older, *links("child", f"{base_address}/catalog.json")],
    )
    write_json(
        folder / RELEASE / "catalog.json",
        **{"id": RELEASE, "release:version": RELEASE},
        links=links(
            "child", f"{base_address}/base/catalog.json", f"{base_address}/buildings/catalog.json"
        ),
    )
    theme = folder / RELEASE / "buildings"
    kinds = [f"{base_address}/buildings/{kind}/collection.json" for kind in files]
    write_json(theme / "catalog.json", id="buildings", links=links("child", *kinds))
    for kind, lists in files.items():
        numbers = [f"{number:05}" for number in range(len(lists))]
        ways = [f"{base_address}/buildings/{kind}/{number}/{number}.json" for number in numbers]
        write_json(
            theme / kind / "collection.json",
            id=kind,
            license="ODbL-1.0",
            links=links("item", *ways),
        )
        for number, rows in zip(numbers, lists, strict=True):
            write_part(folder, address, theme / kind, kind, number, rows, row_group_size)
    return f"{address}/catalog.json"


def write_part(folder, address, place, kind, number, rows, row_group_size):
    """Write one file of a type and the item that lists it."""
    name = f"release/{RELEASE}/theme=buildings/type={kind}/part-{number}-c000.zstd.parquet"
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    pyarrow.parquet.write_table(
        row_table(rows), folder / name, row_group_size=row_group_size, compression="zstd"
    )
    aws = {"href": f"{address}/{name}", "type": "application/vnd.apache.parquet"}
    write_json(
        place / number / f"{number}.json",
        type="Feature",
        id=number,
        bbox=shapely.total_bounds([row["outline"] for row in rows]).tolist(),
        assets={"aws": aws, "azure": {"href": f"https://example.org/{name}"}},
        collection=kind,
    )
