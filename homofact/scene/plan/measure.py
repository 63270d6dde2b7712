"""What a representation is judged by: the Cole error, the light it reflects, the colour it shows; and the theory.

The reflected light is that of two lit spheres (`render.sphere`), seen from two sides: some 1700 pairs of normal and
view, none of them a sample of the fit, each integrated over the same directions of light for source and candidate.
`reflected` is √(Σ |B − B̂|² / Σ |B|²) over pixels, channels and views; `delta_e` the mean CIEDE2000 of the pixels at
the source's exposure. The Cole error knows nothing of the lighting: it weighs all pairs of directions alike.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import Source
from homofact.errors import BadInput
from homofact.evaluate.compare import held_out_samples
from homofact.evaluate.image_metrics import ciede2000
from homofact.evaluate.metrics import measure
from homofact.render.light import DirectionalLight
from homofact.render.sphere import SphereImage, render_sphere
from homofact.render.tonemap import choose_exposure, displayed
from homofact.scene.lighting import Lighting
from homofact.scene.plan.ladder import CONSTANT, Candidate, FitOptions

KINDS = ("cole", "delta_e", "reflected")
PIXELS = 36
DIRECTIONS = 64
VIEWS = ((0.0, 0.0, 1.0), (0.8, 0.3, 0.5))
# The colour of "constant" is fitted to this view and judged by the others.
FIT_VIEW = (-0.5, 0.6, 0.6)


@dataclass(frozen=True)
class Errors:
    """All three errors of one representation under one lighting (no unit; `delta_e` in CIEDE2000 units)."""

    cole: float
    delta_e: float
    reflected: float

    def of(self, kind: str) -> float:
        """The error that a tolerance of this kind speaks of."""
        return float(getattr(self, kind))


@dataclass(frozen=True)
class Judge:
    """Measures representations of one source under one lighting; its own pictures are drawn once."""

    source: Source
    lighting: Lighting
    options: FitOptions

    @cached_property
    def transform(self) -> LogTransform:
        """ε of the source and A of the training samples, as every fit of them has."""
        train = self.source.samples.split(self.options.held_out, self.options.seed)[0]
        return LogTransform.of(train, self.source.default_epsilon)

    def _check_light(self) -> None:
        """Raise BadInput for what the source itself cannot be drawn with."""
        if not any(bool(each.radiance.any()) for each in self._pictures):
            raise BadInput(f"lighting: {self.source.name} reflects none of {self.lighting.name}, expected some light")

    @cached_property
    def _pictures(self) -> tuple[SphereImage, ...]:
        return tuple(self._draw(self.source.reflectance, view) for view in VIEWS)

    @cached_property
    def _exposure(self) -> float:
        return choose_exposure(self._pictures[0])

    def errors(self, reflectance: Reflectance, kinds: tuple[str, ...] = KINDS) -> Errors:
        """The errors of a fitted representation; those not asked for are NaN, infinite where it is not finite."""
        pictures: list[SphereImage] = []
        if "reflected" in kinds or "delta_e" in kinds:
            # The source's come first: what is wrong with the lighting is no fault of the fit.
            self._check_light()
            try:
                pictures = [self._draw(reflectance, view) for view in VIEWS]
            except BadInput:
                return Errors(math.inf, math.inf, math.inf)
        return self._judged(reflectance, pictures, kinds)

    def colour_errors(self, candidate: Candidate, kind: str) -> tuple[Lambert, Errors]:
        """(the one colour that suits tolerances of this kind, its errors as "constant" or "lambert-9")."""
        self._check_light()
        model = self.colour(kind)
        if candidate.method == CONSTANT:
            return model, self.errors(model)
        return model, self._judged(model, [self._draw_cut(model, view) for view in VIEWS], KINDS)

    @cached_property
    def _fit_picture(self) -> SphereImage:
        return self._draw(self.source.reflectance, FIT_VIEW)

    def colour(self, kind: str) -> Lambert:
        """f = c that minimises the error: of logs at the training samples for "cole", else of light on another view."""
        names = self.source.samples.channels
        if kind == "cole":
            train = self.source.samples.split(self.options.held_out, self.options.seed)[0]
            weights = train.weights / train.weights.sum()
            values = self.transform.inverse((self.transform.forward(train.values) * weights[:, None]).sum(0))
        else:
            white = Lambert((1.0,) * len(names), channels=names)
            own, one = self._fit_picture, self._draw(white, FIT_VIEW)
            inside = one.coverage > 0
            e = one.radiance[inside].expand(-1, len(names))
            values = (own.radiance[inside] * e).sum(0) / (e**2).sum(0).clamp_min(1e-300) / math.pi
        return Lambert(tuple(math.pi * float(c) for c in values), channels=names)

    def _judged(self, reflectance: Reflectance, pictures: list[SphereImage], kinds: tuple[str, ...]) -> Errors:
        cole = reflected = delta = math.nan
        if "cole" in kinds:
            held = held_out_samples(self.source, self.options.held_out, self.options.seed)
            cole = measure(reflectance, held, self.transform).log_mse
        if "reflected" in kinds:
            pairs = list(zip(self._pictures, pictures, strict=True))
            lost = sum(_energy(a.radiance - b.radiance, a.coverage) for a, b in pairs)
            reflected = math.sqrt(lost / sum(_energy(a.radiance, a.coverage) for a, _ in pairs))
        if "delta_e" in kinds:
            shown = [
                ciede2000(displayed(a, self._exposure), displayed(b, self._exposure), a.coverage > 0)
                for a, b in zip(self._pictures, pictures, strict=True)
            ]
            delta = sum(shown) / len(shown)
        return Errors(cole, delta, reflected)

    def _draw(self, reflectance: Reflectance, view: tuple[float, float, float]) -> SphereImage:
        return render_sphere(
            reflectance, self.lighting.lights, PIXELS, view=view, samples=DIRECTIONS, seed=self.options.seed
        )

    def _draw_cut(self, model: Lambert, view: tuple[float, float, float]) -> SphereImage:
        """Under the 9 terms alone: what the light above them adds is taken off, exactly, at each pixel's normal."""
        whole = self._draw(model, view)
        n = pixel_normals(view)
        lost = self.lighting.irradiance(n.reshape(-1, 3), None) - self.lighting.irradiance(n.reshape(-1, 3), 2)
        albedo = torch.tensor(model.diffuse, dtype=torch.float64)
        taken = (lost * albedo / math.pi).reshape(*n.shape[:2], -1) * (whole.coverage > 0)[..., None]
        return SphereImage((whole.radiance - taken).clamp_min(0), whole.coverage)


def pixel_normals(view: tuple[float, float, float]) -> Tensor:
    """The unit normals (PIXELS, PIXELS, 3) that a sphere's pixels are shaded with; zero beside it.

    Read off a white sphere: under a light of irradiance π along an axis its radiance is the clamped cosine.
    """
    white = Lambert((1.0,), channels=("Y",))
    axes = torch.eye(3, dtype=torch.float64).tolist()
    parts = []
    for x, y, z in axes:
        lit, back = (
            render_sphere(white, DirectionalLight(direction), PIXELS, view=view).radiance[..., 0]
            for direction in ((x, y, z), (-x, -y, -z))
        )
        parts.append(lit - back)
    return torch.stack(parts, 2)


def _energy(radiance: Tensor, coverage: Tensor) -> float:
    """Σ B² over pixels and channels, each pixel by the part of it that the sphere covers."""
    return float((radiance**2 * coverage[..., None]).sum())
