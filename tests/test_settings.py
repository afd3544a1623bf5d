"""Laws of the settings: declared once, checked everywhere, the same after a trip through TOML."""

import dataclasses

import pytest

from hiproof.settings import Settings

ALL = [
    (s.name, f)
    for s in dataclasses.fields(Settings)
    for f in dataclasses.fields(getattr(Settings(), s.name))
]


@pytest.mark.parametrize(("section", "declared"), ALL, ids=[f"{s}.{f.name}" for s, f in ALL])
def test_every_setting_has_help_and_a_default_within_its_own_bounds(section, declared):
    assert declared.metadata["help"]
    default = getattr(getattr(Settings(), section), declared.name)
    assert Settings.from_dict({section: {declared.name: default}}) == Settings()


def test_toml_comes_back_the_same(tmp_path):
    changed = Settings.from_dict(
        {"read": {"building_classes": [6, 67]}, "fit": {"objective": "paper"}}
    )
    path = tmp_path / "settings.toml"
    for encoding in ("utf-8", "utf-8-sig"):  # as editors under Windows write it
        path.write_text(changed.to_toml(), encoding=encoding)
        assert Settings.from_toml(path) == changed
    assert Settings.from_dict(changed.to_dict()) == changed


def test_toml_explains_every_setting():
    text = Settings().to_toml()
    for section, declared in ALL:
        assert f"[{section}]" in text
        assert declared.metadata["help"] in text
