"""Weather files: every format gives the same sun, and what does not fit is refused."""

import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from hiproof.cli.app import app
from hiproof.enrich import weather
from hiproof.enrich.run import enrich_run
from hiproof.enrich.sun import make_sky
from hiproof.enrich.weather import read_year
from hiproof.errors import InputError, InputWarning
from hiproof.settings import EnrichSettings
from streets import place_house, write_street
from weather import write_epw, write_pvgis, write_tmy3

pvlib = pytest.importorskip("pvlib", reason="needs the extra sun")

DELFT = (52.0, 4.36)


RISES = {}


@pytest.fixture(autouse=True)
def remember_the_sun(monkeypatch):
    """The sun over a place is computed once for all files of its hours."""
    measure = weather.measure_rises

    def recall(year):
        key = year.where, year.times.asi8.tobytes()
        if key not in RISES:
            RISES[key] = measure(year)
        return RISES[key]

    monkeypatch.setattr(weather, "measure_rises", recall)


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
        read_year(str(tmp_path / name))


def test_a_year_with_a_gap_gets_a_sentence(tmp_path):
    write_tmy3(tmp_path / "a.csv")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    (tmp_path / "a.csv").write_text("\n".join(lines[:-24]) + "\n")
    with pytest.raises(InputError, match=r"expected the 8760 hours of a year in .*, got 8736"):
        read_year(str(tmp_path / "a.csv"))


def spoil(hours=slice(None), **factors):
    """Return a change of the columns of an EPW file in some hours."""

    def change(columns):
        for name, value in factors.items():
            columns[name][hours] = value(columns[name][hours]) if callable(value) else value

    return change


def make_overcast(columns):
    """Call all radiation diffuse, as in files made of the global one alone."""
    columns["dhi"][:], columns["dni"][:] = columns["ghi"], 0.0


def level_beam(columns):
    """Put the part of the direct radiation that falls on level ground in its column."""
    columns["dni"] = columns["ghi"] - columns["dhi"]


@pytest.mark.parametrize(
    "change, reason",
    [
        (spoil(slice(4000, 4030), ghi=9999, dhi=9999, dni=9999), "got 30 hours in which one is mi"),
        (spoil(dhi=9999, dni=9999), "got 8,760 hours in which one is missing"),
        (spoil(4000, dhi=-9900), "got 1 hour in which one is missing"),
        (spoil(4000, ghi=1e9), "got 1 hour in which one is missing"),
        (spoil(4000, ghi=np.nan), "got 1 hour in which one is missing"),
        (
            spoil(dhi=0, dni=0),
            "got diffuse and direct radiation 100% off the global|got global rad",
        ),
        (spoil(4164, ghi=100, dhi=50, dni=1200), "got global radiation of 100 W/m2 beside 50 diff"),
        (spoil(4164, ghi=5000, dhi=5000, dni=0), "beyond what reaches the atmosphere"),
        (spoil(ghi=lambda v: 3.6 * v, dhi=lambda v: 3.6 * v), "beyond what reache"),
        (spoil(**dict.fromkeys(("ghi", "dhi", "dni"), 0)), "got only 0.0% of what reaches the atm"),
        (spoil(**dict.fromkeys(("ghi", "dhi", "dni"), lambda v: v / 1000)), "got only 0.0% of wha"),
        (spoil(slice(4800, 5544), ghi=0, dhi=0, dni=0), "hours without radi.*on 20 July"),
        (spoil(slice(4811, 4813), ghi=0, dhi=0, dni=0), "2 hours without.*on 20 July, 11:30"),
        (level_beam, "got direct radiation on level ground in place of that towards the sun"),
        (spoil(ghi=lambda v: np.roll(v, 1)), "beyond what reaches the atmosphere at its hours"),
        (
            lambda columns: columns["stamps"].__setitem__(9, columns["stamps"][8]),
            "once in .* row 10",
        ),
    ],
)
def test_radiation_that_its_sun_cannot_make_is_refused(change, reason, tmp_path):
    write_epw(tmp_path / "a.epw", change=change)
    with pytest.raises(InputError, match=reason):
        read_year(str(tmp_path / "a.epw"))


def test_an_epw_of_a_leap_year_is_that_of_its_other_days(tmp_path):
    write_epw(tmp_path / "a.epw")
    lines = (tmp_path / "a.epw").read_text().splitlines(keepends=True)
    first = next(k for k, line in enumerate(lines) if line.startswith("2023,3,1,"))
    leap = [line.replace("2023,3,1,", "2023,2,29,") for line in lines[first : first + 24]]
    (tmp_path / "leap.epw").write_text("".join([*lines[:first], *leap, *lines[first:]]))
    years = [make_sky(*DELFT, 0.0, 0.0, str(tmp_path / name)) for name in ("a.epw", "leap.epw")]
    for own, other in zip(*years, strict=True):
        assert np.array_equal(own, other)


def test_a_year_without_direct_radiation_comes_with_a_warning(tmp_path):
    write_epw(tmp_path / "a.epw", change=make_overcast)
    with pytest.warns(InputWarning, match="a.epw: has hardly any direct radiation in . months"):
        read_year(str(tmp_path / "a.epw"))


def test_a_summer_without_direct_radiation_comes_with_a_warning(tmp_path):
    """As where an instrument failed, and its rest was filled by diffuse radiation."""

    def change(columns):
        rows = slice(181 * 24, 243 * 24)
        columns["dhi"][rows], columns["dni"][rows] = columns["ghi"][rows], 0.0

    write_epw(tmp_path / "a.epw", change=change)
    with pytest.warns(InputWarning, match="a.epw: has hardly any direct radiation in 2 months"):
        read_year(str(tmp_path / "a.epw"))


@pytest.mark.parametrize("factor, share", [(2.0, "[23]"), (3.6, "[23]"), (0.77, "9")])
def test_a_year_without_clear_hours_comes_with_a_warning(factor, share, tmp_path):
    """Such as kJ in place of Wh: every climate has hours in which most of the sun comes down."""
    other = dict.fromkeys(("ghi", "dhi", "dni"), lambda v: v / factor)
    write_epw(tmp_path / "a.epw", change=spoil(**other))
    with pytest.warns(InputWarning, match=f"has {share}[0-9]% .* in its brightest hours"):
        read_year(str(tmp_path / "a.epw"))


def copy_days(source, first, count):
    """Return a change that puts the radiation of a day of the year on `count` others."""

    def change(columns):
        for name in ("ghi", "dhi", "dni"):
            days = columns[name].reshape(365, 24)
            days[first : first + count] = days[source]

    return change


@pytest.mark.parametrize("source, first, count", [(100, 101, 1), (171, 190, 4), (150, 152, 3)])
def test_days_that_repeat_another_come_with_a_warning(source, first, count, tmp_path):
    write_epw(tmp_path / "a.epw", change=copy_days(source, first, count))
    days = "1 day" if count == 1 else f"{count} days"
    with pytest.warns(InputWarning, match=f"a.epw: repeats the radiation of .* on {days}, first"):
        read_year(str(tmp_path / "a.epw"))


def test_hours_that_stay_the_same_come_with_a_warning(tmp_path):
    def change(columns):
        for name in ("ghi", "dhi", "dni"):
            columns[name].reshape(365, 24)[180, 12:16] = columns[name].reshape(365, 24)[180, 12]

    write_epw(tmp_path / "a.epw", change=change)
    with pytest.warns(InputWarning, match="for four hours or more, first on 30 June, 12:30"):
        read_year(str(tmp_path / "a.epw"))


@pytest.mark.parametrize(
    "place, said, when",
    [
        ({"longitude": -3.0, "zone": 0}, {"longitude": 3.0}, "20 minutes before"),
        ({"longitude": 77.2, "zone": 5.5}, {"zone": 6}, "[24]0 minutes after"),
    ],
    ids=["a sign added", "India at 6 h"],
)
def test_a_sun_half_an_hour_off_comes_with_a_warning(place, said, when, tmp_path):
    for folder, changes in (("right", {}), ("wrong", said)):
        (tmp_path / folder).mkdir()
        write_epw(tmp_path / folder / "a.epw", 30.0, **place)
        text = (tmp_path / folder / "a.epw").read_text()
        for name, value in changes.items():
            text = text.replace(f",{place[name]},", f",{value},", 1)
        (tmp_path / folder / "a.epw").write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        read_year(str(tmp_path / "right/a.epw"))
    assert not [w for w in caught if issubclass(w.category, InputWarning)]
    with pytest.warns(InputWarning, match=f"fit the sun about {when} its times; "):
        read_year(str(tmp_path / "wrong/a.epw"))


def test_short_days_are_read(tmp_path):
    """Radiation that begins late and ends early leaves no hour dark between others."""

    def shorten(columns):
        hours = np.arange(len(columns["ghi"])) % 24
        for name in ("ghi", "dhi"):
            columns[name][:] = np.where((hours > 9) & (hours < 15), 200.0, 0.0)
        columns["dni"][:] = 0.0

    write_epw(tmp_path / "a.epw", change=shorten)
    year = read_year(str(tmp_path / "a.epw"))
    assert (year.values["ghi"].to_numpy() > 0.0).sum() == 5 * 365


def shroud(columns):
    """Dim every day by clouds of its own, so that no hour is too bright for its sun."""
    share = np.repeat(np.random.default_rng(0).uniform(0.2, 0.6, 365), 24)
    beam = 0.5 * share * (columns["ghi"] - columns["dhi"])
    columns["dni"] *= 0.5 * share
    columns["dhi"] = share * columns["ghi"] - beam
    columns["ghi"] = share * columns["ghi"]


@pytest.mark.parametrize(
    "hours, moved",
    [
        (slice(None), r"60 minutes before its times; check"),
        (slice(24 * 85, 24 * 300), r"60 minutes before its times from April to September; check"),
    ],
    ids=["all year", "clocks put forward"],
)
def test_a_sun_an_hour_off_under_clouds_comes_with_a_warning(hours, moved, tmp_path):
    def change(columns):
        shroud(columns)
        for name in ("ghi", "dhi", "dni"):
            columns[name][hours] = np.roll(columns[name], 1)[hours]

    write_epw(tmp_path / "a.epw", change=change)
    with pytest.warns(InputWarning, match=f"fit the sun about {moved}"):
        read_year(str(tmp_path / "a.epw"))


@settings(max_examples=4, deadline=None)
@given(
    latitude=st.floats(-65, 65),
    longitude=st.floats(-180, 180),
    off=st.sampled_from([-9, -4, -1, 0, 1, 2, 7]),
)
def test_a_year_is_taken_only_in_its_own_time_zone(latitude, longitude, off):
    zone = round(longitude / 15)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.epw")
        write_epw(path, latitude, longitude, zone, said_zone=zone + off)
        if off:
            with pytest.raises(InputError, match=r"expected radiation in .* that fits the sun"):
                read_year(str(path))
        else:
            assert read_year(str(path)).where == (latitude, longitude)


@pytest.mark.filterwarnings("error::hiproof.errors.InputWarning")
def test_the_stations_of_pvlib_are_taken():
    for path in Path(pvlib.__path__[0], "data").glob("7*TY*"):
        assert len(read_year(str(path)).times) == 8760


def test_names_of_towns_are_read_in_latin_1(tmp_path):
    write_epw(tmp_path / "a.epw")
    data = (tmp_path / "a.epw").read_bytes()
    (tmp_path / "b.epw").write_bytes(data.replace(b"Delft", "Zürich".encode("latin-1")))
    plain, accented = (read_year(str(tmp_path / name)) for name in ("a.epw", "b.epw"))
    assert plain.values["ghi"].equals(accented.values["ghi"])


@pytest.mark.parametrize("place", ["nan", "91", "here"])
def test_a_station_has_a_place(place, tmp_path):
    write_epw(tmp_path / "a.epw")
    text = (tmp_path / "a.epw").read_text()
    (tmp_path / "a.epw").write_text(text.replace("52.0", place, 1))
    sentence = r"expected weather of a typical year .*, got a file of an"
    with pytest.raises(InputError, match=sentence):
        read_year(str(tmp_path / "a.epw"))


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
