"""The overview of a run: how many buildings were modelled, how well, and which need attention."""

import json

import pytest
from click.testing import CliRunner

from hiproof.cli.app import app
from hiproof.cli.running import describe_overview
from hiproof.evaluate.overview import BuildingOutcome, Overview
from hiproof.evaluate.report import report_html
from hiproof.evaluate.run import evaluate_run
from hiproof.status import ATTENTION_OF_STATUS, Attention, Status, find_attention

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
