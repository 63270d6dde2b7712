"""The log transform that turns a product of textures into a sum (McCool 2001; thesis eq. 1.9, 1.10).

f̃ = log((f + εA)/A), A the mean over the discs of the training samples per channel, and back f = A(exp f̃ − ε), cut at
zero. The thesis leaves the −εA out to stay positive; with it the round trip is exact wherever the
exponential exceeds ε, and the cut keeps the result non-negative all the same.

A sample that weighs more in that mean than all others together counts as much as these: one glint in a thousand values
would else lift A until most of the others lie below εA, where logarithms tell nothing apart.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from homofact.brdf.source_names import MOST
from homofact.errors import BadInput
from homofact.linear.arrays import Held, as_arrays

if TYPE_CHECKING:
    from torch import Tensor

    from homofact.brdf.samples import Samples


@dataclass(frozen=True)
class LogTransform:
    """ε (dimensionless) and A (C,) in sr⁻¹ of one fit, `mean`; never recomputed on test data.

    A is a NumPy array, made of a tensor where one is given.
    """

    epsilon: float
    mean: Held

    def __post_init__(self) -> None:
        """Keep A as an array."""
        as_arrays(self, "mean")

    def mean_like(self, values: "Tensor") -> "Tensor":
        """Return a (C,) as a tensor of the type and on the device of `values`."""
        import torch

        return torch.from_numpy(self.mean).to(values)

    def of_channels(self, own: slice) -> "LogTransform":
        """Return the transform of some of the channels alone."""
        return LogTransform(self.epsilon, self.mean[own])

    @classmethod
    def of(cls, samples: "Samples", epsilon: float) -> "LogTransform":
        """Return a as the mean of `samples` over the discs (`brdf.pair_density`), whatever scheme they were drawn by.

        The largest part of a channel's mean is at most that of all other samples together. Raises BadInput where ε ≤ 0
        or a channel is zero throughout.
        """
        if not epsilon > 0:
            raise BadInput(where="epsilon", found=epsilon, expected="above 0")
        from homofact.brdf.pair_density import over_discs

        weights = over_discs(samples)[:, None]
        parts = samples.values * weights
        whole = parts.sum(0)
        others = whole - parts.max(0).values
        mean = whole.minimum(2 * others).where(others > 0, whole) / weights.sum()
        if bool((mean <= 0).any()):
            name = samples.channels[int((mean <= 0).nonzero()[0])]
            raise BadInput(f"channel {name} is zero everywhere", where="samples", expected="some reflectance")
        return cls(float(epsilon), mean)

    @classmethod
    def of_values(cls, values: "Tensor", epsilon: float) -> "LogTransform":
        """A as the plain mean of values (N, C) in sr⁻¹, for interpolating them; a channel of zeros alone stays zero."""
        mean = values.mean(0)
        return cls(epsilon, mean.where(mean > 0, mean.new_ones(())))

    def forward(self, values: "Tensor") -> "Tensor":
        """Return f̃ (N, C) of values (N, C) in sr⁻¹."""
        return (values / self.mean_like(values) + self.epsilon).log()

    def inverse(self, logs: "Tensor") -> "Tensor":
        """Return values (N, C) in sr⁻¹, ≥ 0, of logs (N, C).

        Logs above `MOST` count as that, so that texels which ran away (few samples, no smoothing) give absurd
        values, which the verdict sees, and not infinite ones, which poison every mean.
        """
        return self.mean_like(logs) * (logs.clamp_max(MOST).exp() - self.epsilon).clamp_min(0)
