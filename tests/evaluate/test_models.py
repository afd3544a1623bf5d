"""Models read back from CityJSON files."""

import json

import numpy as np
import pytest

from hiproof.errors import InputError
from hiproof.evaluate.models import read_models, run_models
from sample_models import write_sample_run


def test_a_run_comes_back_as_written(tmp_path):
    solids = write_sample_run(tmp_path)
    models = {model.id: model for model in read_models(run_models(tmp_path))}
    assert list(models) == ["house-1", "block 2", "bare"]
    assert [model.roof_type for model in models.values()] == ["gable", "flat", "unknown"]
    assert [model.status for model in models.values()] == ["modelled", "modelled", "no_points"]
    assert models["bare"].solid is None
    for id, solid in solids.items():
        np.testing.assert_allclose(models[id].solid.vertices, solid.vertices, atol=1e-4)
        assert models[id].solid.faces == solid.faces


def test_a_document_with_parts_joins_their_solids(tmp_path):
    cube = {"type": "Solid", "lod": "2.2", "boundaries": [[[[0, 1, 2]], [[0, 2, 3]]]]}
    objects = {
        "a": {"type": "Building", "children": ["a-0", "a-1"], "attributes": {"name": "x"}},
        "a-0": {
            "type": "BuildingPart",
            "parents": ["a"],
            "geometry": [{**cube, "lod": "1.2"}, cube],
        },
        "a-1": {"type": "BuildingPart", "parents": ["a"], "geometry": [cube]},
    }
    document = {"type": "CityJSON", "version": "2.0", "CityObjects": objects}
    document |= {"vertices": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]]}
    path = tmp_path / "part.city.json"
    path.write_text(json.dumps(document))
    (model,) = read_models(path)
    assert (
        len(model.solid.faces) == 4
        and len(model.solid.vertices) == 4
        and model.status == "modelled"
    )


@pytest.mark.parametrize(
    "text",
    ["", "not json", "[]", '{"type": "CityJSON"}', '{"CityObjects": {"a": {}}, "vertices": []}'],
)
def test_what_is_no_cityjson_is_refused_in_a_sentence(tmp_path, text):
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(InputError, match="expected"):
        list(read_models(path))


@pytest.mark.parametrize("part", ["x", None, [], 10**20])
def test_a_part_that_is_no_number_is_refused_in_a_sentence(tmp_path, part):
    write_sample_run(tmp_path)
    path = run_models(tmp_path)
    semantics = json.dumps(
        {"type": "RoofSurface", "hiproof_part": part, "hiproof_part_type": "gable"}
    )
    path.write_text(path.read_text().replace('{"type": "RoofSurface"}', semantics))
    with pytest.raises(
        InputError, match=r"expected building house-1 in line 2 of .* as the number of a part"
    ):
        list(read_models(path))


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="expected a readable text file"):
        list(read_models(tmp_path / "none.json"))
