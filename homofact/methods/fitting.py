"""What all methods share: the protocol, the progress and the result of a fit, and what every fit does alike."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeVar, cast

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.noise_floor import noise_floor
from homofact.brdf.outliers import without_outliers
from homofact.brdf.reflectance import Directions
from homofact.brdf.samples import Samples
from homofact.brdf.source import NOISE_FREE_EPSILON
from homofact.errors import BadInput, Report
from homofact.factor.fitted import Fitted
from homofact.factor.quantize import is_solved, quantize
from homofact.version import __version__

F = TypeVar("F", bound=Fitted)


@dataclass(frozen=True)
class Progress:
    """Where a running fit is: counted from 1, `best` the lowest error of this term so far."""

    term: int
    terms: int
    restart: int
    restarts: int
    evaluations: int
    best: float


ProgressCallback = Callable[[Progress], None]


class Judgement(Protocol):
    """What is found against a fit: `homofact.evaluate.verdict.verdict.Verdict`."""

    @property
    def trusted(self) -> bool:
        """Whether nothing that a picture shows is wrong with it."""
        ...

    @property
    def findings(self) -> Sequence[Any]:
        """What was, the worst first."""
        ...

    @property
    def summary(self) -> str:
        """In a line."""
        ...


@dataclass(frozen=True)
class Fit:
    """What was fitted, the report of how it was reached, and, where it was judged, the `verdict`.

    It is asked and saved like its `factorization`, a `Factorization` or a sum of products.
    """

    factorization: Fitted
    report: Report
    verdict: Judgement | None = None

    def __repr__(self) -> str:
        """In a line or two: what was fitted, how the search ended, and the verdict."""
        judged = "" if self.verdict is None else f": {self.verdict.summary}"
        return f"<Fit of {self.factorization}, {self.report.status.value}{judged}>"

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels."""
        return self.factorization.channels

    @property
    def nbytes(self) -> int:
        """Bytes of all texels as float32."""
        return self.factorization.nbytes

    @property
    def fetches(self) -> int:
        """Texture lookups of one evaluation."""
        return self.factorization.fetches

    def evaluate(self, wi: Directions, wo: Directions) -> Any:
        """BRDF values (N, C) in sr⁻¹ without the cosine, for (N, 3) directions; see `answering_in_kind`."""
        fitted: Any = self.factorization
        return fitted.evaluate(wi, wo)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the one .npz file that `homofact.load` reads back. Raises BadInput for an unwritable place."""
        self.factorization.save(path)


class Method(Protocol):
    """A way to fit: a frozen dataclass of the settings that it uses, with a name for the command line."""

    __dataclass_fields__: ClassVar[dict[str, Any]]
    name: ClassVar[str]

    @property
    def size(self) -> int:
        """Texels per side of a texture."""
        ...

    @property
    def epsilon(self) -> float | str | None:
        """ε of the log transform; None takes the source's, or that of noise-free data, "floor" the noise floor."""
        ...

    @property
    def reciprocal(self) -> bool | None:
        """Whether f(ωi, ωo) = f(ωo, ωi) is enforced; None where the data decide."""
        ...

    @property
    def seed(self) -> int:
        """Of every random choice."""
        ...

    def fit(self, samples: Samples, progress: ProgressCallback | None = None) -> Fit:
        """Fit the training samples as measured: what they need of azimuth copies the method makes itself.

        Raises BadInput where they cannot be fitted.
        """
        ...


class Quantizing(Method, Protocol):
    """A method whose texels may be whole numbers."""

    @property
    def quantize(self) -> str:
        """Which whole numbers texels are to be: "none", "png8" or "png16"."""
        ...


class Copying(Quantizing, Protocol):
    """A method that turns isotropic measurements to other azimuths."""

    @property
    def copies(self) -> int:
        """How many azimuths."""
        ...

    @property
    def mirrored(self) -> bool:
        """Whether mirrored copies stand beside them."""
        ...


class Robust(Method, Protocol):
    """A method that can leave gross errors out."""

    @property
    def robust(self) -> bool:
        """Whether it does."""
        ...


class Coarse(Method, Protocol):
    """A method that searches on smaller textures."""

    @property
    def search_size(self) -> int:
        """Texels per side there; 0 is the full size."""
        ...


def coarse_size(method: Coarse) -> int:
    """Texels per side in a coarse search, never above `size`."""
    return method.size if method.search_size == 0 else min(method.size, method.search_size)


def transform_of(samples: Samples, method: Method) -> LogTransform:
    """The log transform of a fit: the method's ε, or the one for noise-free data, and A of `samples`.

    The noise floor is never taken as less than that of noise-free data.
    """
    epsilon = method.epsilon
    if epsilon == "floor":
        epsilon = max(noise_floor(samples, method.seed) or 0.0, NOISE_FREE_EPSILON)
    return LogTransform.of(samples, NOISE_FREE_EPSILON if epsilon is None else float(epsilon))


def refuse_bounds(samples: Samples, method: Method) -> None:
    """Raise BadInput for samples that are bounds (clipped ones), where a method takes values alone."""
    if samples.clipped is not None:
        raise BadInput(f"clipped: {method.name} takes no values as bounds, expected search, cole or mccool with it")


def trusted_samples(samples: Samples, method: Robust) -> tuple[Samples, float]:
    """(the samples without their outliers, the share of the weight that these had) where the method is robust.

    Before A, the flux and the folds are made of them: an outlier in any of these pulls on the whole fit.
    """
    return without_outliers(samples, method.seed) if method.robust else (samples, 0.0)


def provenance_of(samples: Samples, method: Method) -> dict[str, Any]:
    """What a fit says of its making: version, method, settings, and the samples as it was given them; JSON-able."""
    smoothing = getattr(method, "smoothing", None)
    return {
        "homofact_version": __version__,
        "method": method.name,
        "seed": method.seed,
        "settings": {k: list(v) if isinstance(v, tuple) else v for k, v in vars(method).items()},
        "samples": len(samples),
        "source": samples.provenance,
    } | ({} if smoothing is None else {"smoothing": smoothing})


def at_azimuths(samples: Samples, method: Copying, knows_azimuth: bool) -> Samples:
    """What textures are solved from: azimuth copies of isotropic measurements where a projection knows the azimuth.

    Samples that lie at all azimuths already are taken as they are.
    """
    if knows_azimuth and samples.isotropic and not samples.all_azimuths and method.copies > 1:
        return samples.azimuth_copies(method.copies, method.seed, method.mirrored)
    return samples


def quantized(fitted: F, samples: Samples, method: Quantizing, storage: str) -> F:
    """A fit of `samples` by `method` with texels that `storage` ("png8", "png16") holds. Raises BadInput for others."""
    if is_solved(fitted):
        if getattr(method, "robust", False):
            samples, _ = without_outliers(samples, method.seed)
        samples = at_azimuths(samples, cast("Copying", method), not fitted.evaluation.isotropic)
    return quantize(fitted, samples, storage)


def with_whole_texels(fit: Fit, samples: Samples, method: Quantizing) -> Fit:
    """The fit of `samples`, its texels whole numbers where the method's `quantize` asks for it."""
    if method.quantize == "none":
        return fit
    return replace(fit, factorization=quantized(fit.factorization, samples, method, method.quantize))
