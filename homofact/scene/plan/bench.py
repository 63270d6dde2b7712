"""One material at work: its source, every fit made of it so far in either storage, and the verdict on a choice."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import cast

import torch

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput, Report, Status
from homofact.evaluate.appearance import appearance
from homofact.evaluate.metrics import measure
from homofact.evaluate.peak import half_width
from homofact.evaluate.split import Split
from homofact.evaluate.verdict.finding import About
from homofact.evaluate.verdict.judge import judge
from homofact.evaluate.verdict.verdict import Verdict
from homofact.factor.factorization import Factorization, Term
from homofact.factor.fitted import Fitted
from homofact.factor.projection import fixed_projection
from homofact.factor.quantize import rounded
from homofact.methods.fitting import Quantizing, quantized
from homofact.scene.half_curve import half_angle_curve
from homofact.scene.plan.ladder import SEARCH_SIZES, WHOLE, Candidate, FitOptions, fit_candidate, ladder, settings_of
from homofact.scene.plan.theory import Lobes
from homofact.scene.terms import half_angle_terms

Fitter = Callable[[Candidate, Source, FitOptions], tuple[Fitted, Report]]
# Texels up to which whole numbers are solved for: the effort grows with their cube, 48 s for five textures of 32².
MOST_SOLVED = 1024
_LEAST = Candidate("search", 1, SEARCH_SIZES[0])


def fitted_by_method(candidate: Candidate, source: Source, options: FitOptions) -> tuple[Fitted, Report]:
    """The rung fitted to the source's training samples, and the fit's report."""
    found = fit_candidate(candidate, source, options)
    return found.factorization, found.report


@dataclass
class Bench:
    """One material: its source, what theory knows of it, every fit made so far and why others failed."""

    text: str
    options: FitOptions
    fitter: Fitter = fitted_by_method
    fits: dict[Candidate, tuple[Fitted, Report]] = field(default_factory=dict)
    refused: dict[Candidate, str] = field(default_factory=dict)
    stored: dict[Candidate, Fitted] = field(default_factory=dict)

    @cached_property
    def source(self) -> Source:
        """Read or sampled once. Raises BadInput as `open_source` does."""
        return open_source(self.text, count=self.options.count, seed=self.options.seed)

    @cached_property
    def lobes(self) -> Lobes:
        """The material's lobes by order."""
        return Lobes.of(self.source.reflectance)

    @cached_property
    def own_terms(self) -> int:
        """In-out terms that hold 99% of the BRDF itself, whatever light falls on it (`terms.half_angle_terms`)."""
        return half_angle_terms(half_angle_curve(self.source.reflectance).l_star())

    @cached_property
    def highlight(self) -> float | None:
        """Half width of the highlight in radians of θh (`evaluate.peak`), None where there is none."""
        return half_width(self.source.reflectance)

    @cached_property
    def rungs(self) -> tuple[Candidate, ...]:
        """The ladder in this material's order."""
        return ladder(len(self.source.samples.channels), self.source.samples.isotropic)

    @cached_property
    def split(self) -> Split:
        """What is held out."""
        return Split.of(self.source, self.options.held_out, self.options.seed)

    @cached_property
    def training(self) -> Samples:
        """What fits are made of."""
        return self.split.parts(self.source)[0]

    def fitted(self, candidate: Candidate) -> tuple[Fitted, Report]:
        """The rung's fit in its storage, made on first asking. Raises what its method raises, each time."""
        if candidate.fit in self.refused:
            raise BadInput(self.refused[candidate.fit])
        if candidate.fit not in self.fits:
            self.fits[candidate.fit] = self.fitter(candidate.fit, self.source, self.options)
        found, report = self.fits[candidate.fit]
        if candidate.storage != WHOLE:
            return found, report
        if candidate not in self.stored:
            self.stored[candidate] = self._whole(candidate, found)
        return self.stored[candidate], report

    def _whole(self, candidate: Candidate, found: Fitted) -> Fitted:
        if sum(texture.size[0] * texture.size[1] for texture in found.textures) > MOST_SOLVED:
            return rounded(found, WHOLE)
        method = cast("Quantizing", settings_of(candidate, self.source, self.options))
        return quantized(found, self.training, method, WHOLE)

    def verdict(self, candidate: Candidate, colour: Lambert | None = None) -> Verdict:
        """What is found against a rung, or against one `colour`.

        Of a colour only what is odd in the data or unknown: what it lacks it lacks by choice, within the tolerance.
        """
        method = settings_of(candidate if colour is None else _LEAST, self.source, self.options)
        test = self.split.test_samples(self.source)
        if colour is None:
            fit, report = self.fitted(candidate)
        else:
            fit = as_texture(colour, self.training, self.source.default_epsilon)
            report = Report(Status.DIRECT, 0, 0, 0.0, 0.0, self.options.seed)
        turned = self.training.rotated_at_random(self.options.seed)
        errors = measure(fit, turned, fit.transform), measure(fit, test, fit.transform)
        seen = appearance(fit, self.source)
        found = judge(fit, report, method, self.training, test, errors, seen)
        if colour is None:
            return found
        return replace(found, findings=tuple(each for each in found.findings if each.about is not About.FIT))


def as_texture(colour: Lambert, training: Samples, epsilon: float) -> Factorization:
    """One colour as a product of one even texture of 2 × 2 texels."""

    transform = LogTransform.of(training, epsilon)
    level = transform.forward(torch.tensor(colour.diffuse, dtype=torch.float64)[None] / torch.pi)[0]
    texture = level.expand(2, 2, -1).clone()
    term = Term(fixed_projection("theta_h-theta_d", True), texture, torch.ones(2, 2, dtype=torch.bool))
    return Factorization((term,), transform, colour.channels)
