"""A verdict in one line: how far a fit may be off, and what widens that, in the terminal; all findings on the page."""

import pytest
from judged import Altered, names, seen, verdict
from refusals import refused

from homofact.cli.verdicts import USUAL, brief_lines, strictness
from homofact.evaluation.wording import findings_named
from homofact.web import page


def test_findings_follow_the_sentence_as_such() -> None:
    tilted = verdict(Altered(lambda values, wi, wo: values * (0.3 + wi[:, :1])))
    costly = [each.name for each in tilted.findings if each.costs]
    assert len(costly) >= 2
    assert set(costly) <= names(tilted)
    sound = verdict(seen=seen())
    assert brief_lines({"a": tilted, "longer": sound}) == [
        f"Verdict on a:      {tilted.summary} (findings: {', '.join(costly)})", f"Verdict on longer: {sound.summary}",
    ]  # fmt: skip
    every = ", ".join(each.name for each in tilted.findings)
    assert page._verdict({"verdict": tilted.record()}) == (("Verdict", f"{tilted.summary} (findings: {every})"),)
    # No bar is stated by angle for the first; the second has what was measured.
    said, light = page._verdict({"verdict": sound.record()})
    assert said == ("Verdict", sound.summary)
    assert light[1] == "5°: 1 to 1"
    assert findings_named([]) == ""
    assert findings_named(["artefact", "light", "artefact"]) == " (findings: artefact, light)"


@pytest.mark.parametrize(("text", "meant"), [("", False), (USUAL, True), ("0.05", 0.05), ("0", 0.0)])
def test_strict_is_a_word_or_a_probability(text: str, meant: bool | float) -> None:
    found = strictness(text)
    assert (found, type(found)) == (meant, type(meant))
    with refused(where="strict", found="'often'"):
        strictness("often")
