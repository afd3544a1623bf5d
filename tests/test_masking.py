"""Passwords in addresses stay where they were given: no output, warning or log repeats them."""

import json
import warnings

import pytest

import planted
from hiproof.city.run import Request, reconstruct_area
from hiproof.errors import HiproofError, InputError, InputWarning
from hiproof.masking import mask, masked_values
from programs import run_hiproof

ADDRESSES = [
    "postgresql://adm:{}@host:5432/db?table=fp",
    "postgresql://adm@host/db?table=fp&password={}",
    "postgresql://adm@host/db?sslpassword={}&table=fp",
    "PG:host=db user=adm password={} dbname=x",
    "PG:host=db password = '{} with \\' blanks' dbname=x",
    "https://adm:{}@host/tile.laz",
    "https://{}@host/tile.laz",
    "/vsicurl/https://adm:{}@host/dtm.tif",
    "/vsicurl?url=https%3A%2F%2Fadm%3A{}%40host%2Fdtm.tif",
    "s3://key:{}@bucket/tile.laz",
    "https://host/tile.laz?sig={}&v=2",
    "https://host/tile.laz?X-Amz-Signature={}",
    "https://host/tile.laz?access_token={}",
    "MSSQL:server=x;UID=adm;PWD={};database=d",
]


@pytest.mark.parametrize("secret", ["s3cret", "s3%40cret", "s3c,ret", "12s3cret"])
@pytest.mark.parametrize("address", ADDRESSES)
def test_a_secret_is_masked_alone_and_within_a_sentence(address, secret):
    filled = address.format(secret)
    for text in (
        filled,
        f"expected points at {filled}, got: [{filled!r}]; check it",
        json.dumps({"a": filled}, indent=1),
    ):
        hidden = mask(text)
        assert "s3" not in hidden.replace("s3://", "") and "ret" not in hidden.replace("secret", "")
        assert mask(hidden) == hidden
    assert "host" in mask(filled) or "bucket" in mask(filled) or "server" in mask(filled)


@pytest.mark.parametrize("password", ["se/cret", "se?cret", "se@cret", "1/cret", "se#cret"])
def test_a_password_with_unescaped_signs_is_masked_whole(password):
    assert "cret" not in mask(f"postgresql://adm:{password}@host/db")


@pytest.mark.parametrize(
    "address",
    [
        "https://host:8080/tile.laz",
        "postgresql://adm@host:5432/db?table=schema.name&where=mail='a@b'",
        "postgresql://[::1]:5432/db?table=a@b",
        "s3://bucket/a@2/tile.laz",
        "C:/data/tile.laz",
        "expected points, got none; check a@b.org: it knows",
    ],
)
def test_what_holds_no_secret_stays_as_it_is(address):
    assert mask(address) == address


def test_a_long_word_stays_as_it_is():
    """This many letters once took minutes."""
    assert mask("9" * 50_000) == "9" * 50_000


def test_nested_values_are_masked_and_others_kept():
    record = {"a": ["x://u:s3cret@h", 1, None], "b": ({"c": "password=s3cret"}, 2.5, True)}
    assert masked_values(record) == {
        "a": ["x://u:...@h", 1, None],
        "b": [{"c": "password=..."}, 2.5, True],
    }


@pytest.mark.parametrize("kind", [*HiproofError.__subclasses__(), InputWarning])
def test_every_error_masks_its_own_text(kind):
    assert "s3cret" not in str(kind("expected points at https://u:s3cret@host/a.laz, got none"))


def test_a_run_leaves_no_secret_in_any_of_its_files(town_files, tmp_path, monkeypatch, quick_tiles):
    monkeypatch.setattr(
        "hiproof.city.plan.prepare.jobs_from_footprints", planted.read_jobs_from(town_files[1])
    )
    monkeypatch.setattr("hiproof.city.plan.frame.footprint_crs", lambda *_: None)
    broken = "https://adm:s3cret@localhost:1/missing.laz"
    address = "postgresql://adm:s3cret@host/db?table=fp&password=s3cret"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        summary = reconstruct_area(Request((town_files[0], broken), tmp_path, address))
    assert summary.exit_code == 2
    assert "s3cret" not in repr(summary)
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert {"run.json", "ledger.sqlite"} <= {path.name for path in files}
    assert [path.name for path in files if b"s3cret" in path.read_bytes()] == []


def test_an_error_of_our_own_shows_its_traceback_without_secrets(monkeypatch, capsys):
    def fail(*_, **__):
        raise RuntimeError("planted at https://adm:s3cret@host/a.laz")

    monkeypatch.setattr("hiproof.write.attribute_list.attributes_text", fail)
    assert run_hiproof("attributes") == 1
    output = capsys.readouterr().err
    assert "planted" in output and "Traceback" in output and "s3cret" not in output


def test_errors_that_cross_processes_stay_masked():
    import pickle

    error = pickle.loads(pickle.dumps(InputError("https://u:s3cret@host")))
    assert str(error) == "https://u:...@host"
