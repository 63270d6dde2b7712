"""The five lines of Python: read, fit, evaluate, save, load.

source = homofact.read("paint.brdf")              # or "material:lafortune-blue-paint"
factorization = homofact.fit(source, textures=2)
values = factorization.evaluate(wi, wo)           # (N, 3) in sr⁻¹
factorization.save("paint.npz")
same = homofact.load("paint.npz")
"""

from dataclasses import replace
from typing import Any

from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput
from homofact.evaluate.compare import training_samples
from homofact.evaluate.split import Split
from homofact.export.result import open_result
from homofact.factor.fitted import Fitted
from homofact.methods.settings import FitSettings
from homofact.methods.table import run


def read(source: str, *, channels: str = "rgb", count: int = 45_000, seed: int = 0) -> Source:
    """Read a measurement (content sniffed) or draw `count` pairs of "material:NAME".

    The result has `.samples` and `.reflectance`. Raises BadInput for what cannot be read.
    """
    return open_source(source, channels=channels, count=count, seed=seed)


def fit(source: Source | Samples, **settings: Any) -> Fitted:
    """Factor all samples of a source by `FitSettings(**settings)`; nothing is held out, as the fit's split says.

    Use `homofact.evaluate.compare.fit_and_measure` for a fit with an honest error. Bare `Samples` are taken
    as they are and leave the fit without a split; pass `epsilon` with measured ones (1e-2 where zeros and noise are
    to be expected). Raises BadInput for settings that cannot be meant.
    """
    try:
        chosen = FitSettings(**settings)
    except TypeError as error:
        known = ", ".join(FitSettings.__dataclass_fields__)
        raise BadInput(f"fit: {error}, expected settings among {known}") from error
    if isinstance(source, Samples):
        return run(source, chosen).factorization
    if chosen.epsilon is None:
        chosen = replace(chosen, epsilon=source.default_epsilon)
    train, _ = Split.of(source, 0.0, chosen.seed).parts(source)
    return run(training_samples(source, train, chosen), chosen).factorization


def load(path: str) -> Fitted:
    """What `save` wrote, or the result in a folder, bit-identical. Raises BadInput for anything else."""
    return open_result(path)
