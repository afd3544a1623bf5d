"""The corpus of damaged inputs is made anew, byte by byte the same, wherever and whenever."""

from fuzz.make_corpus import make_corpus


def test_the_same_seed_makes_the_same_corpus(tmp_path):
    first, repeat = make_corpus(tmp_path / "first", 3), make_corpus(tmp_path / "again", 3)
    assert first == repeat and len(first) > 200
    assert all(
        (tmp_path / "first" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()
        for name in first
    )
