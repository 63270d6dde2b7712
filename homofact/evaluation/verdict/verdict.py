"""The verdict itself: the figures of every check, the findings among them, and what they come to in a sentence."""

from dataclasses import asdict, dataclass
from typing import Any

from homofact.errors import Advice, Status
from homofact.evaluation.artefacts.look import Look
from homofact.evaluation.verdict.finding import About, Finding

CLOSE = 0.03  # of the light: nearer is called right
DIFFUSE = 0.1  # a fit whose light is off by more is not even good for diffuse light


@dataclass(frozen=True)
class SystemFigures:
    """The linear system that was solved; None where none was.

    Attributes
    ----------
    condition : 1-norm condition number of the normal matrix.
    determined : share of texels that samples hold rather than smoothing.
    """

    condition: float | None
    determined: float | None


@dataclass(frozen=True)
class HeldOutFigures:
    """How well the fit meets the samples that were held out of it.

    Attributes
    ----------
    gap : held-out over training log MSE.
    explained : share of the variance of the logs, over the discs, that the fit explains, of its worst channel: of the
        source's at pairs drawn anew where it can be asked, else of the held-out ones.
    misplaced : Σ|f̂ − f| over Σ f of the held-out light.
    cut : share of the held-out light that is cut at zero.
    """

    gap: float
    explained: float
    misplaced: float
    cut: float


@dataclass(frozen=True)
class LightFigures:
    """The light of the fit, beside that of its source where this can be asked.

    Attributes
    ----------
    off : the fit's light over the source's, farthest from 1: of a channel at an angle of incidence where the source can
        be asked everywhere, else of the samples in a band of θi or θh; None where too few samples tell.
    off_where : where that is, in words.
    highlight : the same of the directions that hold the brightest part of the source's light.
    highlight_share : that part, of each incidence where the source can be asked, else of all samples.
    texels_across : half width of the source's highlight in texels of the finest texture; None where there is none.
    albedo : largest ∫ f cosθo dωo of the fit over channels and angles up to 88°.
    step, step_where : its albedo at an angle up to 45° over that at the next, farthest from 1; which.
    source_albedo : that of the source at up to 75°, None where it cannot be asked.
    reciprocity : Σ|f(ωi, ωo) − f(ωo, ωi)| over the sum of both, of the fit's light.
    data_reciprocity : of the source's light, or of samples and their swapped neighbours beyond what neighbours differ
        by anyway; None where too few have one.
    floor : relative RMS of f cosθi cosθo by which the source's own reciprocal part misses it, None where it cannot be
        asked.
    """

    off: float | None
    off_where: str
    highlight: float | None
    highlight_share: float
    texels_across: float | None
    albedo: float
    step: float
    step_where: str
    source_albedo: float | None
    reciprocity: float
    data_reciprocity: float | None
    floor: float | None


@dataclass(frozen=True)
class DataFigures:
    """The samples themselves.

    Attributes
    ----------
    scatter : disagreement of neighbouring training samples in log units, None for too few.
    noise : scatter of the darkest samples over the mean, None likewise.
    outliers : light by which a few samples stand out.
    zeros, dark : share of the samples that are exactly zero in a channel, and of the light that their neighbours
        say is missing there.
    black : share of the light of a white surface that falls where they are zero in all channels.
    gamut : share of the samples that their reader cut at zero in a channel, their colour being outside sRGB.
    clipped : share of the light at samples that share their channel's largest value.
    rounded : share of the light of a channel that rounding to equal steps misses, on average.
    repeated : light by which samples of the same directions differ from each other.
    ring, ring_where : light of a ring of θi or θo over that of its neighbours under the fit, farthest from 1; which.
    """

    scatter: float | None
    noise: float | None
    outliers: float
    zeros: float
    dark: float
    black: float
    gamut: float
    clipped: float
    rounded: float
    repeated: float
    ring: float
    ring_where: str


@dataclass(frozen=True)
class CoverageFigures:
    """What was not measured.

    Attributes
    ----------
    unmeasured : share of the fit's light at pairs of directions that lie beyond the measurement.
    unresolved : share of the brightest part of a measurement's light that stands between samples, as `flux` says.
    rising : exponent at which a measurement still rises towards the mirror direction where its samples end, as `flux`
        says; 0 where the source can be asked.
    """

    unmeasured: float
    unresolved: float
    rising: float


@dataclass(frozen=True)
class Verdict:
    """The figures of every check, and the findings among them, the worst first; `status` is how the fit ended.

    `look` is what pictures of the fit show beside those of its source, None where nothing could be drawn.

    "Of the light" means weighted by the flux f cosθi cosθo that a pair of directions stands for.
    """

    status: Status
    system: SystemFigures
    errors: HeldOutFigures
    light: LightFigures
    data: DataFigures
    coverage: CoverageFigures
    findings: tuple[Finding, ...]
    look: Look | None = None

    @property
    def trusted(self) -> bool:
        """Whether nothing that a picture shows is wrong with the fit itself."""
        return not any(finding.matters for finding in self.about(About.FIT))

    def about(self, whose: About) -> tuple[Finding, ...]:
        """The findings about the fit, the data, or what is unknown."""
        return tuple(finding for finding in self.findings if finding.about is whose)

    @property
    def summary(self) -> str:
        """What the fit is good for, in one sentence."""
        misses = abs(self.light.off - 1) if self.light.off is not None else self.errors.misplaced
        said = []
        shown = () if self.look is None else self.look.artefacts
        # Light that is right as a whole is not called right where a picture shows a ring.
        if misses <= CLOSE and not shown:
            known = "wherever it was measured" if self.coverage.unmeasured > CLOSE else "at every angle"
            said.append(f"its light is right to 3% {known}")
        elif misses <= DIFFUSE:
            said.append(f"good for diffuse light, off by at most {misses:.0%}")
        else:
            where = f" ({self.light.off_where})" if self.light.off is not None else ""
            said.append(f"its light is off by {misses:.0%}{where}")
        if shown:
            said.append(f"visible artefacts: {', '.join(each.kind.value for each in shown)}")
        if self.light.highlight is not None and abs(self.light.highlight - 1) > CLOSE:
            direction = "dark" if self.light.highlight < 1 else "bright"
            share = f"the brightest {self.light.highlight_share:.0%} of its light"
            said.append(f"highlight ({share}) {abs(self.light.highlight - 1):.0%} too {direction}")
        if self.coverage.unmeasured > CLOSE:
            said.append(f"{self.coverage.unmeasured:.0%} of its light is where nothing was measured")
        return "; ".join(said)

    @property
    def recommended(self) -> Advice | None:
        """The setting to try first; None where nothing that matters can be mended by one."""
        return next((finding.advice for finding in self.findings if finding.advice and finding.matters), None)

    def record(self) -> dict[str, Any]:
        """A JSON-able dictionary, the figures of all parts side by side."""
        parts = (self.system, self.errors, self.light, self.data, self.coverage)
        figures = {name: value for part in parts for name, value in asdict(part).items()}
        return figures | {
            "status": self.status.value,
            "trusted": self.trusted,
            "summary": self.summary,
            "recommended": None if self.recommended is None else self.recommended.record(),
            "findings": [finding.record() for finding in self.findings],
            "look": None if self.look is None else self.look.record(),
        }
