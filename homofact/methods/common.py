"""The steps that every method takes alike: ε and A, outliers, azimuth copies, provenance, whole numbers as texels."""

from dataclasses import replace
from typing import Any, TypeVar

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.quality.noise_floor import noise_floor
from homofact.brdf.quality.outliers import without_outliers
from homofact.brdf.samples import Samples
from homofact.brdf.source import NOISE_FREE_EPSILON
from homofact.errors import BadInput
from homofact.factor.evaluation import evaluation_of
from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted
from homofact.factor.quantize import is_solved, quantize
from homofact.factor.spectral_fit import SpectralFit
from homofact.methods.cole import Cole
from homofact.methods.fitting import MethodFit
from homofact.methods.method import Method
from homofact.methods.search import Search
from homofact.version import __version__

F = TypeVar("F", bound=Fitted)


def coarse_size(method: Cole | Search) -> int:
    """Return texels per side in a coarse search, never above `size`."""
    return method.size if method.search_size == 0 else min(method.size, method.search_size)


def transform_of(samples: Samples, method: Method) -> LogTransform:
    """Return the log transform of a fit: the method's ε, or the one for noise-free data, and A of `samples`.

    The noise floor is never taken as less than that of noise-free data.
    """
    epsilon = method.epsilon
    if epsilon == "floor":
        epsilon = max(noise_floor(samples, method.seed) or 0.0, NOISE_FREE_EPSILON)
    return LogTransform.of(samples, NOISE_FREE_EPSILON if epsilon is None else float(epsilon))


def refuse_bounds(samples: Samples, method: Method) -> None:
    """Raise BadInput for samples that are bounds (clipped ones), where a method takes values alone."""
    if samples.clipped is not None:
        raise BadInput(
            f"{method.name} takes no values as bounds", where="clipped", expected="search, cole or mccool with it"
        )


def trusted_samples(samples: Samples, method: Method) -> tuple[Samples, float]:
    """Return (the samples without their outliers, the share of the weight that these had) where the method is robust.

    Before A, the flux and the folds are made of them: an outlier in any of these pulls on the whole fit.
    """
    return without_outliers(samples, method.seed) if method.robust else (samples, 0.0)


def provenance_of(samples: Samples, method: Method) -> dict[str, Any]:
    """What a fit says of its making: version, method, settings, and the samples as it was given them; JSON-able."""
    settings = {name: list(value) if isinstance(value, tuple) else value for name, value in vars(method).items()}
    smoothing = settings.get("smoothing")
    return {
        "homofact_version": __version__,
        "method": method.name,
        "seed": method.seed,
        "settings": settings,
        "samples": len(samples),
        "source": samples.provenance,
    } | ({} if smoothing is None else {"smoothing": smoothing})


def at_azimuths(samples: Samples, method: Method, knows_azimuth: bool) -> Samples:
    """What textures are solved from: azimuth copies of isotropic measurements where a projection knows the azimuth.

    Samples that lie at all azimuths already are taken as they are.
    """
    if knows_azimuth and samples.isotropic and not samples.all_azimuths and method.copies > 1:
        return samples.azimuth_copies(method.copies, method.seed, method.mirrored)
    return samples


def quantized(fitted: F, samples: Samples, method: Method, storage: str) -> F:
    """Return a fit of `samples` by `method` with texels that `storage` ("png8", "png16") holds.

    Raises BadInput for others.
    """
    if is_solved(fitted):
        samples, _ = trusted_samples(samples, method)
        samples = at_azimuths(samples, method, not evaluation_of(fitted).isotropic)
    return quantize(fitted, samples, storage)


def as_stored(fit: MethodFit, samples: Samples, method: Method) -> MethodFit:
    """Return the fit of `samples` as the method stores it: in a spectral basis, with whole numbers as texels."""
    return with_whole_texels(in_spectral_basis(fit, samples, method), samples, method)


def in_spectral_basis(fit: MethodFit, samples: Samples, method: Method) -> MethodFit:
    """The fit of `samples` with textures of a few basis vectors where the method's `spectral_tolerance` asks for it."""
    if method.spectral_tolerance is None:
        return fit
    own = fit.factorization
    assert isinstance(own, Factorization), "methods with a spectral tolerance fit products"
    made = SpectralFit.of(own, samples, method.spectral_tolerance, method.seed)
    facts = made.provenance["spectral"]
    left = ", ".join(f"{value:.2f} under {name}" for name, value in facts["delta_e"].items())
    note = f"{facts['rank']} basis vectors store {facts['bands']} bands; mean CIEDE2000 to all bands: {left}"
    details = dict(fit.report.details) | {"spectral": facts}
    return MethodFit(made, replace(fit.report, notes=(*fit.report.notes, note), details=details))


def with_whole_texels(fit: MethodFit, samples: Samples, method: Method) -> MethodFit:
    """Return the fit of `samples`, its texels whole numbers where the method's `quantize` asks for it."""
    if method.quantize == "none":
        return fit
    return replace(fit, factorization=quantized(fit.factorization, samples, method, method.quantize))
