"""Keep names as CONTRIBUTING.md asks: functions are verbs, values are nouns, one name a concept."""

import pytest

from naming import (
    find_ambiguous_constants,
    find_duplicate_classes,
    find_misnamed_functions,
    list_files,
    list_files_around,
)

PACKAGE_FILES = list_files()
every_group = pytest.mark.parametrize(
    "files", [PACKAGE_FILES, list_files_around()], ids=["package", "around"]
)


@every_group
def test_no_function_is_named_by_a_participle_or_a_function_word(files):
    assert find_misnamed_functions(files) == []


@every_group
def test_no_two_classes_share_a_name(files):
    assert find_duplicate_classes(files) == {}


def test_constants_of_one_name_have_one_value():
    assert find_ambiguous_constants(PACKAGE_FILES) == []
