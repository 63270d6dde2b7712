"""The five lines of Python: read, fit, evaluate, save, load.

source = homofact.read("paint.brdf")              # or "material:lafortune-blue-paint"
fitted = homofact.fit(source, textures=2)         # or homofact.fit(source, homofact.Cole(textures=5))
values = fitted.evaluate(wi, wo)                  # (N, 3) in sr⁻¹; fitted.report and fitted.verdict say how it went
fitted.save("paint.npz")
same = homofact.load("paint.npz")
"""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from homofact.brdf.names import DEFAULT_COUNT, DEFAULT_SCHEME
from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput
from homofact.evaluate.appearance import appearance
from homofact.evaluate.metrics import measure
from homofact.evaluate.split import Split
from homofact.evaluate.verdict.judge import judge
from homofact.export.result import open_result
from homofact.factor.fitted import Fitted
from homofact.methods.fitting import Fit, Method, ProgressCallback
from homofact.methods.search import Search
from homofact.methods.table import made


def read(
    source: str,
    *,
    channels: str = "rgb",
    count: int = DEFAULT_COUNT,
    scheme: str = DEFAULT_SCHEME,
    seed: int = 0,
    calibrate: Sequence[str] = (),
    clipped: float | str | None = None,
) -> Source:
    """Read a measurement (content sniffed) or draw `count` pairs of "material:NAME" by a `scheme`.

    `calibrate` divides gains of the instrument out, some of "rings" and "rows" (`brdf.gains`); values of `clipped` sr⁻¹
    and more, or of the level that is "found", are taken as bounds (`brdf.clipping`): both for measured samples only.
    The result has `.samples` and `.reflectance`. Raises BadInput for what cannot be read.
    """
    return open_source(
        source, channels=channels, count=count, scheme=scheme, seed=seed, calibrate=calibrate, clipped=clipped
    )


def fit(
    source: Source | Samples | str | os.PathLike[str],
    method: Method | None = None,
    *,
    progress: ProgressCallback | None = None,
    **settings: Any,
) -> Fit:
    """Factor all samples of a source by a method (`Search`, `Cole`, `McCool`, `Svd`, `Nmf`), or `Search(**settings)`.

    A file's name, or "material:NAME", is read as `read` does it.

    Nothing is held out, as the fit's split says: the verdict judges the fit on the samples that it was made from,
    turned at random where they are isotropic, and cannot see what is learnt by heart.
    `homofact.evaluate.compare.fit_and_measure` gives an honest error. Bare `Samples` leave the fit without a split;
    pass `epsilon` with measured ones (1e-2 where zeros and noise are to be expected). Raises BadInput for settings that
    cannot be meant or that the method does not have.
    """
    if method is None:
        method = made(Search.name, settings)
    elif settings:
        raise BadInput(
            f"fit: found a method and {', '.join(settings)} beside it, expected a method with its settings,"
            f" as in {type(method).__name__}({', '.join(f'{name}=...' for name in settings)})"
        )
    elif not hasattr(method, "fit"):
        raise BadInput(f"method: found {method!r}, expected one such as homofact.McCool(size=16)")
    if isinstance(source, str | os.PathLike):
        source = read(os.fspath(source))
    if isinstance(source, Samples):
        samples = source
    elif not isinstance(source, Source):
        raise BadInput(f"source: found {type(source).__name__}, expected what homofact.read gives, or a file's name")
    else:
        method = method if method.epsilon is not None else replace(method, epsilon=source.default_epsilon)
        samples, _ = Split.of(source, 0.0, method.seed).parts(source)
    found = method.fit(samples, progress)
    turned = samples.rotated_at_random(method.seed)
    errors = measure(found.factorization, turned, found.factorization.transform)
    seen = None if isinstance(source, Samples) else appearance(found.factorization, source)
    verdict = judge(found.factorization, found.report, method, samples, turned, (errors, errors), seen)
    return replace(found, verdict=verdict)


def load(path: str) -> Fitted:
    """What `save` wrote, or the result in a folder, bit-identical. Raises BadInput for anything else."""
    return open_result(path)
