"""Rasters of all kinds give true heights in metres, or are refused in one sentence before any
height is read.
"""

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine, from_origin

from hiproof.errors import DamagedRaster, InputError, InputWarning
from hiproof.frames import Units
from hiproof.read import read_terrain
from layers import write_raster

WEST, NORTH, SIDE = 85000.0, 446200.0, 40
PLACE = np.array([[WEST + 10.2, NORTH - 11.7]])
FOOT = Units(0.3048, 0.3048, "foot", "foot")


def height(xy):
    return 12.0 + 0.1 * (xy[:, 0] - WEST) + 0.05 * (xy[:, 1] - NORTH)


def write(
    path,
    heights=None,
    transform=None,
    crs="EPSG:28992",
    dtype="float64",
    bands=1,
    setup=None,
    **options,
):
    """A raster of 40 by 40 pixels of a metre that holds `heights` of its pixel centres, by default
    of a plane.
    """
    transform = transform or from_origin(WEST, NORTH, 1, 1)
    rows, columns = np.mgrid[:SIDE, :SIDE] + 0.5
    x = transform.a * columns + transform.b * rows + transform.c
    y = transform.d * columns + transform.e * rows + transform.f
    values = (
        height(np.column_stack([x.ravel(), y.ravel()])).reshape(SIDE, SIDE)
        if heights is None
        else heights
    )
    options = {
        "driver": "GTiff",
        "width": SIDE,
        "height": SIDE,
        "count": bands,
        "dtype": dtype,
        **options,
    }
    with rasterio.open(path, "w", crs=crs, transform=transform, **options) as file:
        file.write(np.broadcast_to(values, (bands, SIDE, SIDE)).astype(dtype))
        if setup:
            setup(file)
    return path


def read_height(path, **asked):
    return read_terrain(path, **asked).height_at(PLACE)[0]


@pytest.mark.parametrize(
    "name, metres",
    [
        ("m", 1.0),
        ("Metres above NAP", 1.0),
        ("m+NAP", 1.0),
        ("[m]", 1.0),
        ("", 1.0),
        ("unknown", 1.0),
        ("decimetre", 0.1),
        ("dm", 0.1),
        ("cm", 0.01),
        ("millimeters", 0.001),
        ("ft", 0.3048),
        ("Feet", 0.3048),
        ("foot (international)", 0.3048),
        ("feet above sea level", 0.3048),
        ("US survey foot", 1200 / 3937),
        ("ftUS", 1200 / 3937),
        ("us-ft", 1200 / 3937),
        ("Foot_US", 1200 / 3937),
    ],
)
def test_the_unit_of_the_band_counts(tmp_path, name, metres):
    path = write(tmp_path / "dtm.tif", setup=lambda file: setattr(file, "units", (name,)))
    assert read_height(path) == pytest.approx(metres * height(PLACE)[0], abs=1e-9)


@pytest.mark.parametrize("name", ["degree", "K", "counts", "percent"])
def test_a_unit_that_is_no_length_is_refused(tmp_path, name):
    path = write(tmp_path / "dtm.tif", setup=lambda file: setattr(file, "units", (name,)))
    with pytest.raises(
        InputError, match=f"expected heights in metres or feet .* got a band in '{name}'"
    ):
        read_terrain(path)


@pytest.mark.parametrize(
    "scale, offset, unit", [(0.1, 0.0, ""), (1.0, 10.0, ""), (0.01, -5.0, "m"), (0.5, 2.0, "ft")]
)
def test_scale_and_offset_of_the_band_count(tmp_path, scale, offset, unit):
    def set_scale(file):
        file.scales, file.offsets, file.units = (scale,), (offset,), (unit,)

    path = write(
        tmp_path / "dtm.tif",
        np.full((SIDE, SIDE), -20),
        dtype="int16",
        nodata=-32768,
        setup=set_scale,
    )
    assert read_height(path) == pytest.approx(
        (-20 * scale + offset) * (0.3048 if unit == "ft" else 1.0)
    )


def test_a_scale_of_0_is_refused(tmp_path):
    path = write(tmp_path / "dtm.tif", setup=lambda file: setattr(file, "scales", (0.0,)))
    with pytest.raises(InputError, match="expected a scale and an offset"):
        read_terrain(path)


@pytest.mark.parametrize(
    "transform",
    [
        Affine(1, 0, WEST, 0, 1, NORTH - SIDE),  # rows from south to north
        Affine(-1, 0, WEST + SIDE, 0, -1, NORTH),
        Affine.translation(WEST, NORTH) @ Affine.rotation(-30) @ Affine.scale(1, -1),
        Affine(0.8, 0.6, WEST - 12, 0.6, -0.8, NORTH),
    ],
)
def test_a_raster_lies_where_its_geotransform_says(tmp_path, transform):
    assert read_height(write(tmp_path / "dtm.tif", transform=transform)) == pytest.approx(
        height(PLACE)[0], abs=1e-6
    )


@pytest.mark.parametrize(
    "transform",
    [
        Affine(0, 0, WEST, 0, 0, NORTH),
        Affine(1, 1, WEST, 1, 1, NORTH),
        Affine(1, 0, WEST, 0, np.nan, NORTH),
    ],
)
def test_a_singular_geotransform_is_refused(tmp_path, transform):
    with pytest.raises(InputError, match="pixels have an area"):
        read_terrain(write(tmp_path / "dtm.tif", transform=transform))


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_a_crs_alone_is_no_position(tmp_path):
    with pytest.raises(InputError, match="an image without position"):
        read_terrain(write(tmp_path / "dtm.tif", transform=Affine.identity()))


@pytest.mark.parametrize(
    "nodata, dtype",
    [(-32768, "int16"), (65535, "uint16"), (0, "uint8"), (np.nan, "float32"), (-9999, "int32")],
)
def test_declared_nodata_of_any_type_is_no_height(tmp_path, nodata, dtype):
    heights = np.full((SIDE, SIDE), 7.0)
    heights[:, :20] = nodata
    model = read_terrain(write(tmp_path / "dtm.tif", heights, dtype=dtype, nodata=nodata))
    xy = np.array([[WEST + 5, NORTH - 5], [WEST + 30, NORTH - 5]])
    assert np.isnan(model.height_at(xy)[0]) and model.height_at(xy)[1] == 7.0
    assert not model.is_coded_at(xy).any()


def mask_half(file):
    mask = np.full((SIDE, SIDE), 255, np.uint8)
    mask[:, :20] = 0
    file.write_mask(mask)


def half_transparent(file):
    alpha = np.full((SIDE, SIDE), 255)
    alpha[:, :20] = 0
    file.write(alpha.astype("float64"), 2)


@pytest.mark.parametrize(
    "options", [{"setup": mask_half}, {"bands": 2, "alpha": "yes", "setup": half_transparent}]
)
@pytest.mark.filterwarnings("error::hiproof.errors.InputWarning")
def test_masked_and_transparent_pixels_are_no_heights(tmp_path, options):
    model = read_terrain(write(tmp_path / "dtm.tif", **options))
    xy = np.array([[WEST + 5, NORTH - 5], [WEST + 30, NORTH - 5]])
    assert np.isfinite(model.height_at(xy)).tolist() == [False, True]


def test_of_several_bands_the_first_is_taken_and_named(tmp_path):
    path = write(
        tmp_path / "dtm.tif", bands=3, setup=lambda file: file.write(np.zeros((SIDE, SIDE)), 2)
    )
    with pytest.warns(InputWarning, match="has 3 bands; the heights are taken from band 1"):
        assert read_height(path) == pytest.approx(height(PLACE)[0])


def palette(file):
    file.write_colormap(1, {0: (0, 0, 0, 255), 1: (255, 0, 0, 255)})


@pytest.mark.parametrize(
    "options, words",
    [
        ({"bands": 3, "dtype": "uint8", "photometric": "RGB"}, "a picture"),
        ({"dtype": "uint8", "setup": palette}, "a picture"),
        ({"dtype": "complex64"}, "complex numbers"),
    ],
)
def test_pictures_and_complex_numbers_are_refused(tmp_path, options, words):
    with pytest.raises(InputError, match=f"expected a raster of heights .* got {words}"):
        read_terrain(write(tmp_path / "dtm.tif", **options))


@pytest.mark.parametrize("side", [1, 2])
def test_a_tiny_raster_is_a_level_or_a_slope(tmp_path, side):
    heights = np.full((side, side), 4.5, "float32")
    assert read_height(write_raster(tmp_path / "dtm.tif", heights, WEST, NORTH, 20)) == 4.5


def test_heights_in_feet_of_the_rasters_crs(tmp_path):
    crs, transform = "EPSG:2263+6360", from_origin(980000, 200000, 3, 3)
    path = write(tmp_path / "dtm.tif", np.full((SIDE, SIDE), 30.0), transform, crs)
    places = np.array([[980010.0, 199990.0]]) * 1200 / 3937
    assert read_terrain(path).height_at(places)[0] == pytest.approx(30.0 * 1200 / 3937)


def test_a_raster_without_a_crs_counts_as_the_cloud_does(tmp_path):
    path = write(tmp_path / "dtm.tif", crs=None)
    model = read_terrain(path, units=FOOT)
    assert model.height_at(0.3048 * PLACE)[0] == pytest.approx(0.3048 * height(PLACE)[0])


@pytest.mark.parametrize(
    "lowest, code", [(2.0, 0.0), (40.0, 0.0), (40.0, -99.0), (40.0, 255.0), (40.0, -9999.0)]
)
def test_codes_far_from_all_other_heights_are_none(tmp_path, lowest, code):
    heights = np.full((SIDE, SIDE), lowest) + np.arange(SIDE)[:, None] / 10
    heights[:, :20] = code
    model = read_terrain(write(tmp_path / "dtm.tif", heights))
    xy = np.array([[WEST + 5, NORTH - 5], [WEST + 30, NORTH - 5]])
    assert np.isnan(model.height_at(xy)[0]) and model.is_coded_at(xy).tolist() == [True, False]


def test_heights_that_others_come_near_stay(tmp_path):
    coast = np.maximum(np.linspace(-5, 12, SIDE), 0.0) * np.ones((SIDE, 1))  # the sea is 0
    model = read_terrain(write(tmp_path / "dtm.tif", coast))
    assert model.height_at(np.array([[WEST + 5, NORTH - 5]]))[0] == 0.0
    level = read_terrain(write(tmp_path / "level.tif", np.zeros((SIDE, SIDE))))
    assert level.height_at(PLACE)[0] == 0.0


def test_a_virtual_raster_whose_source_is_missing_says_so_when_it_is_asked(tmp_path):
    source = write(tmp_path / "tile.tif")
    text = f"""<VRTDataset rasterXSize="{SIDE}" rasterYSize="{SIDE}"><SRS>EPSG:28992</SRS>
    <GeoTransform>{WEST}, 1, 0, {NORTH}, 0, -1</GeoTransform>
    <VRTRasterBand dataType="Float64" band="1"><SimpleSource>
    <SourceFilename relativeToVRT="1">tile.tif</SourceFilename><SourceBand>1</SourceBand>
    </SimpleSource></VRTRasterBand>
    </VRTDataset>"""
    (tmp_path / "all.vrt").write_text(text)
    assert read_height(tmp_path / "all.vrt") == pytest.approx(height(PLACE)[0])
    source.unlink()
    with pytest.raises(DamagedRaster, match="expected a complete raster"):
        read_terrain(tmp_path / "all.vrt").knows_any(PLACE)
