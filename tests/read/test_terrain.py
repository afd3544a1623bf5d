"""Every terrain gives back the plane it was made from, says NaN where it does not know, and names
its source.
"""

import pickle

import numpy as np
import pytest
import rasterio
from pyproj import Transformer

import layers
from hiproof.errors import InputError
from hiproof.read.terrain import TerrainChain, raster, read_terrain

WEST, NORTH = 85000.0, 446200.0


def plane(xy):
    return 3.0 + 0.05 * (xy[:, 0] - WEST) - 0.02 * (xy[:, 1] - NORTH)


def write_raster(path, width=120, height=80, step=0.5, crs="EPSG:28992", hole=None, heights=None):
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    x, y = WEST + step * columns.ravel(), NORTH - step * rows.ravel()
    z = plane(np.column_stack([x, y])).reshape(height, width) if heights is None else heights
    if hole is not None:
        z[hole] = -9999
    layers.write_raster(path, z, WEST, NORTH, step, crs, nodata=-9999)
    return path


def inside(count=200, seed=1, margin=1.0):
    return np.random.default_rng(seed).uniform(
        [WEST + margin, NORTH - 40 + margin], [WEST + 60 - margin, NORTH - margin], (count, 2)
    )


def ground(count=4000, seed=2):
    xy = np.random.default_rng(seed).uniform([WEST, NORTH - 40], [WEST + 60, NORTH], (count, 2))
    return np.column_stack([xy, plane(xy)])


def test_a_raster_is_interpolated_between_pixel_centres(tmp_path):
    model = read_terrain(write_raster(tmp_path / "dtm.tif"))
    assert np.allclose(model.height_at(inside()), plane(inside()), atol=1e-9)
    assert model.source == "terrain model dtm.tif"


def test_tiles_change_nothing(tmp_path, monkeypatch):
    rough = np.random.default_rng(0).normal(size=(80, 120))
    path = write_raster(tmp_path / "dtm.tif", heights=rough)
    whole = read_terrain(path).height_at(inside(2000, margin=0))
    monkeypatch.setattr(raster, "TILE_PX", 16)
    tiled = read_terrain(path)
    assert np.array_equal(tiled.height_at(inside(2000, margin=0)), whole)
    assert tiled.tile.cache_info().currsize <= raster.TILES_KEPT


def test_a_raster_in_another_crs_is_asked_there(tmp_path):
    model = read_terrain(write_raster(tmp_path / "dtm.tif"), crs="EPSG:25831")
    transformer = Transformer.from_crs(28992, 25831, always_xy=True)
    assert np.allclose(
        model.height_at(np.column_stack(transformer.transform(*inside().T))),
        plane(inside()),
        atol=1e-4,
    )
    assert read_terrain(tmp_path / "dtm.tif", crs="EPSG:7415").transformer is None


def test_a_raster_survives_the_way_to_another_process(tmp_path):
    model = read_terrain(write_raster(tmp_path / "dtm.tif"), crs="EPSG:25831")
    places = np.column_stack(
        Transformer.from_crs(28992, 25831, always_xy=True).transform(*inside().T)
    )
    assert np.array_equal(
        pickle.loads(pickle.dumps(model)).height_at(places), model.height_at(places)
    )


def test_outside_and_without_data_is_unknown(tmp_path):
    model = read_terrain(write_raster(tmp_path / "dtm.tif", hole=(slice(20, 40), slice(20, 40))))
    outside = [
        [WEST - 1, NORTH - 5],
        [WEST + 61, NORTH - 5],
        [WEST + 5, NORTH + 1],
        [WEST + 5, NORTH - 41],
    ]
    assert np.isnan(model.height_at(np.array(outside))).all()
    assert np.isnan(model.height_at(np.array([[WEST + 15, NORTH - 15]]))).all()
    edge = np.array([[WEST + 9.9, NORTH - 15.0], [WEST, NORTH], [WEST + 60, NORTH - 40]])
    assert np.allclose(model.height_at(edge), plane(edge), atol=0.03)


@pytest.mark.parametrize("nothing", [3.4028234663852886e38, -3.4e38, np.inf, np.nan])
def test_heights_that_no_ground_has_are_unknown_although_the_raster_does_not_say_so(
    tmp_path, nothing
):
    heights = np.full((80, 120), 2.0)
    heights[:, :60] = nothing
    model = read_terrain(write_raster(tmp_path / "dtm.tif", heights=heights))
    result = model.height_at(
        np.array([[WEST + 10, NORTH - 20], [WEST + 29.8, NORTH - 20], [WEST + 50, NORTH - 20]])
    )
    assert np.isnan(result[0]) and result[1:].tolist() == [2.0, 2.0]


class Around:
    """Ground known within 100 m of the model, a metre above its plane."""

    source = "ground points"

    def height_at(self, xy):
        is_near = np.hypot(*(xy - [WEST, NORTH]).T) < 100.0
        return np.where(is_near, plane(xy) + 1.0, np.nan)


def test_a_chain_asks_the_next_where_one_does_not_know(tmp_path):
    model = read_terrain(write_raster(tmp_path / "dtm.tif", width=20, height=20))
    chain = TerrainChain([model, None, Around()])
    first_place = [WEST + 5, NORTH - 5]
    second_place = [WEST + 40, NORTH - 20]
    nowhere = [WEST + 900, NORTH]
    heights, sources = chain.heights_and_sources(np.array([first_place, second_place, nowhere]))
    assert heights[0] == pytest.approx(plane(np.array([first_place]))[0])
    assert heights[1] == pytest.approx(plane(np.array([second_place]))[0] + 1, abs=0.1)
    assert np.isnan(heights[2]) and sources == ("terrain model dtm.tif", "ground points")
    assert chain.heights_and_sources(np.array([second_place]))[1] == ("ground points",)
    assert np.array_equal(chain.height_at(np.array([first_place])), heights[:1])


@pytest.mark.parametrize(
    "kind, words",
    [
        ("missing", "no such file"),
        ("text", "that GDAL reads"),
        ("empty", "an empty file"),
        ("unplaced", "without position"),
    ],
)
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_what_is_no_terrain_model_gets_one_full_sentence(tmp_path, kind, words):
    path = tmp_path / "dtm.tif"
    if kind == "text":
        path.write_text("1 2 3\n")
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "unplaced":
        with rasterio.open(
            path, "w", driver="GTiff", width=4, height=4, count=1, dtype="float32"
        ) as file:
            file.write(np.zeros((4, 4), "float32"), 1)
    with pytest.raises(InputError, match=words):
        read_terrain(path)


def test_a_truncated_raster_says_so_when_it_is_read(tmp_path):
    path = write_raster(
        tmp_path / "dtm.tif", heights=np.random.default_rng(0).normal(size=(80, 120))
    )
    path.write_bytes(path.read_bytes()[:30000])
    with pytest.raises(InputError, match="raster"):
        read_terrain(path).height_at(inside())
