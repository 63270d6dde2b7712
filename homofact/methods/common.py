"""The steps that all methods share: ε and A, outliers, azimuth copies, provenance, quantized texels."""

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

    With ε "floor", ε is the noise floor of the samples, but at least the ε of noise-free data.
    """
    epsilon = method.epsilon
    if epsilon == "floor":
        epsilon = max(noise_floor(samples, method.seed) or 0.0, NOISE_FREE_EPSILON)
    return LogTransform.of(samples, NOISE_FREE_EPSILON if epsilon is None else float(epsilon))


def refuse_bounds(samples: Samples, method: Method) -> None:
    """Raise BadInput for clipped samples, which are only bounds, for methods that cannot use bounds."""
    if samples.clipped is not None:
        raise BadInput(
            f"{method.name} takes no values as bounds", where="clipped", expected="search, cole or mccool with it"
        )


def trusted_samples(samples: Samples, method: Method) -> tuple[Samples, float]:
    """Return (samples without outliers, the outliers' share of the weight) if the method is robust.

    Otherwise return (all samples, 0). Call it before A, the flux and the folds are computed, because an outlier in any
    of these affects the whole fit.
    """
    return without_outliers(samples, method.seed) if method.robust else (samples, 0.0)


def provenance_of(samples: Samples, method: Method) -> dict[str, Any]:
    """Return the provenance of a fit: version, method, settings, and the samples as given; JSON-able."""
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
    """Return azimuth copies of isotropic samples if a projection depends on the azimuth, otherwise the samples.

    Samples that already cover all azimuths are returned unchanged.
    """
    if knows_azimuth and samples.isotropic and not samples.all_azimuths and method.copies > 1:
        return samples.azimuth_copies(method.copies, method.seed, method.mirrored)
    return samples


def quantized(fitted: F, samples: Samples, method: Method, storage: str) -> F:
    """Return a fit of `samples` by `method` with texels that `storage` ("png8", "png16") stores exactly.

    Raises BadInput for other values of `storage`.
    """
    if is_solved(fitted):
        samples, _ = trusted_samples(samples, method)
        samples = at_azimuths(samples, method, not evaluation_of(fitted).isotropic)
    return quantize(fitted, samples, storage)


def as_stored(fit: MethodFit, samples: Samples, method: Method) -> MethodFit:
    """Return the fit of `samples` as the method stores it: in a spectral basis and with quantized texels, if set."""
    return with_whole_texels(in_spectral_basis(fit, samples, method), samples, method)


def in_spectral_basis(fit: MethodFit, samples: Samples, method: Method) -> MethodFit:
    """Return the fit of `samples`, in a spectral basis if the method sets `spectral_tolerance`."""
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
    """Return the fit of `samples`, with quantized texels if the method sets `quantize`."""
    if method.quantize == "none":
        return fit
    return replace(fit, factorization=quantized(fit.factorization, samples, method, method.quantize))
