"""The log transform that turns a product of textures into a sum (McCool 2001; thesis eq. 1.9, 1.10).

f̃ = log((f + εA)/A), A the mean over the discs of the training samples per channel, and back f = A(exp f̃ − ε), cut at
zero. The thesis leaves the −εA out to stay positive; with it the round trip is exact wherever the
exponential exceeds ε, and the cut keeps the result non-negative all the same.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.names import MOST
from homofact.brdf.pair_density import over_discs
from homofact.brdf.samples import Samples
from homofact.errors import BadInput


@dataclass(frozen=True)
class LogTransform:
    """ε (dimensionless) and A (C,) in sr⁻¹ of one fit; never recomputed on test data."""

    epsilon: float
    mean: Tensor

    @classmethod
    def of(cls, samples: Samples, epsilon: float) -> "LogTransform":
        """A as the mean of `samples` over the discs (`brdf.pair_density`), whatever scheme they were drawn by.

        Raises BadInput where ε ≤ 0 or a channel is zero throughout.
        """
        if not epsilon > 0:
            raise BadInput(f"epsilon: found {epsilon}, expected above 0")
        weights = over_discs(samples)[:, None]
        mean = (samples.values * weights).sum(0) / weights.sum()
        if bool((mean <= 0).any()):
            name = samples.channels[int((mean <= 0).nonzero()[0])]
            raise BadInput(f"samples: channel {name} is zero everywhere, expected some reflectance")
        return cls(float(epsilon), mean)

    @classmethod
    def of_values(cls, values: Tensor, epsilon: float) -> "LogTransform":
        """A as the plain mean of values (N, C) in sr⁻¹, for interpolating them; a channel of zeros alone stays zero."""
        mean = values.mean(0)
        return cls(epsilon, torch.where(mean > 0, mean, torch.ones_like(mean)))

    def forward(self, values: Tensor) -> Tensor:
        """f̃ (N, C) of values (N, C) in sr⁻¹."""
        return torch.log(values / self.mean.to(values) + self.epsilon)

    def inverse(self, logs: Tensor) -> Tensor:
        """Values (N, C) in sr⁻¹, ≥ 0, of logs (N, C).

        Logs above `MOST` count as that, so that texels which ran away (few samples, no smoothing) give absurd
        values, which the verdict sees, and not infinite ones, which poison every mean.
        """
        return self.mean.to(logs) * (torch.exp(logs.clamp_max(MOST)) - self.epsilon).clamp_min(0)
