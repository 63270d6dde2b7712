"""Choose the spectral basis of a fit by its colour error.

The best vectors depend on the error measure, which is colour here. Let J (3, W) be the derivatives of L*a*b* under an
illuminant by f̃. A small error δ of f̃ changes the colour by |Jδ|. The metric is M = Σ JᵀJ over illuminants and
directions, plus `RIDGE` times its mean diagonal, so that no band has zero weight. The vectors are the principal
components of f̃ in this metric: of all bases of rank R, they minimise E[(f̃ − f̂)ᵀ M (f̃ − f̂)] (Eckart and Young 1936
on M^½ f̃). The rank is the smallest whose mean CIEDE2000 is at most a tolerance under every illuminant.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from homofact.brdf.cielab import ciede2000
from homofact.brdf.colour_difference import ILLUMINANTS, lab_of, lab_slopes
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.source_names import MOST
from homofact.brdf.wavelengths import colour_wavelengths
from homofact.factor.spectral_basis import SpectralBasis

RIDGE = 1e-3


def whole_basis(
    logs: np.ndarray, weights: np.ndarray, transform: LogTransform, wavelengths: Sequence[float]
) -> SpectralBasis:
    """Return the basis of all W vectors for logarithms (N, W) with weights (N,); `transform` made the logarithms.

    The vectors are sorted by how much they lower the colour error. Raises the BadInput of `spectral.to_rgb`.
    """
    bands = colour_wavelengths(wavelengths)
    share = weights / weights.sum()
    metric = _colour_metric(logs, share, transform, bands)
    values, axes = np.linalg.eigh(metric)
    root, inverse = (axes * np.sqrt(values)) @ axes.T, (axes / np.sqrt(values)) @ axes.T
    off = logs - share @ logs
    # Of W × W numbers: the samples may be many.
    _, components = np.linalg.eigh(root @ ((off * share[:, None]).T @ off) @ root)
    components = components[:, ::-1]
    # Either sign will do; LAPACKs differ.
    components = components * np.where(inverse.sum(0) @ components < 0, -1.0, 1.0)
    return SpectralBasis(components.T @ inverse, np.zeros(len(bands)), root @ components)


def _colour_metric(
    logs: np.ndarray, share: np.ndarray, transform: LogTransform, bands: tuple[float, ...]
) -> np.ndarray:
    """Return the metric M (W, W) that the module's docstring defines."""
    metric = np.zeros((len(bands), len(bands)))
    values = _values(transform, logs)
    # df = (f + εA) df̃.
    lifted = values + transform.epsilon * transform.mean
    for illuminant in ILLUMINANTS:
        slopes = lab_slopes(values, bands, illuminant) * (lifted * np.sqrt(share)[:, None])[:, None]
        flat = slopes.reshape(-1, len(bands))
        metric += flat.T @ flat
    return metric + RIDGE * np.trace(metric) / len(bands) * np.eye(len(bands))


def _values(transform: LogTransform, logs: np.ndarray) -> np.ndarray:
    """Apply `LogTransform.inverse` to an array."""
    return transform.mean * (np.exp(np.minimum(logs, MOST)) - transform.epsilon).clip(0)


@dataclass(frozen=True)
class ChosenBasis:
    """A basis that meets a tolerance, and its mean CIEDE2000 error by illuminant."""

    basis: SpectralBasis
    differences: Mapping[str, float]


def choose_basis(
    logs: np.ndarray, weights: np.ndarray, transform: LogTransform, wavelengths: Sequence[float], tolerance: float
) -> ChosenBasis:
    """Return the smallest basis whose mean CIEDE2000 error is at most `tolerance` under each of `ILLUMINANTS`.

    `logs` (N, W) are logarithms by `transform`, and `weights` (N,) are their weights in the mean. The basis of all W
    vectors has no error. Raises the BadInput of `spectral.to_rgb`.
    """
    whole = whole_basis(logs, weights, transform, wavelengths)
    share = weights / weights.sum()
    spectra, mean = _values(transform, logs), share @ logs
    colours = {illuminant: lab_of(spectra, wavelengths, illuminant) for illuminant in ILLUMINANTS}

    def left_by(basis: SpectralBasis) -> dict[str, float]:
        made = _values(transform, basis.logs(basis.coordinates(logs)))
        return {
            illuminant: float(share @ ciede2000(own, lab_of(made, wavelengths, illuminant)))
            for illuminant, own in colours.items()
        }

    for rank in range(1, whole.rank):
        basis = whole.first(rank, mean)
        differences = left_by(basis)
        if max(differences.values()) <= tolerance:
            return ChosenBasis(basis, differences)
    return ChosenBasis(whole, left_by(whole))
