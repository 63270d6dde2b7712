"""A verdict in one line: findings are called findings, in the terminal as on the viewer's page."""

from judged import Altered, names, verdict

from homofact.cli.verdicts import brief_lines
from homofact.evaluation.wording import findings_named
from homofact.web import page


def test_findings_follow_the_sentence_as_such() -> None:
    tilted = verdict(Altered(lambda values, wi, wo: values * (0.3 + wi[:, :1])))
    shown = [each.name for each in tilted.findings if each.matters]
    assert len(shown) >= 2
    assert set(shown) <= names(tilted)
    told = f"{tilted.summary} (findings: {', '.join(shown)})"
    sound = verdict()
    assert [each for each in sound.findings if each.matters] == []
    assert brief_lines({"a": tilted, "longer": sound}) == [
        f"Verdict on a       {told}", f"Verdict on longer  {sound.summary}",
    ]  # fmt: skip
    assert page._verdict({"verdict": tilted.record()}) == (("Verdict", told),)
    assert page._verdict({"verdict": sound.record()}) == (("Verdict", sound.summary),)
    assert findings_named([]) == ""
