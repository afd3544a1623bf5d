"""The report as text, and as a browser shows it: Chromium opens the page and clicks."""

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from hiproof.cli.app import app, import_command
from hiproof.cli.running import describe_overview
from hiproof.evaluate.overview import BuildingOutcome, Overview
from hiproof.evaluate.report import embed_json, report_html, worst_indices
from hiproof.evaluate.report_data import report_data
from hiproof.evaluate.report_pictures import building_pictures, histogram, residual_bins
from hiproof.evaluate.run import evaluate_run
from hiproof.status import ATTENTION_OF_STATUS, Attention, Status, find_attention
from hiproof.write.colours import CHANGE_COLOURS, RESIDUAL_STOPS, type_colour
from pages import needs_browser, open_page
from sample_models import two_parts, write_sample_run

FILL = "document.querySelector('#map [data-building=\"0\"]').getAttribute('fill')"
# where the highest roof of a building is drawn in the window
ON_ROOF = """index => {
  const t = mesh.owner.findLastIndex((owner, t) => owner === index && mesh.roof[t]);
  const middle = [0, 1, 2].map(k => [0, 3, 6].reduce(
    (sum, corner) => sum + mesh.corners[9 * t + corner + k] / 3, 0));
  viewer.canvas.scrollIntoView();
  const [x, y] = viewer.project(middle), { left, top } = viewer.canvas.getBoundingClientRect();
  return [left + x, top + y];
}"""


@pytest.fixture(scope="module")
def run(sample_run):
    return evaluate_run(sample_run, [str(sample_run / "points.xyz")])


@pytest.fixture(scope="module")
def page(run):
    return report_html(run, "a <sample> run")


@pytest.fixture(scope="module")
def address(page, tmp_path_factory):
    path = tmp_path_factory.mktemp("browser") / "page.html"
    path.write_text(page, encoding="utf-8")
    return path.as_uri()


@needs_browser
def test_clicks_show_buildings_and_the_choice_their_colours(browser, address, run):
    with open_page(browser, address) as shown:
        assert shown.locator("[data-building]").count() == len(run.models)
        before = shown.evaluate(FILL)
        shown.locator('#map [data-building="0"]').dispatch_event("click")
        assert {"house-1", "rf_volume_lod22"} <= set(shown.inner_text("#details").split())
        shown.locator("[data-select]").first.dispatch_event("click")
        assert "block 2" in shown.inner_text("#details")
        shown.locator('#map [data-building="0"]').dispatch_event("click")
        assert shown.evaluate("Boolean(viewer.gl)")
        shown.mouse.click(*shown.evaluate(ON_ROOF, 1))
        assert "block 2" in shown.inner_text("#details")
        fills = {}
        for value in ("residual", "quality", "status", "type"):
            shown.select_option("#mode", value)
            fills[value] = shown.evaluate(FILL)
        assert fills["type"] == before and len(set(fills.values()) - {fills["quality"]}) == 3


@needs_browser
def test_without_webgl_the_map_still_works(browser, address):
    hide = "HTMLCanvasElement.prototype.getContext = () => null;"
    with open_page(browser, address, script=hide) as shown:
        assert not shown.evaluate("Boolean(viewer.gl)")
        assert shown.locator("[data-building]").count() == 3
        shown.locator('#map [data-building="0"]').dispatch_event("click")
        assert "house-1" in shown.inner_text("#details")


def test_nothing_in_the_page_asks_the_network(page):
    outside = {name for name in re.findall(r"https?://[^\s\"'<>\\]+", page)}
    assert outside <= {"http://www.w3.org/2000/svg"}
    assert not re.search(r"<(link|script|img)[^>]+(src|href)=[\"'](?!data:)", page)


def test_roofs_are_coloured_by_their_parts(run):
    solid, parts = two_parts().solid, two_parts().part_types
    model = replace(run.models[0], solid=solid, part_types=parts)
    data = report_data(replace(run, models=(model, *run.models[1:])), [None] * len(run.models))
    types = data["types"]
    assert types == ["flat", "gable", "hip", "unknown"]
    owner = np.frombuffer(base64.b64decode(data["mesh"]["owner"]), "<u4")
    roof = np.frombuffer(base64.b64decode(data["mesh"]["roof"]), "u1")
    assert [types[k - 1] for k in roof[owner == 0] if k] == ["gable", "gable", "hip", "hip"]
    assert {types[k - 1] for k in roof[owner == 1] if k} == {"flat"}
    pictures = building_pictures(solid, np.empty((0, 3)), np.empty(0), parts)
    assert all(f'fill="{type_colour(kind)}"' in pictures for kind in ("gable", "hip"))


def test_poor_models_are_the_worst_whatever_their_share(run):
    """The block fits its points worse than the gable; the verdicts decide before that."""
    grades = {"house-1": "poor", "block 2": "good"}
    models = tuple(
        replace(m, attributes=m.attributes | {"hiproof_quality": grades.get(m.id)})
        for m in run.models
    )
    judged = replace(run, models=models)
    assert [run.models[index].id for index in worst_indices(run)] == ["block 2", "house-1"]
    assert [run.models[index].id for index in worst_indices(judged)] == ["house-1", "block 2"]
    page = report_html(judged)
    assert "<td>1</td><td>poor: look at the building before you use it</td>" in page
    assert report_data(judged, [None] * len(models))["buildings"][0]["quality"] == "poor"


def test_names_from_the_data_cannot_become_markup(run):
    wicked = replace(run.models[0], id="</script><img src=x>")
    page = report_html(replace(run, models=(wicked, *run.models[1:])), "<b>")
    assert "<img" not in page and "&lt;b&gt;" in page
    assert json.loads(embed_json(["</script>"])) == ["</script>"]


def test_names_that_a_page_would_obey_are_spelled_out(run):
    """U+202E turns what follows it; some programs obey escape sequences."""
    odd = replace(run.models[0], id="a\u202eb\x1b[31m")
    page = report_html(replace(run, models=(odd, *run.models[1:])))
    assert ">a\\u202eb\\x1b[31m</button>" in page
    assert not {"\u202e", "\x1b"} & set(page)


def test_text_of_the_data_is_not_taken_for_a_place_in_the_page(run):
    page = report_html(run, "<!--data-->")
    assert page.count('"buildings":[') == 1


def test_a_run_without_points_is_reported_too(tmp_path):
    write_sample_run(tmp_path)
    import_command("report")([str(tmp_path)], standalone_mode=False)
    page = (tmp_path / "report.html").read_text()
    assert "no residuals" in page and "No points are given" in page


def test_of_too_many_buildings_the_worst_are_shown_and_all_are_counted(run):
    large_run = run.only([0, 2, 2, 2, 2, 1, 2, 2, 2, 2])
    page = report_html(large_run, most_shown=4)
    data = json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', page)[1])
    ids = [building["id"] for building in data["buildings"]]
    assert {"house-1", "block 2"} <= set(ids) and len(ids) <= 4
    assert "10 buildings" in page and f"show {len(ids)} of them" in page
    assert f'data-select="{ids.index("block 2")}"' in page


def test_an_empty_run_makes_a_page(tmp_path):
    head = {"type": "CityJSON", "version": "2.0", "CityObjects": {}, "vertices": []}
    (tmp_path / "buildings.city.jsonl").write_text(json.dumps(head) + "\n")
    assert "0 buildings" in report_html(evaluate_run(tmp_path))


def test_residual_colours_begin_at_their_stops():
    distances = np.array([stop for stop, _ in RESIDUAL_STOPS])
    assert residual_bins(distances).tolist() == list(range(len(RESIDUAL_STOPS)))
    assert residual_bins(np.array([0.049, 99.0, np.inf])).tolist() == [0, 4, 4]


@pytest.mark.parametrize("values", [[], [np.nan], [1.0], [2.0, 2.0]])
def test_histograms_of_next_to_nothing(values):
    assert histogram(np.array(values), "x", "m").startswith("<figure>")


def test_a_histogram_of_one_value_is_told_and_one_that_is_cut_says_so():
    assert (
        histogram(np.array([0.99998, 1.0]), "IoU", "")
        == "<figure><figcaption>IoU: 1 for all</figcaption></figure>"
    )
    assert "and more" in histogram(np.array([*range(100), 1000.0]), "x", "m")
    assert "and more" not in histogram(np.array([1.0, 2.0, 2.0, 2.0]), "x", "m")


def test_changes_of_an_update_have_a_colour_of_their_own(run):
    models = [run.models[0], *run.models[1:]]
    changed = {**models[0].attributes, "hiproof_change": "gone"}
    models[0] = replace(models[0], attributes=changed)
    data = report_data(replace(run, models=models), [None] * len(models))
    changes = [building["change"] for building in data["buildings"]]
    assert changes == ["gone", *[None] * (len(models) - 1)]
    assert data["colours"]["change"]["gone"] == CHANGE_COLOURS["gone"]
    update = replace(run, models=models, record={**run.record, "update": {}})
    changes = [b["change"] for b in report_data(update, [None] * len(models))["buildings"]]
    assert changes == ["gone", *["unchanged"] * (len(models) - 1)]
    assert data["colours"]["change"]["unchanged"] != data["colours"]["change"]["not_covered"]


GOOD = BuildingOutcome("modelled", "good", "modelled", 0.98)


def test_a_building_whose_points_lie_off_its_roof_is_not_called_modelled():
    half_off = GOOD._replace(share=0.49)
    overview = Overview.of([GOOD, half_off, GOOD._replace(status="no_points", share=None)])
    assert (overview.modelled, overview.buildings) == (1, 3)
    assert overview.attention == {Attention.DOUBTFUL: 1, Attention.NO_POINTS: 1}


def test_the_median_building_and_the_worst_tenth_are_named():
    overview = Overview.of(GOOD._replace(share=(60 + i) / 100) for i in range(40))
    assert (overview.median_share, overview.worst_tenth_share) == (0.80, 0.64)
    assert (
        "80.0 % in the median building; a tenth of the buildings have less than 64.0 %"
        in overview.fit
    )


def test_every_outcome_without_a_model_needs_attention_unless_a_person_wanted_it():
    without = {status for status in Status if not status.is_model} - {Status.LEFT_OUT}
    assert without <= set(ATTENTION_OF_STATUS)
    assert find_attention("left_out", None, "", None) == ()


@pytest.mark.parametrize(
    ("detail", "kinds"),
    [
        ("poor: 20 m2 of bare ground inside its footprint", (Attention.CHANGED,)),
        ("over 60 % of its area ground points lie under the roof", (Attention.CHANGED,)),
        ("34 points up to 2.0 m above the model", ()),
    ],
)
def test_signs_of_change_are_found_in_the_detail(detail, kinds):
    assert find_attention("modelled", "fair", detail, 0.9) == kinds


def test_the_summary_begins_with_the_result_and_names_a_command_for_each_kind():
    overview = Overview.of([GOOD, GOOD._replace(quality="poor"), BuildingOutcome(*3 * [""], None)])
    lines = describe_overview(overview, {"good": 1, "poor": 1}, "models")
    assert "2 of 3 buildings modelled" in lines[0]
    assert "    hiproof edit models --only doubtful" in lines


def test_run_json_status_and_report_hold_the_same_overview(reference_run):
    kept = json.loads((reference_run / "run.json").read_text())["summary"]
    said = CliRunner().invoke(app, ["status", str(reference_run), "--json"]).stdout
    assert json.loads(said)["summary"] == kept
    overview = Overview.from_dict(kept)
    assert overview.to_dict() == kept and overview.buildings == 4
    page = report_html(evaluate_run(reference_run))
    assert f"<strong>{overview.headline}.</strong>" in page
    assert all(f"--only {kind.code}</code>" in page for kind in overview.attention)
