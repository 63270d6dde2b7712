"""The six error metrics of the thesis (4.3): absolute, squared and maximum, in log space and linear.

Every mean is over samples and channels. Samples of the scheme `lobe` are weighted so that the mean is uniform over the
discs (`brdf.pair_density`). The log-space metrics compare f̃ = log((f + εA)/A) of fit and samples, with the ε and A of
the fit. So compare them only at the same ε. log_mse is the Cole error. The linear metrics are in sr⁻¹ (mse in sr⁻²),
without the cosine.
"""

from dataclasses import asdict, dataclass

from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.pair_density import disc_shares
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples


@dataclass(frozen=True)
class SixErrors:
    """The metrics of one reflectance on one sample set, in the order of the JSON output."""

    log_mse: float
    log_mae: float
    log_max: float
    mse: float
    mae: float
    max: float

    def record(self) -> dict[str, float]:
        """Return a JSON-able dictionary."""
        return asdict(self)


def six_errors(found: Tensor, expected: Tensor, transform: LogTransform, weights: Tensor | None = None) -> SixErrors:
    """Return the metrics of values (N, C) in sr⁻¹ against expected values, with optional weights (N,) for the means."""
    linear = (found - expected).abs()
    logs = (transform.forward(found) - transform.forward(expected)).abs()

    def mean(values: Tensor) -> float:
        if weights is None:
            return float(values.mean())
        return float((values.mean(1) * weights).sum() / weights.sum())

    return SixErrors(mean(logs**2), mean(logs), float(logs.max()), mean(linear**2), mean(linear), float(linear.max()))


def measure(reflectance: Reflectance, samples: Samples, transform: LogTransform) -> SixErrors:
    """Return the metrics of a reflectance on samples of the same channels; lobe samples are weighted over the discs."""
    return six_errors(reflectance.evaluate(samples.wi, samples.wo), samples.values, transform, disc_shares(samples))


def explained_variance(expected: Tensor, found: Tensor, weights: Tensor) -> float:
    """1 − Σw(found − expected)²/Σw(expected − mean)² of logs (N, C), of the worst channel, for weights (N,).

    A constant BRDF has no variance. Then the result is 1 if the values match, and falls fast with any error.
    """
    weights = (weights / weights.sum())[:, None]
    missed = (weights * (found - expected).square()).sum(0)
    there = (weights * (expected - (weights * expected).sum(0)).square()).sum(0)
    return float((1 - missed / there.clamp_min(1e-6)).min())
