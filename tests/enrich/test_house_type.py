"""House types, storeys, floor areas and ridges of constructed houses."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hiproof.enrich.answer import (
    OTHER_STOREY_M,
    RESIDENTIAL_STOREY_M,
    answer,
    count_storeys,
    measure_floors,
)
from hiproof.enrich.run import enrich_run
from hiproof.errors import InputError, InputWarning
from hiproof.parametric.building import build
from hiproof.settings import EnrichSettings
from hiproof.write.attribute_list import OWN, TABLES
from streets import answer_street, open_street, place_house, write_street

RIGHT_SHARE = 0.97  # of house types on simulated streets


def simulate_street(seed, blocks=24):
    """Return houses along a street, types by id, with garages and rows set back and forth."""
    rng = np.random.default_rng(seed)
    turn, x = float(rng.uniform(0, 90)), 0.0
    houses, types = [], {}
    for block in range(blocks):
        kind = rng.choice(["detached", "semi", "row", "apartments"])
        count = {"detached": 1, "semi": 2, "row": int(rng.integers(3, 9)), "apartments": 1}[kind]
        eave = float(rng.uniform(4.5, 6.5)) if kind != "apartments" else float(rng.uniform(9, 18))
        for k in range(count):
            front = float(rng.uniform(18, 40)) if kind == "apartments" else float(rng.uniform(5, 9))
            y = float(rng.uniform(-2, 2)) if block % 3 == 0 else 0.0
            id = f"{block}-{k}"
            rise = 0.0 if kind == "apartments" else float(rng.uniform(2, 4))
            houses.append(
                place_house(id, x, y, front, eave=eave + 0.2 * k, rise=rise, turn=turn, depth=11.0)
            )
            at_end = k in (0, count - 1)
            types[id] = {
                "detached": "detached",
                "semi": "semi_detached",
                "row": "end_terrace" if at_end else "mid_terrace",
                "apartments": "apartment_block",
            }[kind]
            x += front + float(rng.uniform(0, 0.1))
        if kind == "detached":
            houses.append(place_house(f"{block}-garage", x, 0, 3.5, 6.0, 2.6, turn=turn))
            x += 3.5
        x += float(rng.uniform(2, 6))
    return houses, types


def test_types_of_simulated_streets(tmp_path):
    houses, types = simulate_street(0)
    answers = answer_street(tmp_path, houses)
    named = {id: answers[id].attributes["hiproof_house_type"] for id in answers}
    assert {named[id] for id in named if id.endswith("garage")} <= {None}
    right = sum(named[id] == types[id] for id in types)
    assert len(types) > 40 and right >= RIGHT_SHARE * len(types)


@pytest.mark.parametrize(
    "front, eave, expected", [(6, 5.6, "SFH"), (18, 8.0, "MFH"), (40, 15.0, "AB")]
)
def test_classes_of_tabula(front, eave, expected, tmp_path):
    result = answer_street(tmp_path, [place_house("a", 0, 0, front, 12.0, eave)])["a"]
    assert result.attributes["hiproof_tabula_class"] == expected


def test_storeys_are_an_interval(tmp_path):
    houses = [
        place_house(f"{eave}", 20.0 * k, 0, eave=eave, rise=3.0)
        for k, eave in enumerate((3.0, 5.6, 8.4, 14.0))
    ]
    answers = answer_street(tmp_path, houses)
    storeys = {
        id: (r.attributes["hiproof_storeys_min"], r.attributes["hiproof_storeys_max"])
        for id, r in answers.items()
    }
    assert storeys == {"3.0": (1, 1), "5.6": (2, 2), "8.4": (3, 3), "14.0": (5, 5)}


def test_floor_areas_of_a_block_and_of_an_attic(tmp_path):
    block = place_house("block", 0, 0, eave=6.0)
    gable = place_house("gable", 20, 0, eave=5.0, rise=5.0)
    answers = answer_street(tmp_path, [block, gable])
    floors = {
        id: (
            r.attributes["hiproof_gross_floor_area_min_m2"],
            r.attributes["hiproof_gross_floor_area_max_m2"],
        )
        for id, r in answers.items()
    }
    # floors at 0.6 and 3.9 m, or at 0 and 2.5 m; the next, at 5 m, lacks headroom
    assert floors["block"] == pytest.approx((120, 120))
    # the roof is 1.5 m over a floor at 5 m where it is at 6.5 m: over 7 of 10 m of the depth
    # floors at 0.6, 3.1, 5.6 (its roof at 7.1: 58 %), 8.9 m (none); at 0, 2.5, 5 and 7.5 m
    assert floors["gable"][0] == pytest.approx(60 * (1 + 1 + 0.58))
    assert floors["gable"][1] == pytest.approx(60 * (1 + 1 + 0.7 + 0.2))


@settings(max_examples=30, deadline=None)
@given(
    eave_mm=st.integers(1000, 60000),
    rise=st.sampled_from([0.0, 0.5, 3.0, 8.0]),
    is_home=st.booleans(),
)
def test_storeys_and_floor_areas_are_consistent(eave_mm, rise, is_home):
    eave = eave_mm / 1000
    solid = build(place_house("a", 0, 0, eave=eave, rise=rise)).solid
    low, high = RESIDENTIAL_STOREY_M if is_home else OTHER_STOREY_M
    least, greatest = count_storeys(eave, (low, high))
    smallest, largest = measure_floors(solid, 0.0, eave, (low, high))
    assert 1 <= least <= greatest and (greatest == 1 or greatest * low <= eave + 1e-6)
    if math.ceil((eave - 0.6) / high) <= eave / low:  # storeys fill the height
        assert least * high >= eave - 0.6 - 1e-6
    assert least * 60 - 1e-6 <= smallest <= largest + 1e-6
    if not rise:
        assert (smallest, largest) == pytest.approx((least * 60, greatest * 60))


def test_volume_envelope_and_compactness(tmp_path):
    row = [place_house(f"h{k}", 6.0 * k, 0.0) for k in range(3)]
    answers = answer_street(tmp_path, row)
    for id, party in (("h0", 60), ("h1", 120)):
        values = answers[id].attributes
        assert values["hiproof_heated_volume_m3"] == pytest.approx(360)
        assert values["hiproof_envelope_area_m2"] == pytest.approx(2 * 60 + 32 * 6 - party)
        assert values["hiproof_compactness"] == pytest.approx((312 - party) / 360, abs=1e-4)


@pytest.mark.parametrize("turn", [0.0, 30.0, 90.0, 150.0])
def test_the_ridge_has_a_compass_direction(turn, tmp_path):
    values = answer_street(tmp_path, [place_house("a", 0, 0, 12, rise=3.0, turn=turn)])[
        "a"
    ].attributes
    assert values["hiproof_ridge_direction_deg"] == pytest.approx((90.0 - turn) % 180.0, abs=0.01)


def test_a_flat_roof_has_no_ridge(tmp_path):
    values = answer_street(tmp_path, [place_house("a", 0, 0)])["a"].attributes
    assert values["hiproof_ridge_direction_deg"] is None


def test_a_use_decides_whether_a_building_is_a_house(tmp_path):
    houses = [place_house("a", 0, 0, use="office"), place_house("b", 30, 0, use="Wohnhaus")]
    town = open_street(tmp_path, houses)
    office, home = (answer(town, k, "use").attributes for k in range(2))
    assert office["hiproof_house_type"] is None and office["hiproof_storeys_min"] == 2
    assert home["hiproof_house_type"] == "detached"
    assert answer(town, 0).attributes["hiproof_house_type"] == "detached"


def test_answers_are_as_declared(tmp_path):
    values = answer_street(tmp_path, [place_house("a", 0, 0)])["a"].attributes
    declared = {OWN + name for name in TABLES["enriched"].names} | {*TABLES["enriched_3dbag"].names}
    assert set(values) == declared - {"hiproof_not_enriched"}
    assert json.dumps(values)


def test_a_use_that_no_building_has_is_refused(tmp_path):
    folder = write_street(tmp_path, [place_house("a", 0, 0, use="office"), place_house("b", 9, 0)])
    with pytest.raises(InputError, match=r"of the buildings \(use\) as --use-attribute, got 'uze'"):
        enrich_run(folder, settings=EnrichSettings(use_attribute="uze"))
    with pytest.warns(InputWarning, match="use: expected words such as residential.*, but office"):
        enrich_run(folder, settings=EnrichSettings(use_attribute="use"), processes=1)


def test_uses_of_which_some_are_known_get_no_warning(tmp_path, recwarn):
    houses = [place_house("a", 0, 0, use="31001_2000"), place_house("b", 30, 0, use="Wohnhaus")]
    folder = write_street(tmp_path, houses)
    enrich_run(folder, settings=EnrichSettings(use_attribute="use"), processes=1)
    assert not recwarn.list


@pytest.mark.parametrize("use", ["31001_1010", "31001_1120", "1010", 1000, "Wohnhaus"])
def test_codes_of_dwellings_are_read(use, tmp_path):
    houses = [place_house("a", 0, 0, use=use), place_house("b", 30, 0, use="31001_2020")]
    folder = write_street(tmp_path, houses)
    enrich_run(folder, settings=EnrichSettings(use_attribute="use"), processes=1)
    lines = (folder / "enriched" / "buildings.city.jsonl").read_text().splitlines()[1:]
    houses = {f["id"]: f["CityObjects"][f["id"]]["attributes"] for f in map(json.loads, lines)}
    types = {id: values["hiproof_house_type"] for id, values in houses.items()}
    assert types == {"a": "detached", "b": None}
