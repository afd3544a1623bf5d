"""`hiproof update` on the tiny town: one house raised, one pulled down, two as they were."""

import dataclasses
import json
import re
import shutil

import lxml.etree
import numpy as np
import pyogrio
import pytest
import shapely
from click.testing import CliRunner

from hiproof import InputError, OutputError, SettingsError
from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.cli.app import app
from hiproof.edit.points import RunPoints
from hiproof.errors import InputWarning
from hiproof.evaluate.run import evaluate_run
from hiproof.parametric.building import build
from hiproof.parametric.run import build_file
from hiproof.update.change_tables import write_changes
from hiproof.update.run import update_area
from hiproof.write.fragments import load_fragments, save_fragments
from run_records import RECORDS, by_id, records
from tiny_town import ORIGIN, make_town, write_footprints
from tiny_updates import DATE, lay_bare, lose_clouds, make_request, raise_house, run_over

RAISED_M = 2.0


def make_later_survey():
    """The town three years later, by another flight."""
    town = make_town(seed=7)
    raise_house(town, "house-1", RAISED_M)
    lay_bare(town, "house-2", 0.0)
    return town


@pytest.fixture(scope="module")
def cloud(tmp_path_factory):
    return make_later_survey().write(tmp_path_factory.mktemp("later") / "later.laz")


@pytest.fixture(scope="module")
def run(town_run):
    return town_run


@pytest.fixture(scope="module")
def update(run, cloud, tmp_path_factory):
    """The summary of an update, its folder, and the run as it was before."""
    out, before = tmp_path_factory.mktemp("updated"), read_all(run)
    return update_area(make_request(run, cloud, out)), out, before


def read_all(folder):
    return {p: p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_every_house_gets_its_class(update):
    summary, out, _ = update
    assert summary.by_change == {"unchanged": 2, "changed": 1, "gone": 1}
    changes = {id: row.get("change") for id, row in by_id(out).items()}
    assert changes["house-1"]["class"] == "changed"
    assert changes["house-1"]["places"][0]["kind"] == "roof_raised"
    assert changes["house-1"]["places"][0]["difference"] == pytest.approx(RAISED_M, abs=0.05)
    assert changes["house-2"]["class"] == "gone"
    assert by_id(out)["house-2"]["status"] == "no_building"
    assert changes["house-0"] is changes["house-3"] is None


def test_unchanged_houses_keep_their_bytes_and_the_run_stays(update, run):
    _, out, before = update
    old, new = ((f / "parameters.jsonl").read_bytes().splitlines() for f in (run, out))
    assert [a == b for a, b in zip(old, new, strict=True)] == [False, True, False, False, True]
    heads = [json.loads(lines[0]) for lines in (old, new)]
    assert heads[1] == {**heads[0], "update": {"survey": DATE, "roofs_outside": []}}
    solids = [(f / "buildings.city.jsonl").read_bytes().splitlines() for f in (run, out)]
    assert [a == b for a, b in zip(*solids, strict=True)][1:] == [True, False, False, True]
    assert read_all(run) == before


def test_the_raised_house_differs_in_its_height_alone(update, run):
    _, out, _ = update
    old, new = by_id(run)["house-1"], by_id(out)["house-1"]
    measured = ("change", "detail", "points", "density", "nodata_share", "residuals", "parts")
    measured += ("quality",)
    assert {k: v for k, v in new.items() if k not in measured} == {
        k: v for k, v in old.items() if k not in measured
    }
    for before, after in zip(old["parts"], new["parts"], strict=True):
        x, y, z = before["position"]
        assert after["position"] == [x, y, pytest.approx(z + RAISED_M, abs=0.05)]
        assert {**after, "position": 0, "sigma": 0} == {**before, "position": 0, "sigma": 0}
    assert new["residuals"]["rmse"] == pytest.approx(old["residuals"]["rmse"], rel=0.3)
    assert new["change"]["lineage"] == [0]


@pytest.mark.parametrize("rise", [0.5, -1.0])
def test_a_house_on_ground_that_moved_with_it_stands_on_the_new_ground(run, rise, tmp_path):
    town = make_town(seed=7)
    west, _, east, _ = town.footprints["house-1"].bounds
    around = (town.xyz[:, 0] > west - 8) & (town.xyz[:, 0] < east + 8)
    town.xyz[around, 2] += rise
    cloud = town.write(tmp_path / "later.laz")
    with pytest.warns(InputWarning, match="lie elsewhere together with the ground"):
        update_area(make_request(run, cloud, tmp_path / "out"))
    before, after = by_id(run)["house-1"], by_id(tmp_path / "out")["house-1"]
    assert after["change"]["places"][0]["kind"] in ("roof_raised", "roof_lowered")
    assert after["z_ground"] - before["z_ground"] == pytest.approx(rise, abs=0.03)


def test_a_raised_house_with_a_block_on_it_is_no_longer_of_the_earlier_shape(run, tmp_path):
    town = make_later_survey()
    x0, y0, x1, y1 = town.footprints["house-1"].bounds
    corner = np.array([x0 + 0.3 * (x1 - x0), y0 + 0.3 * (y1 - y0)])
    block = shapely.box(*corner, *(corner + 4.0))
    inside = town.lie_in(block) & (town.classification == 6)
    town.xyz[inside, 2] = town.xyz[inside, 2].max() + 2.0
    update_area(make_request(run, town.write(tmp_path / "block.laz"), tmp_path / "out"))
    model = build(by_id(tmp_path / "out")["house-1"])
    top = model.roof.height_at([corner + 2.0 - model.roof.frame.origin[:2]])[0]
    assert top + model.roof.frame.origin[2] == pytest.approx(town.xyz[inside, 2].max(), abs=0.2)


def test_a_changed_house_keeps_its_passage(run, cloud, tmp_path):
    run = shutil.copytree(run, tmp_path / "run")
    lines = (run / "parameters.jsonl").read_text().splitlines()
    number = next(n for n, line in enumerate(lines) if '"id":"house-1"' in line)
    old = json.loads(lines[number])
    x0, y0, x1, y1 = shapely.bounds(shapely.Polygon(old["outline"][0]))
    middle = 0.5 * (y0 + y1)
    ring = [[x0 - 1, middle - 1], [x1 + 1, middle - 1], [x1 + 1, middle + 1], [x0 - 1, middle + 1]]
    ceiling = old["z_ground"] + 2.5
    old["passages"] = [{"outline": [[*ring, ring[0]]], "ceiling": ceiling}]
    lines[number] = json.dumps(old)
    (run / "parameters.jsonl").write_text("\n".join(lines) + "\n")
    update_area(make_request(run, cloud, tmp_path / "out"))
    new = by_id(tmp_path / "out")["house-1"]
    assert new["change"]["class"] == "changed"
    (passage,) = new["passages"]
    assert passage["ceiling"] - new["z_ground"] == pytest.approx(2.5, abs=0.002)


def test_tables_and_attributes_say_what_changed(update):
    _, out, _ = update
    rows = (out / "changes.csv").read_text().splitlines()
    assert [row.split(",")[:3] for row in rows[1:]] == [
        ["house-1", "changed", "roof_raised"],
        ["house-2", "gone", "demolished"],
        ["house-0", "unchanged", "unchanged"],
        ["house-3", "unchanged", "unchanged"],
    ]
    layers = dict(pyogrio.list_layers(out / "changes.gpkg"))
    assert {"changed_buildings", "changed_places", "layer_styles"} <= set(layers)
    info = pyogrio.read_info(out / "changes.gpkg", layer="changed_places")
    assert info["features"] == 2
    feature = json.loads((out / "buildings.city.jsonl").read_text().splitlines()[2])
    attributes = feature["CityObjects"]["house-1"]["attributes"]
    assert attributes["hiproof_change"] == "changed"
    assert attributes["hiproof_change_kind"] == "roof_raised"
    assert attributes["hiproof_valid_from"] == DATE
    record = json.loads((out / "run.json").read_text())["update"]
    assert record["by_change"] == {"unchanged": 2, "changed": 1, "gone": 1}
    assert record["compared_with"] == "points"


def read_gml(folder, path):
    spaces = {"core": "http://www.opengis.net/citygml/2.0"}
    root = lxml.etree.parse(str(folder / "buildings.gml")).getroot()
    return root.xpath(path, namespaces=spaces)


def test_dates_of_surveys_stand_in_all_files(update):
    _, out, _ = update
    assert by_id(out)["house-1"]["change"]["valid_from"] == DATE
    assert by_id(out)["house-2"]["change"]["valid_to"] == DATE
    assert read_gml(out, "//core:creationDate/text()") == [DATE]
    assert read_gml(out, "//core:terminationDate/text()") == [DATE]
    meta, _, _, columns = pyogrio.raw.read(out / "buildings.gpkg", layer="buildings")
    values = dict(zip(meta["fields"], columns, strict=True))
    assert values["hiproof_valid_from"].tolist() == [None, DATE, None, None]
    assert values["hiproof_valid_to"].tolist() == [None, None, DATE, None]
    layers = dict(pyogrio.list_layers(out / "buildings.gpkg"))
    assert "history" not in layers


def test_dates_and_models_that_ended_live_on(run, update, cloud, tmp_path):
    """A house is raised, and lowered again: its first two models are history."""
    first = update_area(make_request(run, cloud, tmp_path / "first", history=True))
    same = make_town(seed=9).write(tmp_path / "same.laz")
    request = make_request(tmp_path / "first", same, tmp_path / "second", history=True)
    update_area(dataclasses.replace(request, date="2027-05-01"))
    assert first.by_change == update[0].by_change
    out = tmp_path / "second"
    meta, _, _, columns = pyogrio.raw.read(out / "buildings.gpkg", layer="history")
    rows = dict(zip(meta["fields"], columns, strict=True))
    assert rows["id"].tolist() == ["house-1", "house-1", "house-2"]
    assert rows["valid_from"].tolist() == [None, DATE, None]
    assert rows["valid_to"].tolist() == [DATE, "2027-05-01", DATE]
    assert np.diff(rows["z_top"])[0] == pytest.approx(RAISED_M, abs=0.05)
    dates = by_id(out)["house-2"]["change"]
    assert (dates["class"], dates["valid_from"]) == ("new", "2027-05-01")
    build_file(out / "parameters.jsonl", tmp_path / "built")
    assert records(tmp_path / "built") == records(out)
    built = tmp_path / "built" / "buildings.gpkg"
    assert built.read_bytes() == (out / "buildings.gpkg").read_bytes()
    ended = by_id(out)["house-1"]["change"]["history"][0]
    assert ended["parts"] == by_id(run)["house-1"]["parts"]


def test_build_makes_the_same_files_from_the_parameters(update, tmp_path):
    _, out, _ = update
    build_file(out / "parameters.jsonl", tmp_path / "built")
    write_changes(tmp_path / "built")
    assert records(tmp_path / "built") == records(out)
    for name in ("changes.csv", "changes.gpkg"):
        assert (tmp_path / "built" / name).read_bytes() == (out / name).read_bytes(), name


def test_a_change_that_cannot_be_read_is_left_out_of_the_tables(update, tmp_path):
    _, out, _ = update
    text = (out / "parameters.jsonl").read_text()
    (tmp_path / "parameters.jsonl").write_text(text.replace('"roof_raised"', "[]"))
    built = build_file(tmp_path / "parameters.jsonl", tmp_path / "built")
    write_changes(tmp_path / "built")
    assert [id for id, _ in built.not_built] == ["house-1"]
    rows = (tmp_path / "built" / "changes.csv").read_text().splitlines()[1:]
    assert [row.partition(",")[0] for row in rows] == ["house-2", "house-0", "house-3"]


def test_a_second_update_gives_the_same_bytes(update, run, cloud, tmp_path):
    _, out, _ = update
    update_area(make_request(run, cloud, tmp_path))
    for name in (*RECORDS, "changes.csv", "changes.gpkg", "buildings.gpkg"):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes(), name


def test_texts_kept_of_the_run_are_those_made_anew(update, run, cloud, tmp_path):
    """Without its state folder a run's texts are made anew; edited parameters count in any case."""
    _, out, _ = update
    bare = shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns(".hiproof"))
    update_area(make_request(bare, cloud, tmp_path / "made"))
    assert records(tmp_path / "made") == records(out)
    edited = shutil.copytree(run, tmp_path / "edited")
    lines = (edited / "parameters.jsonl").read_text().splitlines()
    lines[1] = lines[1].replace('"attributes":{', '"attributes":{"door":"green",')
    (edited / "parameters.jsonl").write_text("\n".join(lines) + "\n")
    update_area(make_request(edited, cloud, tmp_path / "out"))
    rows = by_id(tmp_path / "out")
    assert "change" not in rows["house-0"] and rows["house-0"]["attributes"]["door"] == "green"
    assert b"green" in records(tmp_path / "out")["buildings.gml"]


def test_texts_that_other_code_made_are_made_anew(update, run, cloud, tmp_path):
    _, out, _ = update
    other = shutil.copytree(run, tmp_path / "run")
    (tile,) = (other / ".hiproof" / "tiles").glob("*.npz")
    parts = [
        part | {"citygml.version2": dataclasses.replace(part["citygml.version2"], text=b"<old/>")}
        for part in load_fragments(tile)
    ]
    with tile.open("wb") as file:
        save_fragments(file, parts)
    update_area(make_request(other, cloud, tmp_path / "out"))
    assert records(tmp_path / "out") == records(out)


def test_the_same_call_again_keeps_what_is_done(update, run, cloud):
    summary, out, _ = update
    before = (out / "changes.csv").read_bytes()
    assert update_area(make_request(run, cloud, out)).by_change == summary.by_change
    assert (out / "changes.csv").read_bytes() == before
    with pytest.raises(OutputError, match="date"):
        update_area(make_request(run, cloud, out, date="2024-05-02"))


def test_an_update_of_an_update_starts_from_its_models(update, cloud, tmp_path):
    _, out, _ = update
    again = shutil.copy(cloud, tmp_path / "again.laz")
    summary = update_area(make_request(out, str(again), tmp_path, date="2025-05-01"))
    assert summary.by_change == {"unchanged": 4}
    lines = [(f / "parameters.jsonl").read_bytes().splitlines() for f in (tmp_path, out)]
    assert lines[0][1:] == lines[1][1:]
    assert json.loads(lines[0][0])["update"]["survey"] == "2025-05-01"
    rows = (tmp_path / "changes.csv").read_text().splitlines()[1:]
    assert len(rows) == 4 and all(",unchanged,unchanged,,,,,,,2025-05-01,0," in row for row in rows)


def write_survey(path, step_m, seed, missing=None):
    """The town surveyed once more, so much higher, without the points of a house."""
    town = make_town(seed=seed)
    keep = ~town.lie_in(town.footprints[missing]) if missing else slice(None)
    return town.select(keep).write(path, [0, 0, step_m])


def test_the_shift_of_a_survey_is_taken_off_wherever_its_points_are_used(run, tmp_path):
    """The second survey lies 0.3 m higher than the first, the third 0.2 m lower."""
    high = write_survey(tmp_path / "high.laz", 0.3, 9, missing="house-3")
    low = write_survey(tmp_path / "low.laz", -0.2, 11)
    first = update_area(make_request(run, high, tmp_path / "first"))
    assert first.by_change == {"unchanged": 3, "not_covered": 1}
    evaluated = evaluate_run(tmp_path / "first")
    shares = [figures.quality.share_within_20cm for figures in evaluated.figures[:3]]
    assert shares == pytest.approx([1.0] * 3, abs=0.02)
    drawn = RunPoints(tmp_path / "first").of(by_id(tmp_path / "first")["house-0"])
    assert drawn[:, 2].mean() == pytest.approx(evaluated.points[0][:, 2].mean(), abs=0.001)
    request = make_request(tmp_path / "first", low, tmp_path / "second", date="2025-05-01")
    second = update_area(request)
    assert second.by_change == {"unchanged": 4}
    assert second.surveys.shift.clear_xyz[2] == pytest.approx(-0.2, abs=0.03)


def test_a_town_that_rose_and_a_survey_without_ground_are_not_taken_for_a_shift_in_silence(
    tmp_path,
):
    run, second = run_over(tmp_path, make_town(houses=8)), make_town(houses=8, seed=7)
    roofs = second.select(second.classification == 6)
    later = roofs.write(tmp_path / "later.laz", [0.0, 0.0, 0.6])
    request = make_request(run, later, tmp_path / "auto")
    remark = r"shift of \+0\.60 m in height rests on roofs alone \(8 of"
    with pytest.warns(UserWarning, match=remark):
        update_area(request)
    request = dataclasses.replace(request, out=tmp_path / "off")
    by_change = update_area(request, changes={"read": {"shift": "off"}}).by_change
    assert by_change == {"changed": 8}


def test_without_its_clouds_a_run_is_compared_by_its_models(run, cloud, tmp_path):
    run = lose_clouds(run, tmp_path)
    with pytest.warns(UserWarning, match="compared with its models alone"):
        summary = update_area(make_request(run, cloud, tmp_path / "out"))
    assert summary.by_change == {"unchanged": 2, "changed": 1, "gone": 1}
    assert not summary.surveys.has_earlier


def test_overrides_of_the_run_hold_for_what_changed(town_files, cloud, tmp_path):
    known = tmp_path / "known.jsonl"
    known.write_text('{"id": "house-1", "type": "hip"}\n{"id": "house-2", "type": "hip"}\n')
    given = {"overrides": str(known)}
    reconstruct_area(Request((town_files[0],), tmp_path / "run", town_files[1], **given))
    summary = update_area(make_request(tmp_path / "run", cloud, tmp_path / "out"))
    assert summary.by_change == {"unchanged": 2, "changed": 1, "gone": 1}
    house = by_id(tmp_path / "out")["house-1"]
    assert house["type"] == "hip" and "overridden: type hip" in house["detail"]
    known.rename(tmp_path / "lost.jsonl")
    with pytest.warns(UserWarning, match=r"known\.jsonl, are not there"):
        update_area(make_request(tmp_path / "run", cloud, tmp_path / "without"))


def test_the_command_prints_the_result(update, run, cloud):
    _, out, _ = update
    words = ["update", str(run), cloud, "--out", str(out), "--date", DATE, "--jobs", "1"]
    result = CliRunner().invoke(app, words)
    if result.exit_code:  # the call above was made with one process, too
        raise AssertionError(result.output)
    assert "4 buildings: 2 unchanged, 1 changed, 1 gone" in result.output


def test_the_report_draws_changed_buildings_before_and_after(update, tmp_path):
    _, out, _ = update
    page = tmp_path / "report.html"
    result = CliRunner().invoke(app, ["report", str(out), "--out", str(page)])
    assert result.exit_code == 0, result.output
    cards = page.read_text().split('<figure class="change">')[1:]
    names = [re.search("<figcaption>(.*?)</figcaption>", card)[1] for card in cards]
    texts = [re.sub("<.*?>", "", name).partition(",")[0] for name in names]
    assert texts == ["house-2 gone", "house-1 changed"]
    gone, raised = (card.partition("</figcaption>")[0] for card in cards)
    assert gone.count("<svg") == 2 and "<p>no model</p>" in gone  # from above and from the side
    assert raised.count("<svg") == 4 and "roof raised, +2.0" in raised
    assert all(dots for dots in raised.split('<g class="dots">')[1:])
    assert page.stat().st_size < 300_000


def test_a_report_without_the_earlier_run_draws_no_changes(update, tmp_path):
    out = shutil.copytree(update[1], tmp_path / "out")
    record = json.loads((out / "run.json").read_text())
    record["update"]["run"] = str(tmp_path / "gone")
    (out / "run.json").write_text(json.dumps(record))
    result = CliRunner().invoke(app, ["report", str(out)])
    assert result.exit_code == 0, result.output
    assert "<figure" in (out / "report.html").read_text()
    assert 'class="change"' not in (out / "report.html").read_text()


def test_bad_input_is_refused_in_a_sentence(run, cloud, tmp_path):
    run, east = shutil.copytree(run, tmp_path / "run"), np.array([5000.0, 0.0, 0.0])
    later = make_later_survey()
    far = later.write(tmp_path / "far.laz", east, origin=ORIGIN + east)
    other = later.write(tmp_path / "utm.laz", crs="EPSG:25832")
    cases = [
        (dict(out=run), OutputError, "never changes its run"),
        (dict(significance=0.0), SettingsError, "between 0 and 1"),
        (dict(date="May 2024"), InputError, "--date 2014-02-09"),
        (dict(run=tmp_path), InputError, "finished run"),
        (dict(clouds=(far,)), InputError, "which lie in"),
        (dict(clouds=(other,)), InputError, "in the CRS of"),
    ]
    for change, error, text in cases:
        with pytest.raises(error, match=text):
            update_area(dataclasses.replace(make_request(run, cloud, tmp_path / "out"), **change))
    lines = (run / "parameters.jsonl").read_text().splitlines()
    lines[2] = lines[2].replace('"type":"gable"', '"type":"igloo"')
    (run / "parameters.jsonl").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"building house-1 in .*parameters\.jsonl"):
        update_area(make_request(run, cloud, tmp_path / "out"))
    assert not (tmp_path / "out" / "parameters.jsonl").exists()


def test_a_survey_that_took_the_place_of_the_earlier_file_is_refused(town_files, tmp_path):
    """Compared with itself it would show no change."""
    cloud = shutil.copy(town_files[0], tmp_path / "tile.laz")
    reconstruct_area(Request((str(cloud),), tmp_path / "run", town_files[1]))
    make_later_survey().write(cloud)
    link = tmp_path / "link.laz"
    link.symlink_to(cloud)
    for same in (cloud, link, tmp_path / "run" / ".." / "tile.laz"):
        with pytest.raises(InputError, match="of which the run was made; name others"):
            update_area(make_request(tmp_path / "run", str(same), tmp_path / "out"))
    moved = str(shutil.move(cloud, tmp_path / "moved.laz"))
    summary = update_area(make_request(tmp_path / "run", moved, tmp_path / "out"))
    assert summary.by_change == {"unchanged": 2, "changed": 1, "gone": 1}


def test_new_footprints_that_lie_elsewhere_are_refused(run, cloud, tmp_path):
    far = {"far": shapely.affinity.translate(make_town().footprints["house-0"], 9000.0)}
    request = make_request(run, cloud, tmp_path / "out", footprints=draw_footprints(tmp_path, far))
    with pytest.raises(InputError, match="expected footprints that overlap the cloud"):
        update_area(request)


def test_what_changed_most_comes_first_where_an_outline_grew(run, tmp_path):
    """A house gets a wing as large as itself, and a dormer."""
    town = make_town(seed=7)
    house = town.footprints["house-1"]
    wing = shapely.affinity.translate(house, 0.0, house.bounds[3] - house.bounds[1])
    inside = town.lie_in(wing)
    town.xyz[inside, 2], town.classification[inside] = ORIGIN[2] + 3.5, 6
    town.xyz[town.lie_in(house.centroid.buffer(1.5, 1)), 2] += 1.5
    outlines = {"large": shapely.union_all([house, wing], grid_size=0.01)}
    files = draw_footprints(tmp_path, outlines)
    grown = town.write(tmp_path / "grown.laz")
    update_area(make_request(run, grown, tmp_path / "out", footprints=files))
    places = by_id(tmp_path / "out")["house-1"]["change"]["places"]
    assert places[0]["kind"] == "outline_changed"
    assert len(places) > 1


def draw_footprints(folder, outlines):
    return str(write_footprints(folder / "new.geojson", outlines))


def test_new_footprints_keep_ids_and_name_predecessors(run, cloud, tmp_path):
    """One is drawn again under another name, one extended, one split, one missing, one added."""
    outlines = make_town().footprints
    x0, y0, x1, y1 = outlines["house-2"].bounds
    names = {
        "A0": outlines["house-0"],
        "A1": outlines["house-1"].union(shapely.box(*outlines["house-1"].bounds).buffer(1.0)),
        "A2-west": shapely.box(x0, y0, (x0 + x1) / 2, y1),
        "A2-east": shapely.box((x0 + x1) / 2, y0, x1, y1),
        "yard": shapely.box(x1 + 4, y0, x1 + 9, y1),
    }
    same = make_town(seed=7).write(tmp_path / "same.laz")
    request = make_request(run, same, tmp_path / "out", footprints=draw_footprints(tmp_path, names))
    update_area(dataclasses.replace(request, id_attribute="id"))
    rows = by_id(tmp_path / "out")
    assert list(rows) == ["house-0", "house-1", "A2-west", "A2-east", "yard", "house-3"]
    kinds = {
        id: [p["kind"] for p in (row.get("change") or {"places": []})["places"]]
        for id, row in rows.items()
    }
    assert kinds["house-0"] == kinds["house-3"] == []
    assert kinds["house-1"] == ["outline_changed"]
    assert kinds["A2-west"] == kinds["A2-east"] == ["split"]
    assert rows["A2-west"]["change"]["predecessors"] == ["house-2"]
    assert rows["yard"]["status"] in ("no_points", "no_building")
    text = (tmp_path / "out" / "changes.csv").read_text()
    assert "A2-east,changed,split" in text and ",house-2" in text


def test_a_building_whose_footprint_was_moved_keeps_its_place_and_shift(
    town_files, cloud, tmp_path
):
    town = make_town()
    beside = {id: shapely.affinity.translate(p, 1.2, -0.8) for id, p in town.footprints.items()}
    footprints = draw_footprints(tmp_path, beside)
    reconstruct_area(Request((town_files[0],), tmp_path / "run", footprints, id_attribute="id"))
    rows = by_id(tmp_path / "run")
    assert any(rows["house-1"]["shift"])
    update_area(make_request(tmp_path / "run", cloud, tmp_path / "out"))
    after = by_id(tmp_path / "out")
    assert after["house-0"] == rows["house-0"]
    assert after["house-1"]["change"]["places"][0]["kind"] == "roof_raised"
    assert after["house-1"]["shift"] == rows["house-1"]["shift"]
    middle = [
        shapely.Polygon(r["outline"][0]).centroid for r in (rows["house-1"], after["house-1"])
    ]
    origins = [r["origin"] for r in (rows["house-1"], after["house-1"])]
    places = [(c.x + o[0], c.y + o[1]) for c, o in zip(middle, origins, strict=True)]
    assert np.abs(np.subtract(*places)).max() < 0.01
