"""The sun as people see it: colours in QGIS, and in the report's map and 3D view."""

import base64
import sqlite3

import numpy as np
import pytest

from hiproof.enrich.run import enrich_run
from hiproof.evaluate.report_data import places_on_map, report_data
from hiproof.evaluate.run import evaluate_run
from hiproof.settings import EnrichSettings
from hiproof.write.colours import SUN_STOPS
from hiproof.write.tables.styles import TABLE
from streets import lose_house, place_house, write_street

pytest.importorskip("pvlib", reason="needs the extra sun")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    houses = [place_house("a", 0, 0, rise=4.0), place_house("b", 20, 0), lose_house("lost", 40, 0)]
    folder = write_street(tmp_path_factory.mktemp("sun"), houses)
    enrich_run(folder, settings=EnrichSettings(sun=True), processes=1)
    enrich_run(folder, folder / "plain", processes=1)
    return folder


def read_styles(path):
    with sqlite3.connect(path) as file:
        rows = file.execute(
            f"select f_table_name, styleName, styleQML, useAsDefault from {TABLE}"
        ).fetchall()
    return {(layer, name): (qml, bool(default)) for layer, name, qml, default in rows}


def test_qgis_draws_roofs_by_the_sun(folder):
    styles = read_styles(folder / "enriched" / "buildings.gpkg")
    defaults = [key for key, (_, is_default) in styles.items() if is_default]
    assert sorted(defaults) == [
        ("buildings", "roof types"), ("parts", "roof types"), ("roof_surfaces", "sun")
    ]  # fmt: skip
    expression = styles["roof_surfaces", "sun"][0].split('attr="')[1].split('" ')[0]
    case = expression.replace("&quot;", '"').replace("&gt;", ">")
    with sqlite3.connect(folder / "enriched" / "buildings.gpkg") as file:
        rows = file.execute(f"select hiproof_sun_kwh_m2, {case} from roof_surfaces").fetchall()
    assert len(rows) == 3
    for value, name in rows:
        least = max(stop for stop, _ in SUN_STOPS if value >= stop)
        assert name == f"from {least:g} kWh/m2 (clear sky)"


def test_without_the_sun_qgis_draws_roof_types(folder):
    styles = read_styles(folder / "plain" / "buildings.gpkg")
    assert styles["roof_surfaces", "roof types"][1] and ("roof_surfaces", "sun") not in styles


def test_the_report_has_the_sun_of_every_face_and_roof(folder):
    run = evaluate_run(folder / "enriched")
    data = report_data(run, places_on_map(run))
    south_and_north, level, lost = (building["sun"] for building in data["buildings"])
    suns = np.frombuffer(base64.b64decode(data["mesh"]["sun"]), "<f4")
    owner = np.frombuffer(base64.b64decode(data["mesh"]["owner"]), "<u4")
    roof = np.frombuffer(base64.b64decode(data["mesh"]["roof"]), "u1") > 0
    assert lost is None and (suns[~roof] == -1).all()
    assert suns[roof & (owner == 1)] == pytest.approx(level, rel=1e-4)
    faces = sorted(set(suns[roof & (owner == 0)].tolist()))
    assert len(faces) == 2 and np.mean(faces) == pytest.approx(south_and_north, rel=1e-4)
    assert faces[0] < level < faces[1]


def test_a_report_without_the_sun_offers_none(folder):
    run = evaluate_run(folder / "plain")
    assert report_data(run, places_on_map(run))["mesh"]["sun"] == ""
