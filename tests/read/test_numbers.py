"""Numbers that people write in columns: plain ones are read, others counted and named."""

import warnings

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from any_text import ANY_TEXT
from hiproof.city.plan.overrides import check_number_columns
from hiproof.city.plan.passages import add_passages
from hiproof.city.request import Request
from hiproof.errors import InputError, InputWarning
from hiproof.model import Footprint
from hiproof.parametric.fallback import read_fallback
from hiproof.read.numbers import METRES_OF, read_number, read_year
from hiproof.settings import Settings

UNITS = {"": 1.0, " m": 1.0, "m": 1.0, " metres": 1.0, " ft": 0.3048, "'": 0.3048, " FEET": 0.3048}


@given(
    st.decimals(-2000, 2000, places=2), st.sampled_from(sorted(UNITS)), st.sampled_from([".", ","])
)
def test_plain_numbers_are_read(value, unit, point):
    text = f"{value}".replace(".", point) + unit
    assert read_number(text) == pytest.approx(float(value) * UNITS[unit], abs=1e-8)
    assert read_number(float(value)) == read_number(str(value)) == float(value)


@given(ANY_TEXT)
def test_other_text_is_no_number(text):
    """Whatever is read is a number with at most a comma and a unit of length."""
    number = read_number(text)
    letters = "".join(c for c in text.strip().lower() if c not in "0123456789.,+-e \t\n")
    assert number is None or letters in {unit.replace("e", "") for unit in METRES_OF}


@pytest.mark.parametrize(
    "value", ["ca. 12", "1,234", "12 apples", "12-14", "1e999", np.nan, "nan", None, True, [3], "m"]
)
def test_what_is_not_plain_is_no_number(value):
    assert read_number(value) is None


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_numbers_lie_within_their_bounds(value):
    number = read_number(value, 0.0, 1000.0)
    assert number == (value if 0 <= value <= 1000 else None)


@pytest.mark.parametrize("value", ["2016-05-03T00:00:00", "2016-05", 2016, 2016.0, "2016.0 "])
def test_years_are_read_from_years_and_dates(value):
    assert read_year(value) == 2016


@pytest.mark.parametrize("value", ["ca. 2016", -9999, 9999, 0, None, "20160503", "2016/17", 201.6])
def test_other_years_are_unknown(value):
    assert read_year(value) is None


COLUMNS = {"raised_column": "h", "fallback_roof_height": "+h", "fallback_ground_height": "h"}
BAD = ("ca. 12", "-9999", -9999, "1e308", "12 m 3")


def make_footprints(name, values):
    square = np.array([[0, 0], [8, 0], [8, 8], [0, 8]], float)
    return tuple(
        Footprint(f"b{k}", shapely.Polygon(square + 20 * k), {name: value})
        for k, value in enumerate(values)
    )


@pytest.mark.parametrize("setting", [*COLUMNS, "year_column"])
def test_values_that_are_left_out_are_counted_and_named(setting):
    read = Settings().replace({"read": {setting: COLUMNS.get(setting, "h")}}).read
    footprints = make_footprints("h", [*BAD, "2016" if "year" in setting else "12,5 m", "", None])
    with pytest.warns(InputWarning, match=r"expected h .*, left out 5 of its values: ca. 12"):
        check_number_columns(footprints, read)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_number_columns(footprints[len(BAD) :], read)


def test_units_and_commas_count_in_every_column(tmp_path):
    read = {"raised_column": "h", "fallback_roof_height": "+h", "fallback_ground_height": "h"}
    settings = Settings().replace({"read": read})
    footprints = make_footprints("h", ["12.5", "12,5 m", "12.5m", 12.5])
    request = Request(("a.laz",), tmp_path, "a.gpkg", settings=settings)
    for footprint in add_passages(footprints, request, None):
        assert [clearance for _, clearance in footprint.passages] == [12.5]
        heights = read_fallback(footprint.attributes, settings.read)
        assert heights.block_m == heights.ground_m == 12.5


def test_a_year_that_no_footprint_has_is_refused():
    read = Settings().replace({"read": {"year_column": "yaer"}}).read
    with pytest.raises(InputError, match=r"expected a column yaer of the footprints"):
        check_number_columns(make_footprints("year", ["2016"]), read)
