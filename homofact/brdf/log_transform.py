"""The log transform that turns a product of textures into a sum (McCool 2001; thesis eq. 1.9, 1.10).

The transform is f̃ = log((f + εA)/A), where A is the mean of the training samples over the parabolic discs, per
channel. The inverse is f = A(exp f̃ − ε), clamped to at least 0. The thesis omits −εA to keep values positive. With it,
the round trip is exact wherever exp f̃ exceeds ε, and the clamp keeps the result non-negative.

If one sample contributes more to that mean than all others together, its contribution is reduced to theirs. Otherwise
one glint among a thousand values could raise A until most other values lie below εA, where their logarithms are nearly
equal.
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
    """The constants of one fit: ε (dimensionless) and A (`mean`, (C,) in sr⁻¹), never recomputed on test data.

    A is a NumPy array; a tensor is converted to one.
    """

    epsilon: float
    mean: Held

    def __post_init__(self) -> None:
        """Keep A as an array."""
        as_arrays(self, "mean")

    def mean_like(self, values: "Tensor") -> "Tensor":
        """Return A (C,) as a tensor of the type and on the device of `values`."""
        import torch

        return torch.from_numpy(self.mean).to(values)

    def of_channels(self, own: slice) -> "LogTransform":
        """Return the transform of some of the channels alone."""
        return LogTransform(self.epsilon, self.mean[own])

    @classmethod
    def of(cls, samples: "Samples", epsilon: float) -> "LogTransform":
        """Return the transform whose A is the mean of `samples` over the discs, for any sampling scheme.

        No sample contributes more to a channel's mean than all other samples together. Raises BadInput where ε ≤ 0 or a
        channel is zero throughout.
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
        """Return the transform whose A is the plain mean of values (N, C) in sr⁻¹, or 1 for channels of zeros."""
        mean = values.mean(0)
        return cls(epsilon, mean.where(mean > 0, mean.new_ones(())))

    def forward(self, values: "Tensor") -> "Tensor":
        """Return f̃ (N, C) of values (N, C) in sr⁻¹."""
        return (values / self.mean_like(values) + self.epsilon).log()

    def inverse(self, logs: "Tensor") -> "Tensor":
        """Return values (N, C) in sr⁻¹, ≥ 0, of logs (N, C).

        Logs are at most `MOST`. Texels that diverged (few samples, no smoothing) then give very large but finite
        values. The verdict detects these, while an infinite value would make every mean infinite.
        """
        return self.mean_like(logs) * (logs.clamp_max(MOST).exp() - self.epsilon).clamp_min(0)
