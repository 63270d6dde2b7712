"""Fit the tables of `brdf.factored` to samples.

Bagher, Snyder and Nowrouzezahrai (2016) minimise by alternating least squares. Here, L-BFGS optimizes all tables
together: their logarithms, so that all values are positive, and the square root of the diffuse part. The objective is
the sum of squares of `nonlinear`, plus the squared second differences of each table, which fill bins without samples.
Two constants can move between the tables without changing the BRDF. They keep their initial values, because the
gradient does not act on them.
"""

import torch
from torch import Tensor

from homofact.brdf.analytic.common import grazing
from homofact.brdf.analytic.nonlinear import CubeRoots
from homofact.brdf.factored import BINS, FactoredBrdf, bins_of, factored_values
from homofact.brdf.samples import Samples
from homofact.errors import Report, Status

MOST_SAMPLES, MOST_STEPS = 40_000, 300
SMOOTHING = 1e-5


def fit_factored(samples: Samples, seed: int) -> tuple[FactoredBrdf, Report]:
    """Return the tables of one material, with one column per channel, and the report."""
    data = CubeRoots.of(samples, seed, MOST_SAMPLES)
    channels = len(samples.channels)
    wi, wo = data.samples.wi, data.samples.wo
    low, share = bins_of(wi, wo)
    cosines = (grazing(wi[:, 2]) * grazing(wo[:, 2]))[:, None]
    one = torch.ones(1, channels, dtype=torch.float64)
    diffuse = (torch.pi * data.samples.values.median(0).values[None].clamp_min(1e-6) / 2).sqrt()
    x = torch.cat((diffuse, _distribution(data.samples, low, cosines), torch.zeros(2 * BINS, channels))).double()
    x.requires_grad_(True)
    optimiser = torch.optim.LBFGS([x], max_iter=MOST_STEPS, history_size=20, line_search_fn="strong_wolfe")
    calls, last = 0, 0.0

    def parts() -> tuple[Tensor, ...]:
        distribution, masking, fresnel = x[1:].split(BINS)
        return x[:1] ** 2, one, distribution.exp(), masking.exp(), fresnel.exp()

    def value() -> Tensor:
        nonlocal calls, last
        optimiser.zero_grad()
        tables = parts()
        values = (tables[0] + factored_values(tables, low, share) / cosines) / torch.pi
        rough = sum(table.diff(n=2, dim=0).square().sum() for table in x[1:].split(BINS))
        total = data.residuals(values).square().sum() + SMOOTHING * rough
        total.backward()
        calls, last = calls + 1, float(total.detach())
        return total

    optimiser.step(value)
    with torch.no_grad():
        table = torch.cat(parts())
    model = FactoredBrdf(table.detach(), channels=samples.channels)
    status = Status.BUDGET if calls >= MOST_STEPS else Status.CONVERGED
    return model, Report(status, calls, calls, 0.0, last, seed)


def _distribution(samples: Samples, low: Tensor, cosines: Tensor) -> Tensor:
    """Where D's logarithm starts (BINS, C): the mean logarithm of π f cosθi cosθo of each bin of θh, gaps bridged."""
    logs = torch.log((torch.pi * samples.values * cosines).clamp_min(1e-6))
    count = torch.zeros(BINS, dtype=torch.float64).index_add_(0, low[:, 0], torch.ones(len(low), dtype=torch.float64))
    total = torch.zeros(BINS, logs.shape[1], dtype=torch.float64).index_add_(0, low[:, 0], logs)
    there = (count > 0).nonzero()[:, 0]
    nearest = (torch.arange(BINS)[:, None] - there[None]).abs().argmin(1)
    return (total[there] / count[there][:, None])[nearest]
