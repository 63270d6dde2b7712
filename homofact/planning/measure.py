"""The errors of a representation: the Cole error on held-out samples, and errors of its reflected light.

The light is that of lit spheres (`plan.stage`): some thousand pairs of normal and view, none of them a sample of the
fit, the same for source and candidate. All kinds of error are `plan.tolerance`'s. One exposure takes the 99th
percentile of the source's pixels, over all views, to .9.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import made_of_samples
from homofact.brdf.source import Source
from homofact.errors import BadInput
from homofact.evaluation.compare import held_out_samples
from homofact.evaluation.fixed_pictures import study_difference, study_picture
from homofact.evaluation.image_metrics import ciede2000_of_pixels
from homofact.evaluation.metrics import measure
from homofact.planning.ladder import CONSTANT, Candidate, FitOptions
from homofact.planning.stage import Stage
from homofact.planning.tolerance import KINDS, SEEN, UNLIT, Errors
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import PERCENTILE, TARGET, displayed
from homofact.scene.lighting import Lighting

_P95 = 0.95


@dataclass(frozen=True)
class Picture:
    """One view: radiance (P, C) of pixels or nodes, and the share of each in the sphere's disc, (P,)."""

    radiance: Tensor
    weights: Tensor


@dataclass(frozen=True)
class RepresentationEvaluator:
    """Measures representations of one source on one stage; its own pictures are drawn once.

    `pixels` is the diameter of the sphere in pixels, None for a close camera (`plan.stage`).
    """

    source: Source
    stage: Stage
    options: FitOptions
    pixels: int | None = None

    @property
    def lighting(self) -> Lighting:
        """Return the lighting of the stage."""
        return self.stage.lighting

    @cached_property
    def transform(self) -> LogTransform:
        """Return the log transform with ε of the source and A of the training samples, as in every fit."""
        return LogTransform.of(self._train, self.source.default_epsilon)

    @property
    def _train(self) -> Samples:
        return self.source.samples.split(self.options.held_out, self.options.seed)[0]

    @cached_property
    def _drawn(self) -> list[Tensor]:
        """Return the source's radiance at the nodes. Raises BadInput if the source reflects none of the light."""
        drawn = self.stage.draw(self.source.reflectance)
        if not any(bool(radiance.any()) for radiance in drawn):
            what = f"{self.source.name} reflects none of {self.lighting.name}"
            raise BadInput(what, where="lighting", expected="some light")
        return drawn

    @cached_property
    def _pictures(self) -> list[Picture]:
        return self._seen(self._drawn)

    @cached_property
    def _exposure(self) -> float:
        return exposure(self._pictures)

    def errors(self, reflectance: Reflectance, kinds: tuple[str, ...] = KINDS) -> Errors:
        """Return the errors of a fitted representation: NaN if not in `kinds`, infinite if it is not finite."""
        drawn: list[Tensor] = []
        if not set(kinds) <= set(UNLIT):
            # The source's come first: what is wrong with the lighting is no fault of the fit.
            _ = self._drawn
            try:
                drawn = self._drawn_once(reflectance)
            except BadInput:
                return Errors(*(math.inf,) * len(KINDS))
        return self._judged(reflectance, drawn, kinds)

    def colour_errors(self, candidate: Candidate, model: Lambert, kinds: tuple[str, ...] = KINDS) -> Errors:
        """Return the errors of one colour as "constant" or "lambert-9"."""
        drawn: list[Tensor] = []
        if not set(kinds) <= set(UNLIT):
            albedo = torch.tensor(model.diffuse, dtype=torch.float64)
            drawn = [radiance * albedo for radiance in self.stage.white(model.channels)]
            drawn = drawn if candidate.method == CONSTANT else self.cut(model, drawn)
        return self._judged(model, drawn, kinds)

    @cached_property
    def to_white(self) -> tuple[Tensor, Tensor]:
        """Return Σ B E/Σ B² and Σ E²/Σ B² (C,) over nodes, for light B of the source and E of a white sphere."""
        names = self.source.samples.channels
        white = self.stage.white(names)
        met = there = torch.zeros(len(names), dtype=torch.float64)
        whole = 0.0
        for own, one, view in zip(self._drawn, white, self.stage.views, strict=True):
            sums = [(view.weights[:, None] * product).sum(0) for product in (own * one, one * one)]
            # A grey material may be in coloured light.
            met, there = (a + (b if len(b) == len(names) else b.sum()) for a, b in zip((met, there), sums, strict=True))
            whole += _energy(own, view.weights)
        return met / whole, there / whole

    @cached_property
    def of_logs(self) -> Tensor:
        """Return f (C,) whose log transform is the weighted mean of that of the training samples."""
        train = self._train
        weights = train.weights / train.weights.sum()
        return self.transform.inverse((self.transform.forward(train.values) * weights[:, None]).sum(0))

    def _drawn_once(self, reflectance: Reflectance) -> list[Tensor]:
        """Draw on the stage and cache the result: the search and the record measure the same fit."""
        # By identity, and held, so that no other fit comes to have it.
        known = self._fits_drawn
        if id(reflectance) not in known:
            known[id(reflectance)] = reflectance, self.stage.draw(reflectance)
        return known[id(reflectance)][1]

    @cached_property
    def _fits_drawn(self) -> dict[int, tuple[Reflectance, list[Tensor]]]:
        return {}

    def _judged(self, reflectance: Reflectance, drawn: list[Tensor], kinds: tuple[str, ...]) -> Errors:
        errors: dict[str, float] = {}
        if "cole" in kinds:
            held = held_out_samples(self.source, self.options.held_out, self.options.seed)
            errors["cole"] = measure(reflectance, held, self.transform).log_mse
        if "delta_e_study" in kinds and self._study is not None:
            errors["delta_e_study"] = self._under_study(reflectance, self._study)
        if not set(kinds) <= set(UNLIT):
            errors |= picture_errors(self._pictures, self._seen(drawn), self._exposure, kinds)
        return Errors(**errors)

    @cached_property
    def _study(self) -> SphereImage | None:
        """Return the source's picture under the study's light; None if the source consists of samples."""
        return None if made_of_samples(self.source.reflectance) else study_picture(self.source.reflectance)

    def _under_study(self, reflectance: Reflectance, own: SphereImage) -> float:
        """Return the mean CIEDE2000 under the study's light; infinite if the fit is not finite."""
        drawn = study_picture(reflectance)
        return study_difference(own, drawn) if bool(drawn.radiance.isfinite().all()) else math.inf

    def _seen(self, drawn: list[Tensor]) -> list[Picture]:
        return [
            Picture(*view.blurred(radiance, self.pixels))
            for view, radiance in zip(self.stage.views, drawn, strict=True)
        ]

    def cut(self, model: Lambert, drawn: list[Tensor]) -> list[Tensor]:
        """Return the radiance of one colour under the 9 terms: subtract light of higher orders at each node."""
        albedo = torch.tensor(model.diffuse, dtype=torch.float64)
        above = zip(self.stage.above_nine_terms, drawn, strict=True)
        return [(radiance - lost * albedo / math.pi).clamp_min(0) for lost, radiance in above]


def best_colour(judges: Sequence[RepresentationEvaluator], of_light: bool) -> Lambert:
    """Return the colour with the least error: of the light, relative per lighting, if `of_light`, else of logs.

    The logarithms are those of the training samples. `judges` are the evaluators of one source, one per lighting.
    """
    if of_light:
        met, there = (torch.stack(sums).sum(0) for sums in zip(*(judge.to_white for judge in judges), strict=True))
        values = met / there.clamp_min(1e-300) / math.pi
    else:
        values = judges[0].of_logs
    return Lambert(tuple(math.pi * float(c) for c in values), channels=judges[0].source.samples.channels)


def picture_errors(
    own: list[Picture], other: list[Picture], exposed: float, kinds: tuple[str, ...]
) -> dict[str, float]:
    """Return the errors of light, by kind, of the pictures `other` against the source's `own`, for `kinds`."""
    errors: dict[str, float] = {}
    pairs = list(zip(own, other, strict=True))
    if "reflected" in kinds:
        lit = [(a, b) for a, b in pairs if bool(a.radiance.any())]
        lost = [_energy(a.radiance - b.radiance, a.weights) / _energy(a.radiance, a.weights) for a, b in lit]
        errors["reflected"] = math.sqrt(sum(lost) / len(lost))
    if set(kinds) & set(SEEN):
        views = []
        for a, b in pairs:
            every = torch.ones(1, len(a.weights), dtype=torch.bool)
            one, two = (displayed(SphereImage(each.radiance[None], every.float()), exposed) for each in (a, b))
            apart = torch.from_numpy(ciede2000_of_pixels(one, two, every))
            views.append((float((apart * a.weights).sum()), quantile(apart, a.weights, _P95), float(apart.max())))
        worst = map(max, zip(*views, strict=True))
        errors |= {kind: value for kind, value in zip(SEEN, worst, strict=True) if kind in kinds}
    return errors


def exposure(pictures: list[Picture]) -> float:
    """Return the factor that takes the 99th percentile of the pixels' largest channel, over all pictures, to .9."""
    brightest = torch.cat([picture.radiance.max(1).values for picture in pictures])
    level = quantile(brightest, torch.cat([picture.weights for picture in pictures]), PERCENTILE / 100)
    return TARGET / (level if level > 0 else float(brightest.max()))


def quantile(values: Tensor, weights: Tensor, part: float) -> float:
    """Return the weighted quantile `part` of `values` (N,) with `weights` (N,)."""
    order = values.argsort()
    running = weights[order].cumsum(0)
    place = int(torch.searchsorted(running, part * running[-1]))
    return float(values[order[min(place, len(order) - 1)]])


def _energy(radiance: Tensor, weights: Tensor) -> float:
    """Return Σ B² over pixels and channels, each pixel weighted by its share."""
    return float((radiance**2 * weights[:, None]).sum())
