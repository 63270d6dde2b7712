"""What is proposed after a verdict: more textures for the same bytes, larger ones, each with its bytes."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from judged import TRAIN, Altered, measured, seen, verdict

from homofact.cli.verdicts import advice_lines
from homofact.errors import Advice
from homofact.evaluation.artefacts.artefact import Artefact, Kind
from homofact.evaluation.artefacts.look import Look
from homofact.evaluation.verdict.next_steps import NextStep, next_steps
from homofact.methods.method import Method
from homofact.methods.search import Search

BAD = seen(albedo=0.5)  # the finding is `light`, whose advice is a larger size


def steps(method: Method, kept: int, nbytes: int = 6144, **shown: Any) -> tuple[NextStep, ...]:
    fitted: Any = replace(Altered(), nbytes=nbytes, terms=("term",) * kept)
    return next_steps(verdict(fitted, seen=replace(BAD, **shown), settings=method), fitted, method)  # type: ignore[arg-type]


def test_another_texture_for_the_same_bytes_comes_before_a_larger_size() -> None:
    assert steps(Search(textures=2, size=16, reciprocal=False), kept=2) == (
        NextStep((Advice("textures", 3), Advice("size", 13)), 6084),
        NextStep((Advice("size", 32),), 4 * 6144),
    )


@pytest.mark.parametrize(("most", "kept"), [(2, 1), (3, 3)])
def test_more_textures_are_not_proposed_where_they_are_known_not_to_help_or_nobody_tried(most: int, kept: int) -> None:
    (only,) = steps(Search(textures=most, size=16, reciprocal=False), kept=kept)
    assert only == NextStep((Advice("size", 32),), 4 * 6144)


def test_a_number_of_bytes_is_raised_and_a_trusted_fit_needs_nothing() -> None:
    assert steps(Search(bytes=6144, reciprocal=False), kept=2) == (NextStep((Advice("bytes", 2 * 6144),)),)
    good = verdict(seen=seen())
    assert next_steps(good, Altered(), Search()) == ()  # type: ignore[arg-type]


@pytest.mark.parametrize(("nbytes", "advised"), [(6144, True), (20_000, False)])
def test_more_bytes_are_not_proposed_where_samples_are_fewer_than_texels(nbytes: int, advised: bool) -> None:
    # 3000 samples, and 12 bytes a texel.
    method = Search(bytes=nbytes, reciprocal=False)
    ring = Artefact(Kind.RING, True, "around the highlight", 0.2, 0.01, "lamp")
    found = verdict(train=measured(TRAIN), look=Look((ring,), 0.0), settings=method)
    assert found.figures.reading is not None
    (artefact,) = (each for each in found.findings if each.name == "artefact")
    assert artefact.advice == (Advice("bytes", 2 * nbytes) if advised else None)


def test_the_line_gives_the_options_and_their_bytes() -> None:
    method = Search(textures=2, size=16, reciprocal=False)
    fitted: Any = replace(Altered(), nbytes=6144, terms=("one", "two"))
    row: Any = SimpleNamespace(
        verdict=verdict(fitted, seen=BAD, settings=method), factorization=fitted, settings=method
    )
    assert advice_lines(row) == [
        "Try next: the same command with --textures 3 --size 13 (about 6084 bytes), or with --size 32 (about 24576"
        " bytes); keep the fit with the smaller held-out error"
    ]
