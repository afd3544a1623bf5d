"""Keep names as CONTRIBUTING.md asks: functions are verbs, values are nouns, one name a concept."""

import pytest

from naming import (
    count_locals,
    find_ambiguous_constants,
    find_duplicate_classes,
    find_misnamed_functions,
    list_files,
    list_files_around,
)

MOST_FUNCTION_WORDS = 0.02  # share of local names

PACKAGE_FILES = list_files()
every_group = pytest.mark.parametrize(
    "files", [PACKAGE_FILES, list_files_around()], ids=["package", "around"]
)


@every_group
def test_no_function_is_named_by_a_participle_or_a_function_word(files):
    assert find_misnamed_functions(files) == []


@every_group
def test_few_local_names_are_function_words(files):
    total, words = count_locals(files)
    assert words.total() <= MOST_FUNCTION_WORDS * total, words.most_common(20)


@every_group
def test_no_two_classes_share_a_name(files):
    assert find_duplicate_classes(files) == {}


def test_constants_of_one_name_have_one_value():
    assert find_ambiguous_constants(PACKAGE_FILES) == []
