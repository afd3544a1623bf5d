"""Keep names as CONTRIBUTING.md asks: functions are verbs, values are nouns, one name a concept."""

from naming import (
    count_locals,
    find_ambiguous_constants,
    find_duplicate_classes,
    find_misnamed_functions,
    list_files,
)

MOST_FUNCTION_WORDS = 0.02  # share of local names

FILES = list_files()


def test_no_function_is_named_by_a_participle_or_a_function_word():
    assert find_misnamed_functions(FILES) == []


def test_few_local_names_are_function_words():
    total, words = count_locals(FILES)
    assert words.total() <= MOST_FUNCTION_WORDS * total, words.most_common(20)


def test_no_two_classes_share_a_name():
    assert find_duplicate_classes(FILES) == {}


def test_constants_of_one_name_have_one_value():
    assert find_ambiguous_constants(FILES) == []
