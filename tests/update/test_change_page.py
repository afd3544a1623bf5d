"""Changed buildings in the report's 3D view: both models, and the points of both surveys."""

from dataclasses import replace

import numpy as np
import pytest

from hiproof.evaluate.report import report_html, write_report
from hiproof.evaluate.run import evaluate_run
from hiproof.update.before_after import draw_changes
from pages import at_every_size, is_too_wide, list_complaints, needs_browser, open_page
from sample_models import sample_points, write_sample_run

pytestmark = [needs_browser, pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")]
RAISED_M = 2.0

VISIBLE = """() => Object.entries(comparedLayers)
  .filter(([, layers]) => layers.every(layer => layer.visible && layer.count))
  .map(([name]) => name)"""
HEIGHTS = """() => ["before", "after"].map(name =>
  unpacked(data.changes[0][name].points, Float32Array)
    .reduce((top, v, i) => i % 3 === 2 ? Math.max(top, v) : top, -Infinity))"""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A report of two changed buildings: one was raised, and the other is gone."""
    folder = tmp_path_factory.mktemp("run")
    write_sample_run(folder)
    np.savetxt(folder / "points.xyz", sample_points(), fmt="%.3f")
    earlier = evaluate_run(folder, [str(folder / "points.xyz")])
    raised, gone = (
        replace(
            model, attributes=model.attributes | {"hiproof_change": kind, "hiproof_change_m": m}
        )
        for model, kind, m in zip(
            earlier.models[:2], ("changed", "gone"), (RAISED_M, 0.0), strict=True
        )
    )
    raised = replace(raised, solid=raised.solid.move(np.array([0.0, 0.0, RAISED_M])))
    models = (raised, replace(gone, solid=None), *earlier.models[2:])
    points = (earlier.points[0] + [0.0, 0.0, RAISED_M], np.empty((0, 3)), *earlier.points[2:])
    update = {"by_change": {"changed": 1, "gone": 1}, "roofs_outside": {"built": 3}}
    record = earlier.record | {"update": update}
    run = replace(earlier, models=models, points=points, record=record)
    write_report(folder / "report.html", run, "an update", changes=draw_changes(run, earlier))
    return (folder / "report.html").as_uri()


@at_every_size
def test_the_page_says_what_to_do_next_and_hides_each_cloud_and_model(browser, report, size):
    with open_page(browser, report, size) as page:
        assert not is_too_wide(page) and list_complaints(page) == []
        first = page.locator("main section").first
        steps = first.locator("li strong").all_inner_texts()
        assert steps == ["1 building", "1 building", "3 roofs"]
        assert first.inner_text().startswith("What to do next")
        assert page.evaluate(VISIBLE) == ["points before", "model after", "points after"]
        low, high = page.evaluate(HEIGHTS)
        assert high - low == pytest.approx(RAISED_M, abs=0.01)
        page.uncheck('[data-layer="points before"]')
        page.check('[data-layer="model before"]')
        assert page.evaluate(VISIBLE) == ["model before", "model after", "points after"]
        page.click('[data-change="1"]')
        assert page.input_value("#changed") == "1"
        assert page.evaluate(VISIBLE) == ["model before"]
        page.check('[data-layer="points before"]')
        assert page.evaluate(VISIBLE) == ["model before", "points before"]


def test_a_run_that_is_no_update_has_no_next_steps(tmp_path):
    write_sample_run(tmp_path)
    assert "What to do next" not in report_html(evaluate_run(tmp_path))
