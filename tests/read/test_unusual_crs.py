"""Any CRS definition is understood, or its unit and axes are, or it is refused in one sentence."""

import struct

import laspy
import numpy as np
import pyproj
import pytest
import shapely
from laspy.vlrs.vlr import VLR
from pyproj import CRS

from hiproof.city.plan.frame import settle_frame
from hiproof.city.plan.prepare import read_headers
from hiproof.city.run import Request
from hiproof.errors import InputError, InputWarning
from hiproof.read.crs import UnknownCRS, find_units, names_place, parse_crs, vertical_crs
from hiproof.read.outlines.footprints import read_footprints
from hiproof.read.points.las_crs import las_crs
from hiproof.read.points.pointcloud import read_header, read_points
from hiproof.read.terrain import read_terrain
from hiproof.settings import Settings
from layers import write_layer, write_raster

pytestmark = pytest.mark.filterwarnings(
    "ignore:You will likely lose important projection information"
)
FOOT, US_FOOT = 0.3048, 1200 / 3937
UTM = CRS("EPSG:32633").to_wkt("WKT1_GDAL")
TEXAS = CRS("EPSG:2277").to_wkt("WKT1_ESRI")
VERTCS = (
    'VERTCS["NAVD88",VDATUM["North_American_Vertical_Datum_1988"],PARAMETER["Vertical_Shift",0.0],'
)


def local(unit, axes="east,north"):
    first, second = axes.split(",")
    return (
        f'ENGCRS["site",EDATUM["peg"],CS[Cartesian,2],AXIS["x",{first}],AXIS["y",{second}],{unit}]'
    )


def replace_unit(wkt, unit):
    """UTM with another unit in plan."""
    return wkt.partition('UNIT["metre"')[0] + f'UNIT[{unit}],AXIS["E",EAST],AXIS["N",NORTH]]'


def add_heights(plan, unit, direction="UP"):
    vertical = f'VERT_CS["h",VERT_DATUM["x",2005],UNIT[{unit}],AXIS["H",{direction}]]'
    return f'COMPD_CS["both",{plan},{vertical}]'


UNDERSTOOD = {
    "a national grid": ("EPSG:28992", 1.0, 1.0),
    "north before east": ("EPSG:2193", 1.0, 1.0),
    "polar, both axes to the south": ("EPSG:5041", 1.0, 1.0),
    "polar, both axes to the north": ("EPSG:3031", 1.0, 1.0),
    "US feet, heights in metres": ("EPSG:2277+5703", US_FOOT, 1.0),
    "US feet, heights in feet": ("EPSG:2277+8228", US_FOOT, FOOT),
    "feet, heights in US feet": ("EPSG:2222+6360", FOOT, US_FOOT),
    "metres, heights in US feet": ("EPSG:32614+6360", 1.0, US_FOOT),
    "kilometres": ("+proj=utm +zone=33 +datum=WGS84 +units=km", 1000.0, 1000.0),
    "a unit of its own": ("+proj=utm +zone=33 +datum=WGS84 +to_meter=0.9144", 0.9144, 0.9144),
    "bound, with heights": (
        "+proj=utm +zone=33 +ellps=bessel +towgs84=1,2,3 +units=us-ft +vunits=m",
        US_FOOT,
        1.0,
    ),
    "bound compound": (
        "+proj=utm +zone=33 +datum=WGS84 +geoidgrids=egm96_15.gtx +vunits=us-ft",
        1.0,
        US_FOOT,
    ),
    "Esri's pair": (
        f'{TEXAS},{VERTCS}PARAMETER["Direction",1.0],UNIT["Foot_US",{US_FOOT}]]',
        US_FOOT,
        US_FOOT,
    ),
    "a projection without a unit": (UTM.partition(',UNIT["metre"')[0] + "]", 1.0, 1.0),
    "with time": (
        f'COMPOUNDCRS["t",{CRS("EPSG:2277").to_wkt()},TIMECRS["GPS",TDATUM["t",TIMEORIGIN[1980-01-01]],'
        'CS[temporal,1],AXIS["time",future],TIMEUNIT["day",86400.0]]]',
        US_FOOT,
        US_FOOT,
    ),
    "a projection nobody knows": (
        replace_unit(UTM, f'"foot",{FOOT}').replace("Transverse_Mercator", "Mine"),
        FOOT,
        FOOT,
    ),
}
"""(definition, metres in a unit of plan and of height) of what has a place on the Earth."""

LOCAL = {
    "LOCAL_CS": (
        'LOCAL_CS["site",LOCAL_DATUM["d",0],UNIT["metre",1],AXIS["X",EAST],AXIS["Y",NORTH]]',
        1.0,
        1.0,
    ),
    "MapInfo's Nonearth": ('LOCAL_CS["Nonearth",UNIT["Meter",1]]', 1.0, 1.0),
    "a name alone": ('LOCAL_CS["site"]', 1.0, 1.0),
    "US feet": ('LOCAL_CS["Nonearth",UNIT["US survey foot",0.304800609601219]]', US_FOOT, US_FOOT),
    "ENGCRS in centimetres": (
        local('LENGTHUNIT["centimetre",0.01]', "unspecified,unspecified"),
        0.01,
        0.01,
    ),
    "turned axes": (local('LENGTHUNIT["metre",1]', "southWest,southEast"), 1.0, 1.0),
    "of a ship": (local('LENGTHUNIT["metre",1]', "starboard,forward"), 1.0, 1.0),
    "three axes": (
        'ENGCRS["site",EDATUM["p"],CS[Cartesian,3],AXIS["x",east,LENGTHUNIT["foot",0.3048]],'
        'AXIS["y",north,LENGTHUNIT["foot",0.3048]],AXIS["z",up,LENGTHUNIT["metre",1]]]',
        FOOT,
        1.0,
    ),
    "with heights": (
        add_heights('LOCAL_CS["site",UNIT["foot",0.3048]]', f'"US survey foot",{US_FOOT}'),
        FOOT,
        US_FOOT,
    ),
    "heights alone in metres": ("EPSG:5709", 1.0, 1.0),
}
"""(definition, metres in a unit of plan and of height) of what leaves the place open."""

REFUSED = {
    "degrees": ("EPSG:4326", "in degrees"),
    "degrees in space": ("EPSG:4979", "in degrees"),
    "degrees with heights": ("EPSG:4326+5773", "in degrees"),
    "turned degrees": (
        "+proj=ob_tran +o_proj=longlat +o_lon_p=0 +o_lat_p=39.25 +lon_0=18",
        "in degrees",
    ),
    "geocentric": ("EPSG:4978", "geocentric"),
    "heights alone in feet": ("EPSG:6360", "heights alone"),
    "south and west": ("EPSG:5513", "south and west"),
    "south and west of Ferro": ("EPSG:2065", "south and west"),
    "west and south": ("EPSG:2048", "west and south"),
    "a mirrored site": (local('LENGTHUNIT["metre",1]', "west,north"), "west and north"),
    "depths": ("EPSG:32633+5715", "depths"),
    "Esri's depths": (
        f'{TEXAS},{VERTCS}PARAMETER["Direction",-1.0],UNIT["Foot_US",{US_FOOT}]]',
        "depths",
    ),
    "units of 1e-300 m": ("+proj=utm +zone=33 +datum=WGS84 +to_meter=1e-300", "1e-300"),
    "units of nothing": (replace_unit(UTM, '"unknown",0'), "unit of length"),
    "units below nothing": (replace_unit(UTM, '"metre",-1'), "unit of length"),
    "a local one in parsecs": ('LOCAL_CS["far",UNIT["parsec",3.08e16]]', "unit of length"),
    "a plan in degrees": (replace_unit(UTM, '"degree",0.0174532925199433'), "degree"),
    "heights in degrees": (add_heights(UTM, '"degree",0.0174532925199433'), "degree"),
    "heights in nothing": (add_heights(UTM, '"unknown",0'), "unit of length"),
    "two units": (
        'ENGCRS["s",EDATUM["P1"],CS[Cartesian,2],AXIS["x",east,LENGTHUNIT["foot",0.3048]],'
        'AXIS["y",north,LENGTHUNIT["metre",1]]]',
        "one unit",
    ),
    "time alone": (
        'TIMECRS["GPS",TDATUM["t",TIMEORIGIN[1980-01-01]],CS[temporal,1],AXIS["time",future],TIMEUNIT["day",86400.0]]',
        "two axes",
    ),
    "pressure": (
        'PARAMETRICCRS["air",PDATUM["sea",ANCHOR["1013 '
        'hPa"]],CS[parametric,1],AXIS["p",up],PARAMETRICUNIT["hPa",100]]',
        "two axes",
    ),
    "a unit by its name alone": ('LOCAL_CS["Nonearth",UNIT["Meter"]]', "UNIT"),
    "a unit that is no number": ('LOCAL_CS["Nonearth",UNIT["Meter",many]]', "non double"),
    "a unit of to_meter=-1": ("+proj=utm +zone=33 +datum=WGS84 +to_meter=-1", "to_meter"),
    "heights before the plan": (
        f'COMPD_CS["x",VERT_CS["h",VERT_DATUM["x",2005],UNIT["metre",1]],{UTM}]',
        "COMPD",
    ),
}
"""(definition, what the sentence must name)."""


@pytest.mark.parametrize("kind", [*UNDERSTOOD, *LOCAL])
def test_units_are_understood_and_so_is_whether_there_is_a_place(kind):
    definition, plan, height = (UNDERSTOOD | LOCAL)[kind]
    crs = parse_crs(definition)
    units = find_units(crs)
    assert (units.plan, units.height) == pytest.approx((plan, height), rel=1e-12)
    assert names_place(crs) is (kind in UNDERSTOOD)


@pytest.mark.parametrize("kind", REFUSED)
def test_what_no_roof_can_be_built_in_is_refused_in_one_sentence(kind):
    definition, message = REFUSED[kind]
    with pytest.raises(InputError, match=message) as caught:
        find_units(parse_crs(definition), "the cloud")
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_a_derived_projected_crs_is_understood():
    base = CRS("EPSG:25832").to_json_dict()
    parameters = {"A0": -500000, "A1": 1, "A2": 0, "B0": 0, "B1": 0, "B2": 1}
    derived = {
        "type": "DerivedProjectedCRS",
        "name": "derived",
        "base_crs": {key: value for key, value in base.items() if key not in ("$schema", "id")},
        "conversion": {
            "name": "Affine",
            "method": {
                "name": "Affine parametric transformation",
                "id": {"authority": "EPSG", "code": 9624},
            },
            "parameters": [
                {"name": key, "value": value, "unit": "metre"} for key, value in parameters.items()
            ],
        },
        "coordinate_system": base["coordinate_system"],
    }
    crs = CRS.from_json_dict(derived)
    assert names_place(crs) and find_units(crs).are_metres


def directory(*keys):
    return struct.pack("<4H", 1, 1, 0, len(keys)) + b"".join(
        struct.pack("<4H", *key) for key in keys
    )


def short(**values):
    """Entries of a directory that hold their value themselves."""
    return [(int(key[1:]), 0, 1, value) for key, value in values.items()]


def header_with(*records):
    header = laspy.LasHeader(point_format=1, version="1.2")
    header.scales, header.offsets = [0.01] * 3, [0, 0, 0]
    header.vlrs += [VLR("LASF_Projection", number, "", content) for number, content in records]
    return header


def crs_through_a_file(folder, *records):
    las = laspy.LasData(header_with(*records))
    las.x, las.y, las.z = np.array([[500000.0, 500010.0], [4649776.0, 4649786.0], [100.0, 110.0]])
    las.write(folder / "a.las")
    return read_header(folder / "a.las").crs


CITATION = b"NAD83 / Texas Central (ftUS)|\0"
OWN = [(1026, 34737, 29, 0), *short(k1024=1, k3072=32767)]
KEYS = {
    "a code": (short(k3072=26914), 1.0, 1.0, 26914),
    "a code and its unit": (short(k1024=1, k3072=2277, k3076=9003), US_FOOT, US_FOOT, 2277),
    "a code of metres in US feet": (short(k3072=26957, k3076=9003), US_FOOT, US_FOOT, None),
    "its own projection in US feet": ([*OWN, (3076, 0, 1, 9003)], US_FOOT, US_FOOT, None),
    "its own projection in feet": ([*OWN, (3076, 0, 1, 9002)], FOOT, FOOT, None),
    "its own projection in kilometres": ([*OWN, (3076, 0, 1, 9036)], 1000.0, 1000.0, None),
    "its own projection and unit": (
        [*OWN, (3076, 0, 1, 32767), (3077, 34736, 1, 1)],
        0.9144,
        0.9144,
        None,
    ),
    "with a base in degrees": ([*OWN, *short(k2048=4269, k3076=9003)], US_FOOT, US_FOOT, None),
    "no code, but a unit": (short(k1024=32767, k3076=9002), FOOT, FOOT, None),
    "NAVD88 by GeoTIFF, US feet": (short(k3072=26914, k4096=5103, k4099=9003), 1.0, US_FOOT, 26914),
    "NAVD88 by GeoTIFF, metres": (short(k3072=26914, k4096=5103, k4099=9001), 1.0, 1.0, 26914),
    "NAVD88 by GeoTIFF": (short(k3072=2277, k4096=5103), US_FOOT, 1.0, 2277),
    "NGVD29 by GeoTIFF": (short(k3072=26914, k4096=5102), 1.0, US_FOOT, 26914),
    "above an ellipsoid": (short(k3072=26914, k4096=5001, k4099=9001), 1.0, 1.0, 26914),
    "above an ellipsoid, feet": (short(k3072=26914, k4096=5030, k4099=9002), 1.0, FOOT, 26914),
    "Baltic heights, not a zone of Norway": (
        short(k3072=32636, k4096=5105, k4099=9001),
        1.0,
        1.0,
        32636,
    ),
    "heights of its own": (short(k3072=26914, k4096=32767, k4099=9003), 1.0, US_FOOT, 26914),
    "NAVD88 by EPSG, US feet": (short(k3072=2277, k4096=5703, k4099=9003), US_FOOT, US_FOOT, 2277),
}
"""(entries, metres in a unit of plan and of height, the plan's EPSG code) of GeoTIFF keys."""


@pytest.mark.parametrize("kind", KEYS)
def test_geotiff_keys_are_understood(tmp_path, kind):
    entries, plan, height, code = KEYS[kind]
    doubles = struct.pack("<2d", 0.0, 0.9144)
    crs = crs_through_a_file(
        tmp_path, (34735, directory(*entries)), (34736, doubles), (34737, CITATION)
    )
    units = find_units(crs)
    assert (units.plan, units.height) == pytest.approx((plan, height), rel=1e-12)
    plan_crs = crs.sub_crs_list[0] if crs.is_compound else crs
    assert plan_crs.to_epsg() == code
    assert (4096 in [key for key, *_ in entries]) == (vertical_crs(crs) is not None)


def test_a_projection_in_another_unit_than_its_code_stays_where_it_is():
    crs = las_crs({34735: directory(*short(k3072=26957, k3076=9003))})
    way = pyproj.Transformer.from_crs(crs, 26957, always_xy=True)
    assert way.transform(3e6, 1e6) == pytest.approx((3e6 * US_FOOT, 1e6 * US_FOOT), abs=1e-6)


FAULTY = {
    "no unit": (34735, directory(*OWN)),
    "a unit nobody knows": (34735, directory(*OWN, (3076, 0, 1, 12345))),
    "a unit of its own without a size": (
        34735,
        directory(*OWN, (3076, 0, 1, 32767), (3077, 34736, 1, 7)),
    ),
    "an angle as the unit": (34735, directory(*OWN, (3076, 0, 1, 9102))),
    "a code nobody knows": (34735, directory(*short(k3072=1025))),
    "a projected CRS as heights": (34735, directory(*short(k3072=26914, k4096=26914))),
    "three bytes": (34735, b"\1\0\1"),
    "a directory cut short": (34735, directory(*short(k3072=26914, k4096=5703))[:-4]),
    "another version": (34735, b"\7" + directory(*short(k3072=26914))[1:]),
    "WKT without its end": (2112, UTM[:200].encode()),
    "WKT that names no unit's size": (2112, b'LOCAL_CS["site",UNIT["foot"]]'),
    "text": (2112, b"the usual one"),
}


@pytest.mark.parametrize("kind", FAULTY)
def test_a_header_that_cannot_be_understood_is_refused_unless_something_stands_in(tmp_path, kind):
    """It was taken as unknown, and feet as metres."""
    assert isinstance(crs_through_a_file(tmp_path, FAULTY[kind]), UnknownCRS)
    path = tmp_path / "a.las"
    sentence = "name the right one with --crs, or its unit alone with --unit"
    with pytest.raises(InputError, match=sentence):
        read_points(path)
    assert (
        read_points(path, settings=Settings.from_dict({"read": {"crs": "EPSG:2222"}})).units.plan
        == FOOT
    )
    assert (
        read_points(path, settings=Settings.from_dict({"read": {"unit": "foot"}})).units.plan
        == FOOT
    )


def test_wkt_in_latin_1_and_beside_keys_is_read(tmp_path):
    text = UTM.replace("WGS 84 / UTM zone 33N", "Zone Réunion").encode("latin-1")
    assert find_units(crs_through_a_file(tmp_path, (2112, text))).are_metres
    feet = directory(*short(k3072=2277))
    assert crs_through_a_file(tmp_path, (2112, b""), (34735, feet)).to_epsg() == 2277
    assert crs_through_a_file(tmp_path, (2112, UTM[:99].encode()), (34735, feet)).to_epsg() == 2277


BOX = shapely.box(500000, 4649776, 500010, 4649786)


def write_footprints(path, crs, units=1.0):
    """One square in `units` of a metre; `crs` is GDAL's text, or a GeoPackage's number."""
    return write_layer(path, [shapely.transform(BOX, lambda xy: xy / units)], crs=crs)


UNPLACED = {
    "undefined Cartesian": (
        'ENGCRS["Undefined Cartesian '
        'SRS",EDATUM["?"],CS[Cartesian,2],AXIS["E",east],AXIS["N",north],LENGTHUNIT["metre",1]]',
        1.0,
    ),
    "Nonearth": (LOCAL["MapInfo's Nonearth"][0], 1.0),
    "Nonearth in US feet": (LOCAL["US feet"][0], US_FOOT),
    "heights alone": ("EPSG:5709", 1.0),
}


@pytest.mark.parametrize("kind", UNPLACED)
@pytest.mark.parametrize("cloud", ["EPSG:32633", "EPSG:2277"])
@pytest.mark.filterwarnings("ignore:'crs' was not provided")
def test_footprints_of_no_place_are_taken_to_be_in_the_clouds_crs(tmp_path, kind, cloud):
    """A traceback before. Their unit counts where they name one."""
    crs, unit = UNPLACED[kind]
    unit = unit if kind.startswith("Nonearth") else find_units(CRS(cloud)).plan
    path = write_footprints(tmp_path / "f.gpkg", crs, unit)
    with pytest.warns(InputWarning, match="taken to be in the cloud's"):
        (footprint,) = read_footprints(path, target_crs=cloud)
    assert np.allclose(footprint.polygon.bounds, BOX.bounds, atol=1e-3)
    if cloud == "EPSG:32633":
        (boxed,) = read_footprints(path, target_crs=cloud, bbox=(500001, 4649777, 500002, 4649778))
        assert boxed.polygon.equals(footprint.polygon)


def test_footprints_that_run_south_and_west_are_moved_to_a_cloud_that_does_not(tmp_path):
    krovak = shapely.box(1040000, 740000, 1040010, 740020)
    write_layer(tmp_path / "f.gpkg", [krovak], crs="EPSG:5513")
    (footprint,) = read_footprints(tmp_path / "f.gpkg", target_crs="EPSG:5514")
    assert np.allclose(footprint.polygon.bounds, (-740020, -1040010, -740000, -1040000), atol=1e-3)


@pytest.mark.parametrize("crs", ["EPSG:4978", UNDERSTOOD["a projection nobody knows"][0]])
def test_footprints_that_PROJ_cannot_move_are_refused_in_one_sentence(tmp_path, crs):
    path = write_footprints(tmp_path / "f.gpkg", CRS(crs).to_wkt())
    with pytest.raises(InputError, match=r"^expected .* EPSG:28992 .*reproject"):
        read_footprints(path, target_crs="EPSG:28992")


def find_frame(folder, record, footprints=None, **read):
    crs_through_a_file(folder, record, (34737, CITATION))
    cloud, footprints = str(folder / "a.las"), footprints and str(footprints)
    settings = Settings.from_dict({"read": read})
    return settle_frame(
        Request((cloud,), folder / "out", footprints, settings=settings), read_headers((cloud,))
    )


OWN_FEET = (34735, directory(*OWN, *short(k3076=9003, k4096=5703)))
OWN_METRES = (34735, directory(*OWN, *short(k3076=9001, k4096=5703)))


@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
def test_a_local_cloud_takes_its_place_from_the_footprints_and_keeps_its_heights(tmp_path):
    path = write_footprints(tmp_path / "f.gpkg", "EPSG:32633")
    frame = find_frame(tmp_path, OWN_METRES, path)
    assert frame.crs.sub_crs_list[0].to_epsg() == 32633
    assert vertical_crs(frame.crs).to_epsg() == 5703
    single_frame = find_frame(tmp_path, OWN_FEET)
    assert (single_frame.units.plan, single_frame.units.height) == pytest.approx((US_FOOT, 1.0))
    heights = find_frame(tmp_path, (34735, directory(*short(k4099=9003))), path)
    assert (heights.units.plan, heights.units.height) == pytest.approx((1.0, US_FOOT))
    assert find_frame(tmp_path, (34735, directory(*short(k4099=9001)))).crs is None


def test_clouds_and_footprints_in_two_units_and_one_unknown_place_are_refused(tmp_path):
    path = write_footprints(tmp_path / "f.gpkg", "EPSG:32633")
    with pytest.raises(InputError, match="say with --crs in which the clouds are"):
        find_frame(tmp_path, OWN_FEET, path)
    with pytest.raises(InputError, match="heights alone"):
        find_frame(tmp_path, (34735, directory(*short(k4099=9003))))


def test_what_is_local_is_said(tmp_path):
    with pytest.warns(InputWarning, match="names a local CRS, NAD83 / Texas Central"):
        find_frame(tmp_path, OWN_FEET)


@pytest.mark.parametrize(
    ("cloud", "raster"), [("US feet", "EPSG:32614"), ("LOCAL_CS", "EPSG:32633"), (None, "LOCAL_CS")]
)
def test_a_terrain_model_beside_a_local_cloud_is_asked_in_its_own_coordinates(
    tmp_path, cloud, raster
):
    rasterio = pytest.importorskip("rasterio")
    crs = rasterio.crs.CRS.from_wkt(
        CRS(LOCAL[raster][0] if raster in LOCAL else raster).to_wkt("WKT1_GDAL")
    )
    write_raster(tmp_path / "dtm.tif", np.full((40, 40), 7.0), 500000, 4649800, crs=crs)
    request = parse_crs(LOCAL[cloud][0] if cloud else "EPSG:32633")
    units = find_units(request)
    terrain = read_terrain(tmp_path / "dtm.tif", request, units)
    assert terrain.height_at(units.to_metres([[500010.0, 4649780.0]]))[0] == pytest.approx(7.0)
