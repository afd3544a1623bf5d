"""`--underpasses`: passages below buildings, in every file, built again."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

import hiproof
from gable_at_corner import CORNER, FOOTPRINT, LevelSite, scan_gable
from hiproof.city.plan.passages import add_passages
from hiproof.city.plan.prepare import make_plan
from hiproof.city.plan.work_plan import WorkPlan, make_job
from hiproof.city.run import Request, reconstruct_area
from hiproof.compose import check_solid
from hiproof.errors import InputError, InputWarning
from hiproof.model import CEILING, GROUND, Footprint
from hiproof.parametric.override import overridden, read_override
from hiproof.settings import Settings
from hiproof.write import building_attributes, roof_figures
from hiproof.write.fragments import Sheet
from hiproof.write.head import FileHead
from hiproof.write.meshes.viewed import view_building
from hiproof.write.parameters import building_record
from layers import write_layer
from tiny_town import ORIGIN
from written_run import list_faults

GATE = shapely.box(*(CORNER + [4, -1]), *(CORNER + [7, 9]))
PLAIN = Settings.from_dict({"segment": {"network": "never"}})


def reconstruct(*passages, walls="level", annex=False, id="house"):
    """A gable of 12 by 8 m, with a lower flat half where it has an annex."""
    footprint = Footprint(id, FOOTPRINT, passages=passages)
    settings = PLAIN.replace({"reconstruct": {"walls": walls}})
    return hiproof.reconstruct(scan_gable(annex), footprint, LevelSite(), settings)


def test_a_gate_leads_through_below_a_house():
    whole, house = reconstruct(), reconstruct((GATE, 3.0))
    assert check_solid(house.solid) == ()
    assert house.volume == pytest.approx(whole.volume - 3 * 8 * 3.0, abs=0.01)
    (ceiling,) = house.solid.select_faces(CEILING)
    z = house.solid.vertices[list(ceiling.rings[0]), 2]
    assert z == pytest.approx(2.0) and len(house.solid.select_faces(GROUND)) == 2
    assert house.detail == whole.detail and house.quality == whole.quality


def test_a_building_on_columns_has_no_ground():
    house = reconstruct((FOOTPRINT, 2.5))
    assert check_solid(house.solid) == () and house.solid.select_faces(GROUND) == ()
    assert house.volume == pytest.approx(reconstruct().volume - 12 * 8 * 2.5, abs=0.01)
    assert roof_figures(house.solid).h_base == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("clearance", "reason"), [(5.9, "m below the roof"), (0.2, "at least 0.5 m high")]
)
def test_a_passage_that_is_none_is_left_out_and_the_others_stay(clearance, reason):
    other = shapely.box(*(CORNER + [8, -1]), *(CORNER + [11, 9]))
    house = reconstruct((GATE, clearance), (other, 3.0))
    assert "a passage was left out (" in house.detail and reason in house.detail
    assert len(house.solid.select_faces(CEILING)) == 1
    assert len(building_record(house)["passages"]) == 1


@pytest.mark.parametrize("parts_as", ["one", "buildingparts"])
def test_every_file_is_valid_and_built_again(tmp_path, parts_as):
    houses = [
        reconstruct((GATE, 3.0), id="a"),
        reconstruct((GATE, 2.5), walls="terrain", annex=True, id="b"),
        reconstruct((FOOTPRINT, 2.5), id="c"),
        reconstruct(id="d"),
    ]
    write = {"citygml": "both", "parts_as": parts_as, "lods": ["0", "1.2", "1.3", "2.2"]}
    assert list_faults(tmp_path, houses, write) == []
    texts = (tmp_path / "buildings.city.jsonl").read_text().splitlines()[1:]
    assert ["OuterCeilingSurface" in text for text in texts] == [True, True, True, False]
    records = map(json.loads, (tmp_path / "parameters.jsonl").read_text().splitlines()[1:])
    assert ["passages" in record for record in records] == [True, True, True, False]


def test_viewers_and_tables_get_the_passage():
    house = reconstruct((GATE, 3.0))
    looks = view_building(Sheet(house, None, {}, FileHead())).faces_by_look()
    assert sum(map(len, looks.values())) == len(house.solid.faces)
    assert {look.name for look in looks} == {"roof gable", "WallSurface", "GroundSurface"}
    assert building_attributes(house)["hiproof_passages"] == 1
    assert "hiproof_passages" not in building_attributes(reconstruct())


@pytest.fixture
def town_with_gates(town_files, tmp_path):
    """The tiny town with a passage below its first house, and one beside all houses."""
    gate = shapely.box(*(ORIGIN[:2] + [12, 11]), *(ORIGIN[:2] + [15, 21]))
    beside = shapely.box(*(ORIGIN[:2] - 50), *(ORIGIN[:2] - 45))
    heights = {"height": [2.5, 3.0, -1.0]}
    layer = str(write_layer(tmp_path / "gates.geojson", [gate, beside, gate], heights))
    settings = PLAIN.replace({"read": {"clearance_column": "height"}})
    return Request((town_files[0],), tmp_path / "out", town_files[1], settings=settings), layer


def test_a_layer_of_passages_is_below_the_houses_it_meets(town_with_gates, tmp_path):
    request, layer = town_with_gates
    with pytest.warns(InputWarning, match="1 underpass of .* left out: column height"):
        plan = make_plan(replace(request, underpasses=layer))
    passages = [job.footprint.passages for job in plan.jobs]
    assert [len(below) for below in passages] == [1, 0, 0, 0] and passages[0][0][1] == 2.5
    plan.save(tmp_path / "plan.jsonl")
    assert [
        job.footprint.passages for job in WorkPlan.load(tmp_path / "plan.jsonl").jobs
    ] == passages


@pytest.mark.parametrize(
    ("corners", "found"),
    [([(-50, -50)], "none of"), ([(12, 11), (22, 14), (-50, -50)], "1 of 2 in")],
)
def test_passages_below_no_house_are_named(corners, found, town_with_gates, tmp_path):
    """Those beyond all houses are of other tiles, unless none is below a house."""
    request, _ = town_with_gates
    gates = [shapely.box(*(ORIGIN[:2] + c), *(ORIGIN[:2] + c + 5)) for c in np.array(corners)]
    layer = str(write_layer(tmp_path / "some.geojson", gates, {"height": [3.0] * len(gates)}))
    with pytest.warns(
        InputWarning, match=f"expected underpasses below the footprints, got {found}"
    ):
        make_plan(replace(request, underpasses=layer))


def test_what_is_wrong_with_a_layer_is_one_sentence(town_with_gates):
    request, layer = town_with_gates
    with pytest.raises(InputError, match="expected a column clearance of the underpasses in"):
        make_plan(replace(request, underpasses=layer, settings=PLAIN))
    with pytest.raises(InputError, match="expected --footprints with --underpasses"):
        make_plan(replace(request, underpasses=layer, footprints=None))
    settings = PLAIN.replace({"read": {"raised_column": "height"}})
    with pytest.raises(InputError, match="expected a column height of the footprints"):
        make_plan(replace(request, settings=settings))


def test_a_column_of_the_footprints_raises_buildings():
    footprints = tuple(
        Footprint(str(value), FOOTPRINT, {"height": value}) for value in (2.5, "3", None, 0, "high")
    )
    settings = PLAIN.replace({"read": {"raised_column": "height"}})
    request = Request(("a.laz",), Path("out"), settings=settings)
    passages = [f.passages for f in add_passages(footprints, request, None)]
    assert passages == [((FOOTPRINT, 2.5),), ((FOOTPRINT, 3.0),), (), (), ()]


def test_a_building_of_given_parts_keeps_its_passage_and_its_walls_on_the_terrain():
    house = reconstruct((GATE, 3.0), walls="terrain")
    settings = PLAIN.replace({"reconstruct": {"walls": "terrain"}})
    given = house.footprint, Footprint("house", FOOTPRINT, passages=((GATE, 3.0),))
    override = read_override(building_record(house))
    copies = [overridden(override, np.zeros((0, 3)), f, LevelSite(), settings) for f in given]
    assert [len(copy.model.underside.passages) for copy in copies] == [0, 1]
    assert all(copy.model.underside.terrain for copy in copies)
    assert copies[1].volume == pytest.approx(house.volume)


def test_a_passage_moves_with_its_footprint():
    job = make_job(0, Footprint("a", FOOTPRINT, passages=((GATE, 3.0),)), (0.5, -0.25))
    rng = np.random.default_rng(0)
    xy = rng.uniform((0, 0), (12, 8), (900, 2)) + CORNER + (0.5, -0.25)
    points = np.column_stack([xy, np.full(900, 6.0)])
    house = hiproof.reconstruct(points, job.footprint, LevelSite(), PLAIN)
    (passage,) = house.model.underside.passages
    place = house.roof.frame.to_world(np.array(passage.outline.bounds[:2]))
    assert place == pytest.approx(CORNER + [4.5, -1.25])


def test_a_run_writes_the_passage(town_with_gates):
    request, layer = town_with_gates
    x, y = ORIGIN[:2]
    first = (x + 10, y + 10, x + 15, y + 15)
    with pytest.warns(InputWarning):
        reconstruct_area(replace(request, underpasses=layer, bbox=first))
    (record,) = hiproof.read_parameters(request.out / "parameters.jsonl")
    assert len(record["passages"]) == 1
    text = (request.out / "buildings.city.jsonl").read_text()
    assert text.count("OuterCeilingSurface") == 1


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"ceiling": "high"}, "the ceiling of passage 0"),
        ({"outline": []}, "the outline of passage 0"),
        ({"width": 3}, "got also width"),
    ],
)
def test_what_makes_no_passage_is_one_sentence(change, reason):
    record = building_record(reconstruct((GATE, 3.0)))
    record["passages"][0] |= change
    with pytest.raises(InputError, match=reason):
        hiproof.build(record)
