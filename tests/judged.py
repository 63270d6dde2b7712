"""What verdicts are asked of: a model whose values are altered as a test wants it, and samples of it."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.errors import Report, Status
from homofact.evaluation.appearance import Appearance
from homofact.evaluation.artefacts.look import Look
from homofact.evaluation.energy import EnergyErrors
from homofact.evaluation.metrics import SixErrors
from homofact.evaluation.verdict.judge import judge
from homofact.evaluation.verdict.verdict import Verdict
from homofact.methods.search import Search

MODEL = material("phong-10").model
TRAIN, TEST = (sample_model(MODEL, 3000, seed=seed) for seed in (0, 1))
Change = Callable[[Tensor, Tensor, Tensor], Tensor]


@dataclass(frozen=True)
class Altered:
    """A model's values put through `change(values, wi, wo)`: a `Fitted` with the fault that a test asks for."""

    change: Change = field(default=lambda values, wi, wo: values)
    transform: LogTransform = field(default_factory=lambda: LogTransform.of(TRAIN, 1e-2))
    channels: tuple[str, ...] = MODEL.channels
    nbytes: int = 4
    fetches: int = 1
    terms: tuple[Any, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        return self.change(MODEL.evaluate(wi, wo), wi, wo)

    def save(self, path: object) -> None:
        raise AssertionError("a verdict saves nothing")


def errors(log_mse: float) -> SixErrors:
    return SixErrors(log_mse, 0, 0, 0, 0, 0)


def verdict(
    fitted: Altered | None = None,
    train: Samples = TRAIN,
    test: Samples = TEST,
    log_mse: tuple[float, float] = (1e-4, 1.1e-4),
    status: Status = Status.DIRECT,
    seen: Appearance | None = None,
    look: Look | None = None,
    settings: Search = Search(reciprocal=False),  # noqa: B008
    **details: Any,
) -> Verdict:
    report = Report(status, 0, 0, 0.0, 0.0, 0, details=details)
    pair = (errors(log_mse[0]), errors(log_mse[1]))
    whole: Any = fitted or Altered()
    return judge(whole, report, settings, train, test, pair, seen, look)


def names(found: Verdict) -> set[str]:
    return {finding.name for finding in found.findings}


def noisy(level: float) -> Samples:
    noise = torch.randn(TRAIN.values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    return replace(TRAIN, values=TRAIN.values * torch.exp(level * noise))


def measured(samples: Samples) -> Samples:
    """The samples as a measurement, whose source nobody can ask."""
    return replace(samples, provenance={})


def seen(albedo: float = 1.0, highlight: float = 1.0, floor: float = 0.0, asymmetry: float = 0.0) -> Appearance:
    """An appearance of one angle and two channels, the second of them reflecting `albedo` of the source's light."""
    light = EnergyErrors(
        (5.0,),
        ((0.5, 0.5),),
        ((0.5, 0.5 * albedo),),
        (1.0, 1.0),
        1.0,
        0.1,
        floor,
        0.1,
        floor,
        highlight,
        1.0,
        None,
        asymmetry,
    )
    return Appearance(light, 30.0, 30.0)
