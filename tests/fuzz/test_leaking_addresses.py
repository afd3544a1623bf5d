"""Whatever is wrong with an address, no message, log or file repeats its password."""

import random
import re
from unittest.mock import patch

import pytest

from fuzz.leaking_addresses import PARTS, draw_address, find_leak, find_leaks
from hiproof import masking
from hiproof.cli import addresses_in
from hiproof.masking import mask, remember

COUNT = 10  # addresses tried as inputs of commands


@pytest.mark.filterwarnings("ignore")
def test_no_command_repeats_a_password(tmp_path):
    assert list(find_leaks(tmp_path, COUNT, selection=1)) == []


@pytest.mark.parametrize(
    "address",
    [
        "https://S3cr3t pAss@127.0.0.1:1/a.laz",
        "adm:S3cr3t pAss@127.0.0.1:1/t",
        "http:/adm:S3cr3t pAss@127.0.0.1:1/a.laz@",
        "postgresql://127.0.0.1:1/t?user=adm&password=S3cr3t pAss&table=fp",
        "host=127.0.0.1 password='S3cr3t'pAss' user=adm",
        "https://S3cr3t:pAss@127.0.0.1:1/a.laz@",
        "adm:S3cr3t:pAss@127.0.0.1:1/t",
        "host=127.0.0.1 password = S3cr3t pAss",
    ],
)
def test_a_password_that_the_shell_cuts_into_pieces_is_hidden(address):
    secrets = masking.Secrets()
    with patch.object(masking, "SECRETS", secrets):
        remember(*addresses_in(["load", "run", *address.split(" ")]))
        for piece in address.split(" "):
            shown = mask(f"Got unexpected extra argument(s) ({piece})")
            assert "S3cr3t" not in shown
            assert "pAss" not in shown


def test_pieces_that_a_library_may_quote_are_hidden():
    for number in range(200):
        message = draw_address(random.Random(number))
        remember(message)
        for text in (message, repr(message), *re.split(r"[@:/?#&= '\"]", message)):
            assert find_leak(mask(f"got: {text!r}; check it")) == "", message


def test_sentences_keep_their_words():
    remember(
        "postgresql://postgres:postgres@localhost/db",
        "postgresql://me:a@h/db",
        "host=h password=12",
    )
    sentence = "expected a PostGIS database at postgresql://, got 12 buildings; pass a table"
    assert mask(sentence) == sentence
    assert mask("user postgres") == "user ..."


@pytest.mark.parametrize("name", ["year = 5 and owner = 7", "a.laz", "EPSG:28992", "models/12@5"])
def test_what_is_no_address_has_no_secret(name):
    remember(name)
    assert mask(f"got {name} of 5 and 7") == f"got {name} of 5 and 7"


def test_the_name_of_a_file_that_is_there_is_no_secret(tmp_path):
    path = tmp_path / "a:b@c.laz"
    path.touch()
    remember(str(path))
    assert mask(f"{path} b") == f"{path} b"
    assert PARTS[0] in mask(PARTS[0])
