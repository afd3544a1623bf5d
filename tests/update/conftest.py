"""A run that several files update."""

import pytest

from tiny_town import make_town
from tiny_updates import run_over


@pytest.fixture(scope="session")
def dense_run(tmp_path_factory):
    """The folder of a run over the tiny town, of 8 points/m2; do not write into it."""
    return run_over(tmp_path_factory.mktemp("dense"), make_town(density=8.0))
