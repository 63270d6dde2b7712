"""Refuse fits by their verdict: `strict` refuses fits with a warning, `refuse` fits with certain findings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.evaluation.verdict.verdict import Verdict


@dataclass(frozen=True)
class Refusal:
    """The rules for refusing fits: a score above a threshold, if `strict`, or a finding in `names`.

    If `threshold` is None, the threshold of the verdict's warning applies.
    """

    strict: bool
    threshold: float | None
    names: tuple[str, ...]

    @classmethod
    def of(cls, strict: bool | float, names: Sequence[str]) -> "Refusal":
        """Return the rules for these options; if `strict` is a number, it is the threshold.

        Raises BadInput if the threshold is not a probability, and for an unknown finding; the message lists all
        findings.
        """
        if not isinstance(strict, bool) and not 0 <= strict <= 1:
            raise BadInput(where="strict", found=f"{strict:g}", expected="a probability from 0 to 1")
        if names:
            from homofact.brdf.quality.suspicion.suspects import NAMES as SUSPECTED
            from homofact.evaluation.verdict.finding import NAMES

            known = tuple(dict.fromkeys((*NAMES, *SUSPECTED)))
            unknown = [name for name in names if name not in known]
            if unknown:
                raise BadInput(where="refuse", found=repr(unknown[0]), expected=f"some of {', '.join(known)}")
        return cls(strict is not False, None if isinstance(strict, bool) else float(strict), tuple(names))

    def first(self, verdicts: "Mapping[str, Verdict | None]") -> BadInput | None:
        """Return the error of the first refused fit, or None if all fits are accepted."""
        for label, verdict in verdicts.items():
            if verdict is not None:
                try:
                    self.check(verdict, label)
                except BadInput as refused:
                    return refused
        return None

    def check(self, verdict: "Verdict", label: str) -> None:
        """Raise BadInput with the reason if the fit is refused."""
        alarm = verdict.alarm
        if self.strict and alarm.above(self.threshold):
            most = alarm.threshold if self.threshold is None else self.threshold
            said = "; ".join(finding.line() for finding in verdict.findings[:2]) or verdict.bars.sentence()
            raise BadInput(
                f"refused because it is {alarm.score:.0%} likely to be bad, expected at most {most:.2%}: {said}",
                where=label,
            )
        refused = [finding for finding in verdict.findings if finding.name in self.names]
        if refused:
            first, *more = refused
            others = f" (further: {', '.join(dict.fromkeys(finding.name for finding in more))})" if more else ""
            raise BadInput(f"refused because of the finding {first.name}: {first.line()}{others}", where=label)
