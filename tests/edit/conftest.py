"""A run to edit, made once; every test that writes gets a copy."""

import shutil

import pytest

import hiproof
from flat_town import make_request


@pytest.fixture(scope="session")
def wrong_run(town_files, tmp_path_factory):
    """The output folder of the run with the wrong types; not to be written."""
    out = tmp_path_factory.mktemp("wrong")
    hiproof.reconstruct_area(make_request(town_files, out))
    return out


@pytest.fixture
def folder(wrong_run, tmp_path):
    """A copy of that folder of the test's own."""
    return shutil.copytree(wrong_run, tmp_path / "run")
