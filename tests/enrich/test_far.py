"""The far horizon: of terrain models whose hills are known, and of files of PVGIS."""

import math
import re

import numpy as np
import pytest
from click.testing import CliRunner

from hiproof.cli.app import app
from hiproof.enrich import far
from hiproof.enrich.cadastre import Cadastre
from hiproof.enrich.far import MIDDLES_DEG, TerrainHorizon, read_horizon
from hiproof.enrich.run import enrich_run
from hiproof.errors import InputError
from hiproof.settings import EnrichSettings
from layers import write_raster
from streets import WORLD, open_street, place_house, write_street

rasterio = pytest.importorskip("rasterio", reason="needs the extra terrain")
pytest.importorskip("pvlib", reason="needs the extra sun")

HILL_M, SLOPE = 1000.0, 0.6  # the hill begins so far south, and rises by so much a metre
FOOT_M = 1000.0  # and ends so much farther


@pytest.fixture(autouse=True)
def read_few_places(monkeypatch):
    monkeypatch.setattr(far, "MOST_PLACES", 40_000)


def write_hill(path, side=9000.0, pixel=25.0, ground=0.0):
    """Write level ground with a hill in the south that ends in a plain above."""
    count = int(side / pixel)
    south = (np.arange(count) + 0.5) * pixel - side / 2
    rise = np.clip((south - HILL_M) * SLOPE, 0.0, FOOT_M * SLOPE)
    heights = ground + np.repeat(rise[:, None], count, axis=1).astype("float32")
    return write_raster(path, heights, WORLD[0] - side / 2, WORLD[1] + side / 2, pixel)


def write_horizon(path, heights):
    path.write_text("\n".join(map(str, heights)) + "\n")
    return str(path)


def test_a_hill_stands_where_it_is(tmp_path):
    records = open_street(tmp_path / "run", [place_house("a", 0, 0)]).records
    horizon = TerrainHorizon(records, write_hill(tmp_path / "hill.tif"))
    top = math.degrees(math.atan((FOOT_M * SLOPE - 4.0) / (HILL_M + FOOT_M)))
    seen = np.degrees(np.arctan(horizon.find_horizon(*WORLD[:2], 4.0)))
    south = np.abs(MIDDLES_DEG - 180.0)
    # along a ray that leaves the south by an angle, the hill is farther by its cosine
    expected = np.degrees(np.arctan(np.tan(np.radians(top)) * np.cos(np.radians(south))))
    assert np.allclose(seen[south < 45], expected[south < 45], atol=0.4)
    assert (seen[south > 100] == 0.0).all()


def test_terrain_that_is_elsewhere_is_refused(tmp_path):
    far = place_house("a", 100_000.0, 0)
    folder = write_street(tmp_path / "run", [far])
    settings = EnrichSettings(sun=True, shading_terrain=write_hill(tmp_path / "hill.tif"))
    with pytest.raises(InputError, match="expected a terrain model around the buildings, got terr"):
        enrich_run(folder, settings=settings)


@pytest.mark.parametrize("ground", [43.0, -6.0, 7.5])
def test_terrain_of_other_heights_is_refused(ground, tmp_path):
    """Ellipsoidal heights, or a surface model at the height of the roofs, would shade all."""
    folder = write_street(tmp_path / "run", [place_house(f"h{k}", 30.0 * k, 0) for k in range(3)])
    hill = write_hill(tmp_path / "hill.tif", ground=ground)
    settings = EnrichSettings(sun=True, shading_terrain=hill)
    sentence = re.escape(f"which lies {ground:+.1f} m from it; check its height")
    with pytest.raises(InputError, match=sentence):
        enrich_run(folder, settings=settings)


@pytest.mark.parametrize("convergence", [0.0, 10.0])
def test_a_horizon_file_begins_in_the_north(convergence, tmp_path):
    heights = np.zeros(36)
    heights[9] = 30.0  # in the east
    tangents = read_horizon(write_horizon(tmp_path / "a.txt", heights), convergence)
    degrees = np.degrees(np.arctan(tangents))
    assert abs(MIDDLES_DEG[degrees.argmax()] - (90.0 - convergence)) <= 1.0
    assert degrees.max() == pytest.approx(27.0, abs=0.1)  # between values, 1 of 10 degrees aside
    assert (degrees[np.abs(MIDDLES_DEG - (90.0 - convergence)) > 10.0] == 0.0).all()


@pytest.mark.parametrize(
    "text, reason",
    [
        ("", "expected 2 or more heights between 0 and 90 degrees in .*, got 0"),
        ("1\n95\n", "expected 2 or more heights between 0 and 90 degrees"),
        ("1\nnan\n", "expected 2 or more heights between 0 and 90 degrees"),
        ("A\tH_hor\n", "expected a horizon file in .*; give heights in degrees at equal angles"),
        ("0\n12,5\n", "expected a horizon file in .*, got: a comma that may stand for a decimal"),
        ("0\n-10\n", "expected 2 or more heights between 0 and 90 degrees in .*, got -10; mend"),
        ("0\nnan\n", "expected 2 or more heights between 0 and 90 degrees in .*, got nan; mend"),
        (None, "expected a horizon file in .*, got: no such file"),
    ],
)
def test_files_without_a_horizon_get_a_sentence(text, reason, tmp_path):
    if text is not None:
        (tmp_path / "a.txt").write_text(text)
    with pytest.raises(InputError, match=reason):
        read_horizon(str(tmp_path / "a.txt"))


def describe_roof(town, **settings):
    """Return the sun on the one roof face of a building with a flat roof."""
    cadastre = Cadastre(town, EnrichSettings(sun=True, **settings))
    (values,) = cadastre.describe(0, town.read(0).solid)[1].values()
    return values["hiproof_sun_kwh_m2"], values["hiproof_sun_shaded_share"]


def test_a_high_horizon_leaves_the_light_of_the_sky_above_it(tmp_path):
    town = open_street(tmp_path / "run", [place_house("a", 0, 0)])
    free = describe_roof(town)
    low = describe_roof(town, horizon=write_horizon(tmp_path / "low.txt", [10.0] * 8))
    high = describe_roof(town, horizon=write_horizon(tmp_path / "high.txt", [80.0] * 8))
    assert free[1] == 0.0 < low[1] < 0.1 and low[0] < free[0]
    assert high[1] == pytest.approx(1.0, abs=1e-9)  # the sun stands at 61 degrees at most
    assert 0.0 < high[0] < 0.03 * free[0]


def test_a_hill_in_the_south_shades(tmp_path):
    town = open_street(tmp_path / "run", [place_house("a", 0, 0)])
    free = describe_roof(town)
    shaded = describe_roof(town, shading_terrain=write_hill(tmp_path / "h.tif"))
    assert shaded[0] < 0.99 * free[0] and free[1] == 0.0 and 0.005 < shaded[1] < 0.1


def test_the_command_takes_terrain_and_horizon(tmp_path):
    folder = write_street(tmp_path / "run", [place_house("a", 0, 0)])
    command = ["enrich", str(folder), "--sun", "--jobs", "1"]
    command += ["--terrain", write_hill(tmp_path / "h.tif")]
    command += ["--horizon", write_horizon(tmp_path / "a.txt", [0.0, 20.0])]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
