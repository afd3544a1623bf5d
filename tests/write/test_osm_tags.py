"""Simple 3D tags against roofs whose angles and heights are known, whichever way they
are turned.
"""

import math

import pytest
import shapely

import hiproof
from handmade import box, make_building, make_lost_building
from hiproof.model import ROOF
from hiproof.model.roof_figures import roof_figures
from hiproof.primitives import CATALOGUE
from hiproof.write.attribute_list import TABLES
from hiproof.write.building_attributes import ONE_ENDED, building_attributes, osm_tags

# The values that OpenStreetMap's page of roof:shape documents for roofs of planes.
DOCUMENTED = {
    *(
        "flat",
        "skillion",
        "gabled",
        "gabled_height_moved",
        "hipped",
        "half-hipped",
        "side_hipped",
        "side_half-hipped",
    ),
    *(
        "pyramidal",
        "mansard",
        "gambrel",
        "sawtooth",
        "cone",
        "dome",
        "onion",
        "round",
        "saltbox",
        "double_saltbox",
        "quadruple_saltbox",
    ),
}
NO_TAGS = dict.fromkeys(TABLES["osm"].names)


def make_tags(building):
    return osm_tags(building, roof_figures(building.solid))


def make_turned_house(degrees, type="gable"):
    """A house of 12 by 8 m whose length lies `degrees` from east."""
    ring = shapely.affinity.rotate(shapely.box(-6, -4, 6, 4), degrees, origin=(0, 0)).exterior
    part = {
        "type": "gable",
        "parameters": {"width": 8, "length": 12, "height": 3},
        "position": [0, 0, 5],
    }
    place = {
        "origin": [85000, 446000, 2],
        "outline": [shapely.get_coordinates(ring).tolist()],
        "z_ground": 2,
    }
    house = hiproof.build({"id": "a", **place, "parts": [{**part, "rotation": degrees}]})
    return house if type == "gable" else house.with_part(0, type=type)


def measure_angle(first, second):
    """The angle between two compass directions."""
    return abs((first - second + 180) % 360 - 180)


def test_every_roof_type_has_a_documented_shape():
    assert {shape.osm_shape for shape in CATALOGUE.values()} == DOCUMENTED


@pytest.mark.parametrize("degrees", [0, 35, 90, 200])
def test_a_gable_is_told_in_degrees_and_metres(degrees):
    tags = make_tags(make_turned_house(degrees))
    assert tags["roof:shape"] == "gabled" and tags["roof:angle"] == pytest.approx(
        math.degrees(math.atan(0.75)), abs=0.01
    )
    assert tags["roof:height"] == pytest.approx(3, abs=0.01) and tags["height"] == pytest.approx(
        8, abs=0.01
    )
    across = 0 - degrees  # the compass direction across a ridge that lies `degrees` from east
    assert (
        min(
            measure_angle(tags["roof:direction"], across),
            measure_angle(tags["roof:direction"], across + 180),
        )
        < 0.01
    )


@pytest.mark.parametrize("name", ONE_ENDED)
@pytest.mark.parametrize("degrees", [0, 35, 200])
def test_a_roof_with_one_hipped_end_looks_that_way(name, degrees):
    house = make_turned_house(degrees, name)
    figures = roof_figures(house.solid)
    roofs = [i for i, face in enumerate(house.solid.faces) if face.kind == ROOF]
    end = min(roofs, key=lambda i: figures.face_area_m2[i])
    assert measure_angle(make_tags(house)["roof:direction"], figures.face_azimuth_deg[end]) < 0.01


def test_a_flat_roof_looks_nowhere():
    tags = make_tags(make_building(box(), kinds=("flat",)))
    assert tags == {
        "roof:shape": "flat",
        "roof:height": 0.0,
        "roof:direction": None,
        "roof:angle": 0.0,
        "height": 3.0,
    }


def test_of_several_parts_the_largest_counts():
    lean_to = {"width": 3, "length": 3, "height": 1}
    house = make_turned_house(0).with_part(1, type="monopitch", position=[-4.5, 2.5, 2], **lean_to)
    assert make_tags(house)["roof:shape"] == "gabled"


def test_without_a_model_there_are_no_tags():
    assert osm_tags(make_lost_building(), None) == NO_TAGS
    assert make_tags(make_building(box(), kinds=("free",)))["roof:shape"] is None


def test_tags_stand_among_the_attributes_only_where_asked_for():
    house = make_building(box(), kinds=("flat",), attributes={"height": "tall", "name": "x"})
    figures = roof_figures(house.solid)
    assert building_attributes(house, figures)["height"] == "tall"
    tagged = building_attributes(house, figures, osm=True)
    assert tagged["height"] == 3.0 and tagged["roof:shape"] == "flat" and tagged["name"] == "x"
