"""What the library advises, as the command line shows it."""

import pytest

from homofact.cli.flags import option, with_options
from homofact.errors import Advice


@pytest.mark.parametrize(
    ("advice", "words"),
    [
        (Advice("robust", True), "--robust"),
        (Advice("reciprocal", False), "--no-reciprocal"),
        (Advice("smoothing", 1e-3), "--smoothing 0.001"),
        (Advice("joint_terms", 2), "--joint-terms 2"),
        (Advice("channels", "rgb"), "--channels rgb"),
        (Advice("undo", "cosine-o", of="convert"), "homofact convert IN OUT --undo cosine-o"),
    ],
)
def test_every_advice_becomes_an_option(advice: Advice, words: str) -> None:
    assert option(advice) == words
    assert with_options(f"first {advice}, then {advice}; `quit`") == f"first {words}, then {words}; `quit`"


def test_every_function_becomes_a_command() -> None:
    assert with_options("`homofact.edit` takes it") == "homofact edit takes it"
    assert with_options("fit it first: `homofact.fit('a b.csv')`") == (
        "fit it first: homofact factorize a b.csv --out FOLDER"
    )
