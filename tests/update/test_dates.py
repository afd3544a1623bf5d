"""The date of a survey: only days on which one can have been made are used."""

import datetime
import shutil
import struct

import laspy
import numpy as np
import pytest

from hiproof import InputError
from hiproof.update.dates import find_survey_date
from tiny_town import make_town, write_cloud

MAY_2014 = 82937616.0  # adjusted standard GPS time (s) of 2014-05-01


@pytest.fixture
def write(tmp_path):
    """Write a cloud with times of points, and the day on which the file was made."""

    def write_timed(times, day=150, year=2019, is_standard=True):
        town = make_town()
        path = write_cloud(tmp_path / "a.las", town.xyz[:50], town.classification[:50])
        las = laspy.read(path)
        if is_standard:
            las.header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
        las.gps_time = np.broadcast_to(times, 50)
        las.write(path)
        data = bytearray(path.read_bytes())
        struct.pack_into("<HH", data, 90, day, year)
        path.write_bytes(bytes(data))
        return (str(path),)

    return write_timed


def test_the_time_of_the_points_counts_and_a_named_day_before_all(write):
    clouds = write(MAY_2014)
    assert find_survey_date(clouds) == "2014-05-01"
    assert find_survey_date(clouds, "2020-02-03") == "2020-02-03"


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e18, -1e18, 0.0])
def test_points_without_a_time_do_not_count(write, bad):
    times = np.full(50, MAY_2014)
    times[5] = bad
    assert find_survey_date(write(times)) == "2014-05-01"


@pytest.mark.parametrize(
    "times",
    [
        np.linspace(2e5, 2.01e5, 50),  # seconds of the week
        np.full(50, MAY_2014 + 1e9),  # not adjusted: the year 2046
        np.full(50, 1e18),
        np.full(50, np.nan),
        np.full(50, -9e8),  # 1983
        np.full(50, 3e8),  # 2021, after the file was written
        np.zeros(50),
    ],
)
def test_times_that_cannot_be_are_not_believed(write, times):
    with pytest.warns(UserWarning, match="dated 2019-05-30, when the file was written.*--date"):
        assert find_survey_date(write(times)) == "2019-05-30"


@pytest.mark.parametrize(
    ("day", "year"), [(150, 65535), (150, 2099), (0, 0), (150, 1980), (400, 2019), (0, 2019)]
)
def test_days_that_cannot_be_are_asked_for(write, day, year):
    with pytest.raises(InputError, match="--date"):
        find_survey_date(write(np.full(50, np.nan), day, year))
    with pytest.raises(InputError, match="--date"):
        find_survey_date(write(0.0, day, year, is_standard=False))


def test_a_survey_older_than_that_of_the_run_is_refused(write):
    clouds = write(MAY_2014)
    for earlier in ("2014-05-02", "2015"):
        with pytest.raises(InputError, match=f"no older than that of the run, {earlier}"):
            find_survey_date(clouds, earlier=earlier)
        with pytest.raises(InputError, match="2014-05-01; update a run of the older survey"):
            find_survey_date(clouds, "2014-05-01", earlier)
    with pytest.raises(InputError, match="later than that of the run, 2014-05-01"):
        find_survey_date(clouds, earlier="2014-05-01")
    assert find_survey_date(clouds, "2014-05-01", "2014-05-01") == "2014-05-01"
    for earlier in ("", "2014", "2010-01-01"):
        assert find_survey_date(clouds, earlier=earlier) == "2014-05-01"


def test_a_named_day_is_bounded(write):
    clouds = write(MAY_2014)
    with pytest.raises(InputError, match="from 1990 on"):
        find_survey_date(clouds, "1989-12-31")
    ahead = (datetime.date.today() + datetime.timedelta(days=400)).isoformat()
    with pytest.warns(UserWarning, match="in the future; check its day"):
        assert find_survey_date(clouds, ahead) == ahead


def test_a_file_without_a_date_asks_for_one(tmp_path):
    (tmp_path / "a.xyz").write_text("1 2 3\n")
    with pytest.raises(InputError, match="--date"):
        find_survey_date((str(tmp_path / "a.xyz"),))


@pytest.mark.parametrize(("named", "is_refused"), [("", True), ("2019-06-01", False)])
def test_files_written_before_those_of_the_run_need_a_named_day(write, named, is_refused):
    untimed = np.zeros(50)
    earlier = write(untimed, day=200)
    kept = earlier[0].replace("a.las", "earlier.las")
    shutil.move(earlier[0], kept)
    clouds = write(untimed, day=150)
    if is_refused:
        with pytest.raises(InputError, match=r"no older than that of the run, 2019-07-19.*--date"):
            find_survey_date(clouds, named, "", (kept,))
    else:
        assert find_survey_date(clouds, named, "", (kept,)) == named
    assert find_survey_date(write(untimed, day=201), "", "", (kept,)) == "2019-07-20"
