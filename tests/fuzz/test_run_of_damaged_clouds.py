"""A run of sound and damaged clouds: the damaged are named, the buildings come out as if they had
not been there.
"""

import re

import pytest

import planted
from fuzz.damaged_clouds import damaged_clouds
from hiproof.city import run as city_run
from hiproof.city.run import Request, reconstruct_area
from hiproof.errors import InputError
from run_records import records
from tiny_town import make_town, write_town


@pytest.mark.parametrize("with_footprints", [True, False], ids=["with footprints", "without"])
def test_damaged_clouds_are_named_and_harm_no_building(with_footprints, tmp_path, monkeypatch):
    if with_footprints:
        monkeypatch.setattr(city_run, "solve_tile", planted.solve_quickly)
    cloud, footprints = map(str, write_town(tmp_path, make_town(2, 3.0)))
    footprints = footprints if with_footprints else None
    damaged = {str(case.path): case.sentence for case in damaged_clouds(tmp_path / "damaged")}
    single_run = reconstruct_area(Request((cloud,), tmp_path / "alone", footprints))
    summary = reconstruct_area(Request((cloud, *damaged), tmp_path / "together", footprints))
    assert single_run.exit_code == 0 and summary.exit_code == 2
    reasons = dict(summary.broken_inputs)
    assert reasons.keys() == damaged.keys()
    assert all(re.search(sentence, reasons[path]) for path, sentence in damaged.items())
    assert records(tmp_path / "together") == records(tmp_path / "alone")


def test_a_run_of_damaged_clouds_alone_is_refused(tmp_path):
    _, footprints = write_town(tmp_path, make_town(2, 3.0))
    paths = [str(case.path) for case in damaged_clouds(tmp_path / "damaged")[:3]]
    with pytest.raises(InputError, match="expected"):
        reconstruct_area(Request(tuple(paths), tmp_path / "out", str(footprints)))
