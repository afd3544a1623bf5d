"""Files that are not what an update takes them for: it never believes them in silence."""

import shutil
import warnings

import pytest
import shapely

from hiproof.errors import InputError
from hiproof.update.run import update_area
from tiny_town import make_town, write_footprints
from tiny_updates import make_request, run_over

HOUSES = 9


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The folder of a run over a town of nine houses, beside its cloud."""
    return run_over(tmp_path_factory.mktemp("run"), make_town(HOUSES, 3.0))


def update(run, out, cloud, changes=None, **options):
    """Return the texts of an update's warnings, and its buildings by class."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        summary = update_area(make_request(run, str(cloud), out, **options), changes)
    return [str(w.message) for w in caught], summary.by_change


def write_later(folder, aside=(0.0, 0.0, 0.0)):
    return make_town(HOUSES, 3.0, seed=5).write(folder / "later.laz", aside)


def test_a_survey_and_outlines_as_they_should_be_get_no_warning(run, tmp_path):
    outlines = write_footprints(tmp_path / "new.geojson", make_town(HOUSES).footprints)
    given = {"footprints": str(outlines), "id_attribute": "id"}
    texts, classes = update(run, tmp_path / "out", write_later(tmp_path), **given)
    assert not texts
    assert classes == {"unchanged": HOUSES}


def test_a_copy_of_the_earlier_cloud_is_told(run, tmp_path):
    copy = shutil.copy(run.parent / "first.laz", tmp_path / "later.laz")
    (text,) = update(run, tmp_path / "out", copy)[0]
    assert "9 of 9 sampled roofs have the points of the earlier survey" in text


@pytest.mark.parametrize("way", ["ids of neighbours", "one house further"])
def test_outlines_with_the_ids_of_other_buildings_are_told(run, way, tmp_path):
    outlines = make_town(HOUSES).footprints
    if way == "ids of neighbours":
        ids = list(outlines)
        outlines = dict(zip(ids[1:] + ids[:1], outlines.values(), strict=True))
    else:
        outlines = {id: shapely.affinity.translate(o, 30.0) for id, o in outlines.items()}
    file = str(write_footprints(tmp_path / "new.geojson", outlines))
    given = {"footprints": file, "id_attribute": "id"}
    texts, _ = update(run, tmp_path / "out", write_later(tmp_path), **given)
    (text,) = [text for text in texts if "lie on another building" in text]
    assert f" of {HOUSES} footprints lie on another building than the one with their id" in text


@pytest.mark.parametrize("aside", [(0.0, 0.0, 4.0), (-2.0, 2.0, 0.3)])
def test_where_most_buildings_count_as_changed_the_shift_is_doubted(run, aside, tmp_path):
    texts, classes = update(run, tmp_path / "out", write_later(tmp_path, aside))
    assert classes["changed"] >= 8
    assert any("count as changed, more than a town has" in text for text in texts)


@pytest.mark.parametrize("off_m", [43.0, -43.0])
def test_heights_of_another_system_are_refused(run, off_m, tmp_path):
    """Below the earlier ground all houses were gone, above it all were raised."""
    cloud = write_later(tmp_path, (0.0, 0.0, off_m))
    with pytest.raises(InputError, match="its heights seem to be of another unit or system"):
        update(run, tmp_path / "out", cloud)
    given = {"read": {"shift": f"0,0,{off_m}"}}
    assert update(run, tmp_path / "given", cloud, given)[1] == {"unchanged": HOUSES}


@pytest.mark.parametrize("count", [1, HOUSES])
def test_new_outlines_beside_their_roofs_are_moved_where_earlier_ones_show_it(run, count, tmp_path):
    """However few roofs show it: a village stays as it is."""
    drawn = list(make_town(HOUSES).footprints.items())[:count]
    beside = {id: shapely.affinity.translate(outline, 1.3) for id, outline in drawn}
    given = {"footprints": str(write_footprints(tmp_path / "new.geojson", beside))}
    texts, classes = update(run, tmp_path / "out", write_later(tmp_path), **given)
    assert classes == {"unchanged": HOUSES}
    (text,) = texts
    assert "lie beside their roofs and are moved by (-1." in text


def test_houses_built_anew_beside_where_they_stood_are_no_shift(run, tmp_path):
    """Their new outlines lie on their new roofs."""
    town = make_town(HOUSES, 3.0, seed=5)
    town.xyz[town.classification == 6, 0] += 1.3
    cloud = town.write(tmp_path / "later.laz")
    outlines = {id: shapely.affinity.translate(o, 1.3) for id, o in town.footprints.items()}
    given = {"footprints": str(write_footprints(tmp_path / "new.geojson", outlines))}
    _, classes = update(run, tmp_path / "out", cloud, {"read": {"shift": "off"}}, **given)
    assert classes == {"changed": HOUSES}


def test_a_shift_that_was_mistyped_is_refused(run, tmp_path):
    changes = {"read": {"shift": "0,5,1000"}}
    with pytest.raises(InputError, match="survey on the earlier one, got 0 of 9 sampled roofs"):
        update(run, tmp_path / "out", write_later(tmp_path), changes)
