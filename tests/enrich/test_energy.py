"""The Energy ADE: valid by its schema, and the same areas as the attributes."""

import pytest
from click.testing import CliRunner
from lxml import etree

from hiproof.cli.app import app
from hiproof.enrich.energy import ENERGY_NAMESPACE
from hiproof.enrich.run import enrich_run
from hiproof.errors import InputError
from hiproof.settings import EnrichSettings
from hiproof.write.citygml.version2 import NAMESPACES
from streets import lose_house, place_house, write_street
from written_run import require_schema

NAMES = {**NAMESPACES, "energy": ENERGY_NAMESPACE}
ID, HREF = f"{{{NAMESPACES['gml']}}}id", f"{{{NAMESPACES['xlink']}}}href"
ADE = EnrichSettings(energy_ade=True)


def make_street():
    """Return three houses in a row, the middle one lower, a garage, and a lost building."""
    row = [place_house(f"h {k}", 6.0 * k, 0.0, eave=6.0 - k % 2, rise=3.0) for k in range(3)]
    return [*row, place_house("garage", 18.0, 0.0, 3.0, 6.0, 2.5), lose_house("lost", 40.0, 0.0)]


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    folder = write_street(tmp_path_factory.mktemp("energy"), make_street())
    result = CliRunner().invoke(app, ["enrich", str(folder), "--energy-ade", "--jobs", "1"])
    assert result.exit_code == 0, result.output
    return etree.parse(folder / "enriched" / "buildings.gml").getroot()


def find(element, path):
    return element.xpath(path, namespaces=NAMES)


def test_valid_by_the_schema_of_the_ade(root):
    require_schema("energy_ade", "CityGML_EnergyADE.xsd").assertValid(root)


def test_areas_of_boundaries_are_those_of_the_attributes(root):
    kinds = {
        "outerWall": "hiproof_outer_wall_area_m2",
        "sharedWall": "hiproof_party_wall_area_m2",
        "groundSlab": "hiproof_ground_area_m2",
        "roof": "b3_opp_dak_schuin",
    }
    buildings = find(root, "//bldg:Building[.//energy:ThermalZone]")
    assert len(buildings) == 4
    for building in buildings[:3]:
        for kind, attribute in kinds.items():
            boundary = f".//energy:ThermalBoundary[energy:thermalBoundaryType='{kind}']"
            areas = [float(text) for text in find(building, f"{boundary}/energy:area/text()")]
            (expected,) = find(building, f"gen:*[@name='{attribute}']/gen:value/text()")
            assert sum(areas) == pytest.approx(float(expected), abs=0.01) and areas


def test_zones_have_a_volume_a_type_and_boundaries_that_exist(root):
    ids = {element.get(ID) for element in root.iter() if element.get(ID)}
    links = {element.get(HREF) for element in root.iter() if element.get(HREF)}
    assert {link[1:] for link in links} <= ids
    zones = {
        zone.getparent().getparent()[0].text: zone for zone in find(root, "//energy:ThermalZone")
    }
    (volume,) = find(zones["h 0"], "energy:volume/energy:VolumeType/energy:value/text()")
    assert float(volume) == pytest.approx(6 * 10 * 7.5)
    assert {name: find(zone, "energy:isHeated/text()") for name, zone in zones.items()} == {
        "h 0": ["true"], "h 1": ["true"], "h 2": ["true"], "garage": ["false"]
    }  # fmt: skip
    assert find(root, "//energy:buildingType/text()") == ["TH", "TH", "TH"]
    # the lost building has none
    assert len(find(root, "//bldg:Building")) == 5


def test_angles_are_those_of_outward_normals(root):
    angles = {}
    for boundary in find(root, "(//energy:ThermalZone)[1]//energy:ThermalBoundary"):
        kind = boundary.findtext("energy:thermalBoundaryType", namespaces=NAMES)
        azimuth = boundary.findtext("energy:azimuth", namespaces=NAMES)
        inclination = boundary.findtext("energy:inclination", namespaces=NAMES)
        angles.setdefault(kind, set()).add((azimuth, float(inclination)))
    assert angles["groundSlab"] == {(None, 180.0)}
    assert {float(azimuth) for azimuth, _ in angles["roof"]} == {0.0, 180.0}
    assert all(slope == pytest.approx(30.964, abs=0.01) for _, slope in angles["roof"])
    assert {(float(azimuth), slope) for azimuth, slope in angles["sharedWall"]} == {(90.0, 90.0)}


def test_without_the_option_nothing_of_the_ade_is_written(tmp_path):
    folder = write_street(tmp_path, make_street())
    enrich_run(folder)
    assert b"energy" not in (folder / "enriched" / "buildings.gml").read_bytes()


def test_the_ade_is_of_citygml_2_alone(tmp_path):
    both = write_street(tmp_path / "both", make_street(), write={"citygml": "both"})
    enrich_run(both, settings=ADE)
    assert b"energy" in (both / "enriched" / "buildings.gml").read_bytes()
    assert b"energy" not in (both / "enriched" / "buildings.citygml3.gml").read_bytes()
    other = write_street(tmp_path / "other", make_street(), write={"citygml": "3.0"})
    with pytest.raises(InputError, match=r"expected a run with CityGML 2.0 for --energy-ade, got"):
        enrich_run(other, settings=ADE)
