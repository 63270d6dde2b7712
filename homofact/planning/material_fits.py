"""The fits of one material: its source, all its fits so far in both storages, and the verdict on a choice."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import torch

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, open_source, with_tilt_looked_at
from homofact.errors import BadInput, Report, Status
from homofact.evaluation.appearance import appearance
from homofact.evaluation.artefacts.look import look_for_artefacts
from homofact.evaluation.metrics import measure
from homofact.evaluation.peak import half_width
from homofact.evaluation.split import Split
from homofact.evaluation.verdict.finding import About
from homofact.evaluation.verdict.judge import judge
from homofact.evaluation.verdict.verdict import Verdict
from homofact.factor.factorization import Factorization, Term
from homofact.factor.fitted import Fitted
from homofact.factor.projection import fixed_projection
from homofact.factor.quantize import rounded
from homofact.methods.common import quantized
from homofact.planning.ladder import (
    LAMBERT,
    SEARCH_SIZES,
    WHOLE,
    Candidate,
    FitOptions,
    fit_candidate,
    ladder,
    method_of,
)
from homofact.planning.theory import Lobes
from homofact.planning.tolerance import Tolerance
from homofact.theory.half_curve import half_angle_curve
from homofact.theory.terms import half_angle_terms

Fitter = Callable[[Candidate, Source, FitOptions], tuple[Fitted, Report]]
# Texels up to which whole numbers are solved for: the effort grows with their cube, 48 s for five textures of 32².
MOST_SOLVED = 1024
_LEAST = Candidate("search", 1, SEARCH_SIZES[0])


def fitted_by_method(candidate: Candidate, source: Source, options: FitOptions) -> tuple[Fitted, Report]:
    """Return the rung fitted to the source's training samples, and the fit's report."""
    fit = fit_candidate(candidate, source, options)
    return fit.factorization, fit.report


@dataclass
class MaterialFits:
    """A material's source, its theory, its fits `made` so far, and the reasons why others were `refused`."""

    text: str
    options: FitOptions
    fitter: Fitter = fitted_by_method
    made: dict[Candidate, tuple[Fitted, Report]] = field(default_factory=dict)
    refused: dict[Candidate, str] = field(default_factory=dict)
    stored: dict[Candidate, Fitted] = field(default_factory=dict)
    judged: dict[Candidate, Verdict] = field(default_factory=dict)

    @cached_property
    def source(self) -> Source:
        """Return the source, opened once; its tilt is found but not corrected. Raises as `open_source`."""
        return with_tilt_looked_at(open_source(self.text, count=self.options.count, seed=self.options.seed))

    @cached_property
    def lobes(self) -> Lobes:
        """The material's lobes by order."""
        return Lobes.of(self.source.reflectance)

    @cached_property
    def own_terms(self) -> int:
        """Return how many in-out terms cover 99% of the BRDF's energy for any light (`terms.half_angle_terms`)."""
        return half_angle_terms(half_angle_curve(self.source.reflectance).l_star())

    @cached_property
    def highlight(self) -> float | None:
        """Half width of the highlight in radians of θh (`evaluation.peak`), None where there is none."""
        return half_width(self.source.reflectance)

    @cached_property
    def rungs(self) -> tuple[Candidate, ...]:
        """The ladder in this material's order."""
        return ladder(len(self.source.samples.channels), self.source.samples.isotropic)

    @cached_property
    def split(self) -> Split:
        """Return the split into training and held-out samples."""
        return Split.of(self.source, self.options.held_out, self.options.seed)

    @cached_property
    def training(self) -> Samples:
        """Return the training samples."""
        return self.split.parts(self.source)[0]

    def fitted(self, candidate: Candidate) -> tuple[Fitted, Report]:
        """Return the rung's fit in its storage, made at the first call. Raises as its method, at each call."""
        if candidate.fit in self.refused:
            raise BadInput(self.refused[candidate.fit])
        if candidate.fit not in self.made:
            self.made[candidate.fit] = self.fitter(candidate.fit, self.source, self.options)
        fit, report = self.made[candidate.fit]
        if candidate.storage != WHOLE:
            return fit, report
        if candidate not in self.stored:
            self.stored[candidate] = self._whole(candidate, fit)
        return self.stored[candidate], report

    def _whole(self, candidate: Candidate, fit: Fitted) -> Fitted:
        if sum(texture.size[0] * texture.size[1] for texture in fit.textures) > MOST_SOLVED:
            return rounded(fit, WHOLE)
        method = method_of(candidate, self.options, self.source.default_epsilon)
        return quantized(fit, self.training, method, WHOLE)

    def verdict(self, candidate: Candidate, colour: Lambert | None = None) -> Verdict:
        """Return the verdict on a rung, made at the first call, or on one `colour`.

        For a colour, the verdict omits findings about the fit, because the plan accepts the errors of one colour within
        the tolerance.
        """
        if colour is not None:
            return self._verdict(candidate, colour).without(About.FIT)
        if candidate not in self.judged:
            self.judged[candidate] = self._verdict(candidate, None)
        return self.judged[candidate]

    def _verdict(self, candidate: Candidate, colour: Lambert | None) -> Verdict:
        method = method_of(candidate if colour is None else _LEAST, self.options, self.source.default_epsilon)
        test = self.split.test_samples(self.source)
        if colour is None:
            fit, report = self.fitted(candidate)
        else:
            fit = as_texture(colour, self.training, self.source.default_epsilon)
            report = Report(Status.DIRECT, 0, 0, 0.0, 0.0, self.options.seed)
        turned = self.training.rotated_at_random(self.options.seed)
        errors = measure(fit, turned, fit.transform), measure(fit, test, fit.transform)
        seen = appearance(fit, self.source)
        look = look_for_artefacts(fit, self.source)
        return judge(fit, report, method, self.training, test, errors, seen, look)


def as_texture(colour: Lambert, training: Samples, epsilon: float) -> Factorization:
    """Return one colour as a product of one constant texture of 2 × 2 texels."""

    transform = LogTransform.of(training, epsilon)
    level = transform.forward(torch.tensor(colour.diffuse, dtype=torch.float64)[None] / torch.pi)[0]
    texture = level.expand(2, 2, -1).clone()
    term = Term(fixed_projection("theta_h-theta_d", True), texture, torch.ones(2, 2, dtype=torch.bool))
    return Factorization((term,), transform, colour.channels, {"source": training.provenance})


def rungs_for(fits: MaterialFits, tolerance: Tolerance) -> tuple[Candidate, ...]:
    """Return the candidate rungs under a tolerance; without limits on light, "lambert-9" is not one."""
    return tuple(candidate for candidate in fits.rungs if tolerance.of_light or candidate.method != LAMBERT)
