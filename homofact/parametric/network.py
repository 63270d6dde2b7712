"""The NBRDF network (`brdf.neural`) trained on samples, as Sztrajman, Rainer, Ritschel and Weyrich (2021) train it.

Adam on batches of 512 pairs; the loss is the mean absolute difference of log(1 + f cosθi) (their section 3.2). Instead
of their 100 epochs of 800,000 pairs, the number of steps is given, and the learning rate falls to 0 along a cosine.

The network's last step clamps values at zero, where the gradient vanishes: for a glossy metal, 70% of the values stayed
zero. Training therefore extends exp(y) − 1 and log(1 + x) below zero by their tangents, y and x. Negative values then
count as errors like any others.
"""

from collections.abc import Callable

import torch
from torch import Tensor

from homofact.brdf.neural import LAYERS, NeuralBrdf, network_input
from homofact.brdf.samples import Samples

BATCH, RATE = 512, 5e-3
Loss = Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]


def published_loss(values: Tensor, y: Tensor, expected: Tensor, cosine: Tensor) -> Tensor:
    """Mean |log(1 + f̂ cosθi) − log(1 + f cosθi)| of values, samples (N, C), cosines (N, 1); linear below zero."""
    found = values * cosine
    found = torch.where(found > 0, torch.log1p(found.clamp_min(0)), found)
    return (found - torch.log1p(expected * cosine)).abs().mean()


def train(samples: Samples, steps: int, seed: int = 0, loss: Loss = published_loss) -> NeuralBrdf:
    """Return a network that is trained for `steps` steps on samples of three channels.

    `loss` is called with the values before clamping, the output y of the last layer, the samples' values, and cosθi.
    """
    generator = torch.Generator().manual_seed(seed)
    parameters: list[Tensor] = []
    for inputs, outputs in LAYERS:
        span = (6 / (inputs + outputs)) ** 0.5
        weight = (torch.rand(inputs, outputs, generator=generator) * 2 - 1) * span
        parameters += [weight.requires_grad_(True), torch.zeros(outputs, requires_grad=True)]
    x = network_input(samples.wi, samples.wo).float()
    values, cosine = samples.values.float(), samples.wi[:, 2:].float()
    optimiser = torch.optim.Adam(parameters, lr=RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for _ in range(steps):
        rows = torch.randint(len(x), (BATCH,), generator=generator)
        y = x[rows]
        for k in range(0, 6, 2):
            y = y @ parameters[k] + parameters[k + 1]
            y = torch.relu(y) if k < 4 else y
        off = loss(torch.where(y > 0, torch.expm1(y), y), y, values[rows], cosine[rows])
        optimiser.zero_grad()
        off.backward()
        optimiser.step()
        schedule.step()
    w0, b0, w1, b1, w2, b2 = (p.detach().double() for p in parameters)
    return NeuralBrdf((w0, w1, w2), (b0, b1, b2))
