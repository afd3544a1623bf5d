"""Footprints of an Overture Maps release: from a small one of the same layout, served on the
loopback address.
"""

import dataclasses
import json

import numpy as np
import pyogrio
import pytest
import shapely
from pyproj import Transformer

from hiproof.city.plan.prepare import make_plan
from hiproof.city.run import Request, reconstruct_area
from hiproof.cli.reconstruct import find_settings_file
from hiproof.errors import InputError, SettingsError
from hiproof.read.outlines.footprints import read_footprints
from hiproof.settings import Settings
from programs import run_hiproof
from range_server import serve
from run_records import records
from tiny_town import CRS, make_town, write_cloud

pyarrow = pytest.importorskip("pyarrow.parquet", reason="the extra `parquet` is not installed")
pytest.importorskip("aiohttp", reason="needs fsspec[http], part of the extra `parquet`")

from overture_release import (  # noqa: E402
    GOOGLE,
    OSM,
    RELEASE,
    building,
    write_release,
)

pytestmark = pytest.mark.filterwarnings("ignore:.*PROJ knows no better way")
TO_DEGREES = Transformer.from_crs("EPSG:28992", "OGC:CRS84", always_xy=True)
TOWN = make_town()
FOOTER_BYTES = 1 << 16  # that pyarrow reads of a file's end at first


def convert_to_degrees(polygon):
    return shapely.transform(polygon, lambda xy: np.column_stack(TO_DEGREES.transform(*xy.T)))


def shift(polygon, x, y=0.0):
    return shapely.transform(polygon, lambda xy: xy + [x, y])


def town_rows():
    """The rows of the town in several row groups: its houses, a cellar below one of them, and
    others far away.
    """

    def row(id, area, x=0.0, y=0.0, **more):
        return building(id, convert_to_degrees(shift(area, x, y)), **more)

    nearby = [row(f"gers-{id}", area) for id, area in TOWN.footprints.items()]
    nearby[0] |= dict(height=8.5, num_floors=2, roof_shape="gabled", min_height=0.0)
    nearby[1]["sources"] = [OSM, GOOGLE]
    first = TOWN.footprints["house-0"]
    odd = [row("gers-cellar", first, 2, is_underground=True), row("gers-beside", first, 0, 60)]
    # of so many vertices that a row group is larger than what readers take for a file's end
    detailed = shapely.segmentize(first, 0.02)
    return nearby, odd, [row(f"gers-far-{i}", detailed, 3000 + 100 * i) for i in range(40)]


def first_byte(metadata, group):
    """Where a row group begins in its file."""
    columns = [metadata.row_group(group).column(i) for i in range(metadata.num_columns)]
    return min(c.dictionary_page_offset or c.data_page_offset for c in columns)


@pytest.fixture(scope="module")
def release(tmp_path_factory):
    """A served folder, its catalogue's address, and the file that lists the ranges asked for."""
    folder = tmp_path_factory.mktemp("served")
    log = folder.with_name("ranges")
    nearby, odd, distant = town_rows()
    with serve(folder, log) as address:
        # the far ones of the first file stand in row groups of their own
        parts = [building("gers-part", nearby[0]["outline"], building_id="gers-house-0")]
        files = {"building": [nearby + distant[:20], odd + distant[20:30], distant[30:]]}
        yield folder, write_release(folder, address, files | {"building_part": [parts]}), log


@pytest.fixture
def served_release(release, town_files, monkeypatch, quick_tiles):
    """The cloud of the town, settings that name the release's catalogue, and an empty log."""
    # solved without compiled code
    monkeypatch.setattr("hiproof.city.work.executors.InProcess.prepare", lambda executor: None)
    _, catalogue, log = release
    log.write_text("")
    read = {"read": {"overture_catalogue": catalogue}, "reconstruct": {"align": "off"}}
    return town_files[0], Settings.from_dict(read), log


def test_a_run_takes_the_buildings_of_the_clouds_extent(served_release, tmp_path):
    cloud, settings, _ = served_release
    out = tmp_path / "out"
    summary = reconstruct_area(Request((str(cloud),), out, "overture", settings=settings))
    assert summary.buildings == len(TOWN.footprints)
    kept = out / ".hiproof" / "overture.gpkg"
    footprints = {f.id: f for f in read_footprints(kept, target_crs=CRS)}
    assert sorted(footprints) == sorted(f"gers-{id}" for id in TOWN.footprints)
    for id, area in TOWN.footprints.items():
        assert shapely.hausdorff_distance(footprints[f"gers-{id}"].polygon, area) < 1e-3
    known = {"height": 8.5, "min_height": 0.0, "num_floors": 2, "roof_shape": "gabled"}
    assert footprints["gers-house-0"].attributes == known | {"id": "gers-house-0"}
    record = json.loads((out / "run.json").read_text())
    assert record["inputs"]["footprints"] == str(kept)
    source = record["footprints_source"]
    expected = {"name": "Overture Maps", "release": RELEASE, "licence": "ODbL-1.0"}
    expected |= {"type": "building"}
    assert {name: source[name] for name in expected} == expected
    assert source["sources"] == [
        {"dataset": "Google Open Buildings", "licence": "CC-BY-4.0", "footprints": 1},
        {"dataset": "OpenStreetMap", "licence": "ODbL-1.0", "footprints": 4},
    ]


def test_a_finished_run_asks_for_no_network(release, served_release, tmp_path):
    cloud, settings, _ = served_release
    request = Request((str(cloud),), tmp_path / "out", "overture", settings=settings)
    first = reconstruct_area(request)
    catalogue = release[0] / "catalog.json"
    catalogue.rename(hidden := catalogue.with_suffix(".hidden"))
    assert reconstruct_area(request).by_status == first.by_status
    with pytest.raises(InputError, match="expected a STAC catalogue"):
        reconstruct_area(dataclasses.replace(request, restart=True))
    hidden.rename(catalogue)


def test_settings_beside_are_not_looked_for_where_overture_is(
    served_release, tmp_path, monkeypatch
):
    """The word names no file, so that the folder in which a run starts has no part in it."""
    (tmp_path / "start").mkdir()
    (tmp_path / "start" / "hiproof.toml").write_text("[fit]\nparts = 'one'\n")
    monkeypatch.chdir(tmp_path / "start")
    assert find_settings_file(str(served_release[0]), "overture") is None


def test_a_kept_file_gives_the_same_models(served_release, tmp_path, capsys):
    cloud, settings, _ = served_release
    config, stored = tmp_path / "settings.toml", tmp_path / "kept.gpkg"
    config.write_text(settings.to_toml())
    assert run_hiproof("footprints", cloud, "--out", stored, "--config", config) == 0
    output = capsys.readouterr().out
    other = tmp_path / "kept.geojson"
    assert run_hiproof("footprints", cloud, "--out", other, "--config", config) == 2
    assert "expected --out to name a GeoPackage" in capsys.readouterr().err
    assert f"{stored}: 4 footprints of Overture Maps {RELEASE} (ODbL-1.0" in output
    names = ["id", "height", "num_floors", "roof_shape"]
    _, _, _, columns = pyogrio.raw.read(stored, columns=names)
    assert [column[0] for column in columns] == ["gers-house-0", 8.5, 2, "gabled"]
    direct, kept = tmp_path / "direct", tmp_path / "kept"
    for out, footprints in ((direct, "overture"), (kept, str(stored))):
        reconstruct_area(Request((str(cloud),), out, footprints, settings=settings))
    assert records(direct) == records(kept)
    notes = [json.loads((out / "run.json").read_text()) for out in (direct, kept)]
    assert notes[0]["footprints_source"] == notes[1]["footprints_source"]


def test_only_the_row_groups_that_meet_the_extent_are_fetched(release, served_release, tmp_path):
    cloud, settings, log = served_release
    config = tmp_path / "settings.toml"
    config.write_text(settings.to_toml())
    run_hiproof("footprints", cloud, "--out", tmp_path / "a.gpkg", "--config", config)
    request = {}
    for line in log.read_text().splitlines():
        path, start, stop = line.split()
        request.setdefault(path.lstrip("/"), []).append((int(start), int(stop)))
    assert sorted(path.rpartition("/")[2][:10] for path in request) == ["part-00000", "part-00001"]
    for path, ranges in request.items():
        metadata = pyarrow.ParquetFile(release[0] / path).metadata
        size = (release[0] / path).stat().st_size
        assert metadata.num_row_groups > 2
        # the row group that holds the town with what is buffered, and the file's end
        assert all(
            stop <= first_byte(metadata, 2) or start >= size - FOOTER_BYTES
            for start, stop in ranges
        )


def test_parts_are_read_as_a_layer(served_release, tmp_path):
    cloud, settings, _ = served_release

    def plan_of(layer):
        request = Request((str(cloud),), tmp_path, "overture", layer=layer, settings=settings)
        return make_plan(request)

    (job,) = plan_of("building_part").jobs
    assert (job.id, job.footprint.attributes["building_id"]) == ("gers-part", "gers-house-0")
    with pytest.raises(SettingsError, match="building and building_part, got 'roofs'"):
        plan_of("roofs")


def test_a_cloud_without_crs_is_refused_in_one_sentence(served_release, tmp_path):
    _, settings, log = served_release
    cloud = write_cloud(tmp_path / "nowhere.laz", TOWN.xyz, TOWN.classification, crs=None)
    with pytest.raises(InputError, match=r"^expected clouds that name their CRS.+--crs$"):
        reconstruct_area(Request((str(cloud),), tmp_path / "out", "overture", settings=settings))
    assert log.read_text() == ""


def test_clouds_across_the_180th_meridian_are_refused(served_release, tmp_path):
    """Their box in longitude and latitude would be a band around the Earth."""
    _, settings, log = served_release
    east = np.array([[815_000.0, 8_140_000.0, 2.0], [830_000.0, 8_141_000.0, 3.0]])
    cloud = write_cloud(
        tmp_path / "fiji.laz", east, np.array([6, 6], np.uint8), "EPSG:32760", east[0]
    )
    with pytest.raises(InputError, match=r"one side of the 180th meridian.+; run each side alone$"):
        reconstruct_area(Request((str(cloud),), tmp_path / "out", "overture", settings=settings))
    assert log.read_text() == ""


def test_a_run_without_a_network_is_refused_in_one_sentence(served_release, tmp_path):
    cloud, _, _ = served_release
    settings = Settings.from_dict(
        {"read": {"overture_catalogue": "http://127.0.0.1:9/catalog.json"}}
    )
    with pytest.raises(InputError, match=r"^expected a STAC catalogue at http://127.+network$"):
        reconstruct_area(Request((str(cloud),), tmp_path / "out", "overture", settings=settings))
