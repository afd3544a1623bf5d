"""Weather files: every format gives the same sun, and what does not fit is refused."""

import numpy as np
import pytest
from click.testing import CliRunner

from hiproof.cli.app import app
from hiproof.enrich.run import enrich_run
from hiproof.enrich.sky import make_sky
from hiproof.errors import InputError
from hiproof.settings import EnrichSettings
from streets import place_house, write_street
from weather import write_epw, write_pvgis, write_tmy3

pytest.importorskip("pvlib", reason="needs the extra sun")

DELFT = (52.0, 4.36)


@pytest.mark.parametrize(
    "name, writer, zone",
    [
        ("a.csv", write_tmy3, 1),
        ("a.csv", lambda path, zone: write_pvgis(path), 0),
        ("a.json", lambda path, zone: write_pvgis(path), 0),
    ],
    ids=["TMY3", "PVGIS table", "PVGIS JSON"],
)
def test_all_formats_give_the_same_sky(name, writer, zone, tmp_path):
    writer(tmp_path / name, zone=zone)
    write_epw(tmp_path / "a.epw", zone=zone)
    sky = make_sky(*DELFT, 0.0, 0.0, str(tmp_path / name))
    expected = make_sky(*DELFT, 0.0, 0.0, str(tmp_path / "a.epw"))
    for own, other in zip(sky, expected, strict=True):
        assert np.allclose(own, other, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["a.epw", "a.csv", "a.json"])
@pytest.mark.parametrize("text", ["", "no weather", "Latitude: here", "1,2,3\n4,5,6\n"])
def test_files_without_weather_get_a_sentence(name, text, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match="expected weather of a typical year as EPW, TMY3 or PV"):
        make_sky(*DELFT, 0.0, 0.0, str(tmp_path / name))


def test_a_year_with_a_gap_gets_a_sentence(tmp_path):
    write_tmy3(tmp_path / "a.csv")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    (tmp_path / "a.csv").write_text("\n".join(lines[:-24]) + "\n")
    with pytest.raises(InputError, match=r"expected 8760 hours of irradiance in .*, got 8736"):
        make_sky(*DELFT, 0.0, 0.0, str(tmp_path / "a.csv"))


@pytest.mark.parametrize(
    "change, reason",
    [
        (lambda path: write_epw(path, latitude=45.0), "within 300 km of the buildings, got one 7"),
        (lambda path: None, "expected weather of a typical year as EPW"),
    ],
)
def test_weather_that_does_not_fit_is_refused(change, reason, tmp_path):
    folder = write_street(tmp_path / "run", [place_house("a", 0, 0)])
    change(tmp_path / "a.epw")
    with pytest.raises(InputError, match=reason):
        enrich_run(folder, settings=EnrichSettings(sun=True, weather=str(tmp_path / "a.epw")))


@pytest.mark.parametrize("option", ["--weather", "--horizon", "--terrain"])
def test_options_of_the_sun_alone_are_refused(option, tmp_path):
    result = CliRunner().invoke(app, ["enrich", str(tmp_path), option, "a"])
    assert isinstance(result.exception, InputError)
    assert f"expected {option} with --sun, got it alone; add --sun" in str(result.exception)
