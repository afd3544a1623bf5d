"""The sun on roofs: as pvlib has it without shade, and as rays have it with shade."""

import base64
import math
import sqlite3

import numpy as np
import pytest
from click.testing import CliRunner

from hiproof.cli.app import app
from hiproof.enrich.answer import answer
from hiproof.enrich.cadastre import Cadastre, locate, measure_panels
from hiproof.enrich.far import SECTORS, find_horizon, measure_share
from hiproof.enrich.run import enrich_run
from hiproof.enrich.sun import irradiate, make_sky, measure_sky, sample_face
from hiproof.enrich.walls import measure_faces
from hiproof.errors import InputError
from hiproof.evaluate.report_data import places_on_map, report_data
from hiproof.evaluate.run import evaluate_run
from hiproof.model import ROOF, WALL
from hiproof.settings import EnrichSettings
from hiproof.write.attribute_list import OWN, TABLES
from hiproof.write.colours import SUN_STOPS
from hiproof.write.head import FileHead
from hiproof.write.meshes.triangles import faces_triangles
from hiproof.write.tables.styles import TABLE
from streets import lose_house, open_street, place_house, write_street
from weather import write_epw

pvlib = pytest.importorskip("pvlib", reason="needs the extra sun")

DELFT = (52.0, 4.36)
NOTHING = np.empty((0, 2, 3))
SLOPES = [(0, 180), (35, 180), (35, 0), (60, 90), (20, 250)]


def make_normal(slope, azimuth):
    b, a = math.radians(slope), math.radians(azimuth)
    return np.array([math.sin(b) * math.sin(a), math.sin(b) * math.cos(a), math.cos(b)])


def transpose_with_pvlib(times, values, slope, azimuth):
    position = pvlib.location.Location(*DELFT).get_solarposition(times)
    total = pvlib.irradiance.get_total_irradiance(
        slope,
        azimuth,
        position["zenith"],
        position["azimuth"],
        values["dni"],
        values["ghi"],
        values["dhi"],
        dni_extra=pvlib.irradiance.get_extra_radiation(times),
        albedo=0.2,
        model="haydavies",
    )
    return float(total["poa_global"].fillna(0.0).sum()) / 1000.0


def test_unshaded_roofs_are_as_pvlib_has_them(tmp_path):
    times, values = write_epw(tmp_path / "a.epw")
    sky = make_sky(*DELFT, 0.0, 0.0, str(tmp_path / "a.epw"))
    for slope, azimuth in SLOPES:
        sun = irradiate(make_normal(slope, azimuth), np.zeros((1, 3)), NOTHING, sky, 0.2)
        expected = transpose_with_pvlib(times, values, slope, azimuth)
        assert sun.by_month.sum() == pytest.approx(expected, rel=1e-3)
        assert sun.shaded_share == pytest.approx(0.0, abs=1e-12)


def test_a_clear_sky_is_that_of_pvlib():
    sun = irradiate(
        make_normal(30, 180), np.zeros((1, 3)), NOTHING, make_sky(*DELFT, 0.0, 0.0), 0.2
    )
    assert 1700 < sun.by_month.sum() < 2400
    assert sun.by_month.argmax() in (4, 5, 6) and sun.by_month.argmin() in (0, 11)


@pytest.mark.parametrize("elevation", [10.0, 45.0, 70.0])
def test_a_long_wall_hides_its_share_of_the_sky(elevation):
    height = math.tan(math.radians(elevation))
    wall = np.array([[[-1000.0, 1.0, height], [1000.0, 1.0, height]]])
    seen = measure_sky(make_normal(0, 0), find_horizon(np.zeros((1, 3)), wall))
    assert seen == pytest.approx((1 + math.cos(math.radians(elevation))) / 2, abs=2e-3)


@pytest.mark.parametrize("slope, azimuth", SLOPES)
def test_a_free_plane_sees_its_share_of_the_sky(slope, azimuth):
    seen = measure_sky(make_normal(slope, azimuth), np.zeros((1, SECTORS)))
    assert seen == pytest.approx((1 + math.cos(math.radians(slope))) / 2, abs=1e-3)


def make_quarter():
    """Return houses of several heights, close together, and a tower."""
    rng = np.random.default_rng(4)
    eaves = rng.uniform(3, 7, 9)
    places = [(9.0 * i, 14.0 * k) for i in range(3) for k in range(3)]
    houses = [
        place_house(f"h{n}", x, y, 8.0, eave=float(eaves[n]), rise=3.0 * (n % 2), turn=20.0)
        for n, (x, y) in enumerate(places)
    ]
    return [*houses, place_house("tower", 30.0, -10.0, 8.0, 8.0, 25.0, turn=20.0)]


def list_triangles(solid):
    """Return the triangles (m, 3, 3) of a solid."""
    return solid.vertices[np.concatenate(faces_triangles(solid.vertices, solid.faces))]


def cast_rays(triangles, places, directions):
    """Return whether each place (n,) is free in each direction (t,), by all triangles (m, 3, 3)."""
    corner = triangles[:, 0]
    u = triangles[:, 1] - triangles[:, 0]
    v = triangles[:, 2] - triangles[:, 0]
    free = np.ones((len(places), len(directions)), bool)
    for t, direction in enumerate(directions):
        across = np.cross(direction, v)
        size = (u * across).sum(axis=1)
        size[np.abs(size) < 1e-12] = np.inf
        aside = places[:, None] - corner
        first = (aside * across).sum(axis=2) / size
        over = np.cross(aside, u)
        second, distance = over @ direction / size, (over * v).sum(axis=2) / size
        hit = (first >= 0) & (second >= 0) & (first + second <= 1) & (distance > 1e-6)
        free[:, t] = ~hit.any(axis=1)
    return free


def test_shade_is_as_rays_have_it(tmp_path):
    town = open_street(tmp_path, make_quarter())
    cadastre = Cadastre(town, EnrichSettings())
    buildings = [town.read(k) for k in range(len(town.records))]
    shift = -buildings[0].solid.vertices[0]
    solids = [building.solid.move(shift) for building in buildings]
    triangles = np.concatenate([list_triangles(solid) for solid in solids])
    sky = make_sky(*DELFT, 0.0, 0.0)
    high = np.flatnonzero(sky.sun[:, 2] > math.sin(math.radians(1.0)))[::41]
    differences = []
    for number in (0, 3, 4, 7):
        solid = buildings[number].solid
        vectors = solid.shell.face_areas
        for face in (k for k, f in enumerate(solid.faces) if f.kind == ROOF):
            normal = vectors[face] / np.linalg.norm(vectors[face])
            places = sample_face(solid, face, normal)[::4] + (0, 0, 0.01)
            edges = cadastre.edges.find_shading_edges(number, float(places[:, 2].min()))
            direct = np.maximum(sky.sun[high] @ normal, 0.0) * sky.direct[high]
            facing = direct > 0
            horizon = find_horizon(places, edges)
            own = measure_share(horizon, sky.sector[high], sky.tangent[high])[facing]
            free = cast_rays(triangles, places + shift, sky.sun[high][facing]).mean(axis=0)
            differences.append(direct[facing] @ (own - free) / direct.sum())
    assert len(differences) >= 6
    assert np.abs(differences).max() < 0.01


def test_a_tower_shades_from_the_south_alone(tmp_path):
    house = place_house("a", 0, 0)
    shaded = {}
    for name, y in (("south", -25.0), ("north", 15.0)):
        town = open_street(tmp_path / name, [house, place_house("tower", 0, y, 6, 20, 30.0)])
        shaded[name] = Cadastre(town, EnrichSettings()).describe(0, town.read(0).solid)
    free = open_street(tmp_path / "free", [house])
    alone, surfaces = Cadastre(free, EnrichSettings()).describe(0, free.read(0).solid)
    year, share = "hiproof_roof_sun_kwh", "hiproof_sun_shaded_share"
    assert shaded["south"][0][year] < 0.9 * alone[year] < shaded["north"][0][year] < alone[year]
    assert shaded["south"][1].popitem()[1][share] > 0.15
    assert shaded["north"][1].popitem()[1][share] < 0.03
    (values,) = surfaces.values()
    months = sum(values[f"hiproof_sun_kwh_m2_{m:02}"] for m in range(1, 13))
    assert months == pytest.approx(values["hiproof_sun_kwh_m2"], abs=0.01)
    assert values["hiproof_pv_area_m2"] == pytest.approx(5.4 * 9.4)
    assert values["hiproof_pv_kwh"] == pytest.approx(
        5.4 * 9.4 * 0.16 * values["hiproof_sun_kwh_m2"], rel=1e-4
    )


def test_places_know_true_north():
    for epsg, x, y in ((32632, 250000.0, 5500000.0), (28992, 250000.0, 550000.0)):
        from pyproj import CRS, Proj

        longitude, latitude, north = locate(FileHead(f"EPSG:{epsg}"), x, y)
        factors = Proj(CRS(f"EPSG:{epsg}")).get_factors(longitude, latitude)
        assert abs(north) > 1.0
        assert abs(north) == pytest.approx(abs(factors.meridian_convergence), abs=0.01)
    assert locate(FileHead("EPSG:32632"), 250000.0, 5500000.0)[2] > 0  # west of 9 degrees east


def test_the_files_of_a_run_have_the_sun(tmp_path):
    folder = write_street(tmp_path, [place_house("a", 0, 0), place_house("b", 9, 0, rise=3.0)])
    write_epw(tmp_path / "a.epw")
    command = ["enrich", str(folder), "--sun", "--weather", str(tmp_path / "a.epw"), "--jobs", "1"]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0 and f"sun: weather of {tmp_path / 'a.epw'}" in result.output
    import pyogrio

    for layer, declared in (
        ("buildings", "enriched_sun"),
        ("roof_surfaces", "enriched_sun_surface"),
    ):
        head, _, _, columns = pyogrio.raw.read(folder / "enriched/buildings.gpkg", layer=layer)
        table = dict(zip(head["fields"], columns, strict=True))
        names = {OWN + name for name in TABLES[declared].names} - {"hiproof_wall_sun_kwh"}
        assert names <= set(table)
        assert all((table[name] >= 0).all() for name in names - {"hiproof_sun_sky"})
        assert set(table.get("hiproof_sun_sky", ["a.epw"])) == {"a.epw"}


def test_a_run_without_a_crs_has_no_sun(tmp_path):
    folder = write_street(tmp_path, [place_house("a", 0, 0)], crs=None)
    with pytest.raises(InputError, match="expected a run with a CRS for --sun"):
        enrich_run(folder, settings=EnrichSettings(sun=True))


def test_walls_have_the_sun_that_pvlib_gives_them(tmp_path):
    town = open_street(tmp_path, [place_house("a", 0, 0, rise=2.0)])
    cadastre = Cadastre(town, EnrichSettings(sun=True, sun_on_walls=True))
    solid = town.read(0).solid
    _, normals = measure_faces(solid)
    attributes, surfaces = cadastre.describe(0, solid)
    walls = [face for face, item in enumerate(solid.faces) if item.kind == WALL]
    assert len(walls) == 4 and set(walls) < set(surfaces)
    sky = cadastre.find_sky(0)
    for face in walls:
        free = irradiate(normals[face], np.zeros((1, 3)), NOTHING, sky, 0.2)
        assert surfaces[face]["hiproof_sun_kwh_m2"] == pytest.approx(free.by_month.sum(), rel=1e-6)
        assert "hiproof_pv_kwh" not in surfaces[face]
    total = sum(measure_faces(solid)[0][k] * surfaces[k]["hiproof_sun_kwh_m2"] for k in walls)
    assert attributes["hiproof_wall_sun_kwh"] == pytest.approx(total, rel=1e-4)


def test_party_walls_have_no_sun_and_facing_walls_little(tmp_path):
    houses = [place_house("a", 0, 0), place_house("b", 6, 0), place_house("c", 14, 0, eave=12.0)]
    town = open_street(tmp_path, houses)
    cadastre = Cadastre(town, EnrichSettings(sun=True, sun_on_walls=True))
    result = answer(town, 1, cadastre=cadastre)
    _, normals = measure_faces(result.building.solid)
    east = [k for k, n in enumerate(normals) if n[0] > 0.99]
    west = [k for k, n in enumerate(normals) if n[0] < -0.99]
    assert all(set(result.surfaces[k]) == {"hiproof_party_with"} for k in west)
    # 2 m from a wall that is twice as high
    assert all(result.surfaces[k]["hiproof_sun_shaded_share"] > 0.5 for k in east)


def test_walls_change_nothing_on_roofs(tmp_path):
    town = open_street(tmp_path, make_quarter())
    without = Cadastre(town, EnrichSettings(sun=True)).describe(4, town.read(4).solid)
    walls = Cadastre(town, EnrichSettings(sun=True, sun_on_walls=True))
    attributes, surfaces = walls.describe(4, town.read(4).solid)
    assert {name: attributes[name] for name in without[0]} == without[0]
    assert {face: surfaces[face] for face in without[1]} == without[1]


def test_objects_on_roofs_shade_and_leave_no_room_for_panels(tmp_path):
    box = {"length": 1.0, "width": 1.0, "height": 2.0}
    chimney = {"type": "chimney", "parameters": box, "position": [3.0, 5.0, 6.0], "rotation": 0.0}
    free, house = place_house("a", 0, 0), place_house("a", 0, 0)
    house["installations"] = [chimney]
    values = {}
    for name, record in (("free", free), ("chimney", house)):
        town = open_street(tmp_path / name, [record])
        cadastre = Cadastre(town, EnrichSettings(sun=True))
        (values[name],) = cadastre.describe(0, town.read(0).solid)[1].values()
    lost = values["free"]["hiproof_pv_area_m2"] - values["chimney"]["hiproof_pv_area_m2"]
    assert lost == pytest.approx(1.6 * 1.6, abs=1e-3)
    assert values["free"]["hiproof_sun_shaded_share"] == 0.0
    assert 0.02 < values["chimney"]["hiproof_sun_shaded_share"] < 0.15


@pytest.mark.parametrize("depth, area", [(10.0, 5.4 * 9.4), (1.7, 5.4 * 1.1), (1.5, 0.0)])
def test_panels_need_a_margin_and_their_own_width(depth, area, tmp_path):
    solid = open_street(tmp_path, [place_house("a", 0, 0, depth=depth)]).read(0).solid
    (face,) = (k for k, item in enumerate(solid.faces) if item.kind == ROOF)
    assert measure_panels(solid, face, np.array([0.0, 0.0, 1.0])) == pytest.approx(area, abs=1e-6)


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
