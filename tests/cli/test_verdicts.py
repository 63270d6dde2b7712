"""A verdict in one line: how far a fit may be off, and what widens that, in the terminal; all findings on the page."""

from dataclasses import replace

import pytest
from judged import TRAIN, Altered, names, seen, verdict
from refusals import refused

from homofact.api.result import RecordedVerdict
from homofact.cli.verdicts import USUAL, brief_lines, strictness, tilt_lines, verdict_line
from homofact.evaluation.wording import findings_named, trust_in_words
from homofact.web import page


def test_findings_follow_the_sentence_as_such() -> None:
    tilted = verdict(Altered(lambda values, wi, wo: values * (0.3 + wi[:, :1])))
    costly = [each.name for each in tilted.findings if each.costs]
    assert len(costly) >= 2
    assert set(costly) <= names(tilted)
    sound = verdict(seen=seen())
    assert brief_lines({"a": tilted, "longer": sound}) == [
        f"Verdict on a: {tilted.summary} (findings: {', '.join(costly)})", f"Verdict on longer: {sound.summary}",
    ]  # fmt: skip
    every = ", ".join(each.name for each in tilted.findings)
    assert page._verdict({"verdict": tilted.record()})[0] == ("Verdict", f"{tilted.summary} (findings: {every})")
    # The second has what was measured.
    said, light = page._verdict({"verdict": sound.record()})
    assert said == ("Verdict", sound.summary)
    assert light[1] == "5°: 1.000 to 1.000"
    assert findings_named([]) == ""
    assert findings_named(["artefact", "light", "artefact"]) == " (findings: artefact, light)"


def test_terminal_record_and_page_say_whether_a_fit_is_trusted_in_the_same_words() -> None:
    sound, bad = verdict(seen=seen()), verdict(seen=replace(seen(), off_sky=0.5))
    for judged, word in ((sound, "trusted"), (bad, "not trusted")):
        assert judged.trusted is (word == "trusted")
        record = judged.record()
        read = RecordedVerdict.of(record)
        assert read is not None
        page_row = page._verdict({"verdict": record})[0][1]
        for said in (judged.summary, record["summary"], read.summary, page_row):
            assert said.startswith(f"{word}; measured against the source: ")
        assert verdict_line(judged).startswith(f"Verdict: {word}; measured")
        # Results of earlier versions lack the word.
        earlier = RecordedVerdict.of(record | {"summary": "off by 3%"})
        assert earlier is not None
        assert earlier.summary == f"{word}; off by 3%"
    assert (trust_in_words(True), trust_in_words(False)) == ("trusted", "not trusted")


@pytest.mark.parametrize(("text", "meant"), [("", False), (USUAL, True), ("0.05", 0.05), ("0", 0.0)])
def test_strict_is_a_word_or_a_probability(text: str, meant: bool | float) -> None:
    found = strictness(text)
    assert (found, type(found)) == (meant, type(meant))
    with refused(where="strict", found="'often'"):
        strictness("often")


def test_a_tilt_that_was_left_in_is_followed_by_the_option_that_undoes_it() -> None:
    tilt = {"left_in": True, "found": "the sample was tilted by +0.1°", "effect": "it can be undone"}
    (line,) = tilt_lines(verdict(train=replace(TRAIN, provenance={"tilt": tilt})))
    assert line.endswith("--calibrate tilt")
    assert tilt_lines(verdict()) == []
