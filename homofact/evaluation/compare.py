"""Fit several methods on one split of one source, and measure them in the same way.

A part of the samples is held out before anything else (`evaluation.split`). To measure errors, isotropic samples are
rotated to random azimuths, both training and held-out samples, so that a fit cannot be good only at the measured
azimuth. Training and held-out errors use the fit's own ε and A, which come only from the training samples.
"""

import time
from dataclasses import dataclass, replace
from typing import Any

from homofact.brdf.samples import Samples
from homofact.brdf.source import Source
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import Report
from homofact.evaluation.appearance import Appearance, appearance
from homofact.evaluation.artefacts.look import look_for_artefacts
from homofact.evaluation.metrics import SixErrors, measure
from homofact.evaluation.split import Split
from homofact.evaluation.verdict.judge import judge
from homofact.evaluation.verdict.verdict import Verdict
from homofact.factor.fitted import Fitted
from homofact.methods.fitting import ProgressCallback
from homofact.methods.method import Method


@dataclass(frozen=True)
class ComparisonRow:
    """One method on one split of a source: the fit, its settings and its errors on training and held-out samples.

    `held_out` has the errors on the split's test samples, which are all samples if nothing was held out. `appearance`
    has the visible errors of the fit; it is None if the source consists only of samples.
    """

    source: str
    split: Split
    settings: Method
    factorization: Fitted
    report: Report
    train: SixErrors
    held_out: SixErrors
    samples: int
    seconds_read: float
    seconds_fit: float
    seconds_total: float
    verdict: Verdict
    appearance: Appearance | None = None

    @property
    def spends_bytes(self) -> bool:
        """Whether the method chose the texture sizes (for a byte budget), or the fit has no textures."""
        return self.settings.bytes is not None or not self.factorization.textures

    def record(self) -> dict[str, Any]:
        """Return the JSON form of the row (times in seconds, sizes in bytes as float32 texels).

        "subset" describes the drawn subset of the training samples; it is None if the fit used all of them.
        """
        return {
            "source": self.source,
            "method": self.settings.name,
            "textures": len(self.factorization.terms),
            "size": None if self.spends_bytes else self.settings.size,
            "shapes": [list(texture.size) for texture in self.factorization.textures],
            "bytes": self.factorization.nbytes,
            "fetches": self.factorization.fetches,
            "samples": self.samples,
            "subset": self.factorization.provenance.get("source", {}).get("subset"),
            "split": self.split.record(),
            "status": self.report.status.value,
            "evaluations": self.report.evaluations,
            "seed": self.settings.seed,
            "epsilon": self.factorization.transform.epsilon,
            "mean": dict(zip(self.factorization.channels, self.factorization.transform.mean.tolist(), strict=True)),
            "seconds": {"read": self.seconds_read, "fit": self.seconds_fit, "total": self.seconds_total},
            "verdict": self.verdict.record(),
            "error": {"train": self.train.record(), self.split.part: self.held_out.record()},
            "appearance": None if self.appearance is None else self.appearance.record(),
        }


def held_out_samples(source: Source, held_out: float, seed: int) -> Samples:
    """Return the held-out samples of the split with this `seed`, rotated to random azimuths."""
    return source.samples.split(held_out, seed)[1].rotated_at_random(seed)


def fit_and_measure(
    source: Source,
    settings: Method,
    held_out: float = HELD_OUT,
    progress: ProgressCallback | None = None,
    subset: int = 0,
    split_seed: int | None = None,
) -> ComparisonRow:
    """Fit one method on a split of the source, and measure it on both parts.

    `split_seed` determines the split; if it is None, `settings.seed` does. A `subset` above 0 limits the number of
    training samples. They are drawn by cells after the split (`brdf.stratified`), so the held-out samples are the same
    with and without a subset. With `held_out` = 0, the fit uses all samples (see `fit_split`). Raises BadInput unless 0
    ≤ `held_out` < 1.
    """
    seed = settings.seed if split_seed is None else split_seed
    return fit_split(source, Split.of(source, held_out, seed, subset), settings, progress)


@dataclass(frozen=True)
class FitWithErrors:
    """A fit and its report, with its errors on training and held-out samples, both at random azimuths."""

    factorization: Fitted
    report: Report
    train: SixErrors
    held_out: SixErrors
    seconds: float


def fit_baseline(source: Source, split: Split, settings: Method) -> FitWithErrors:
    """Fit one method on a split and measure only its errors, as a baseline that needs no verdict.

    Raises BadInput as the split's parts and the fit do.
    """
    if settings.epsilon is None:
        settings = replace(settings, epsilon=source.default_epsilon)
    return _fitted(split.parts(source)[0], split.test_samples(source), split, settings)


def _fitted(
    train: Samples, test: Samples, split: Split, settings: Method, progress: ProgressCallback | None = None
) -> FitWithErrors:
    began = time.perf_counter()
    fitted = settings.fit(train, progress)
    # A fit whose search was known from the last one reports more than it took now.
    seconds, factorization = max(time.perf_counter() - began, fitted.report.seconds), fitted.factorization
    parts = (train.rotated_at_random(split.seed), test)
    errors = [measure(factorization, samples, factorization.transform) for samples in parts]
    return FitWithErrors(factorization, fitted.report, errors[0], errors[1], seconds)


def fit_split(
    source: Source, split: Split, settings: Method, progress: ProgressCallback | None = None
) -> ComparisonRow:
    """Fit one method on an existing split of the source, and measure it on both parts.

    If nothing is held out, the errors named held-out are those on all samples at random azimuths. Raises BadInput as
    `Split.parts` and the fit do.
    """
    began = time.perf_counter()
    if settings.epsilon is None:
        settings = replace(settings, epsilon=source.default_epsilon)
    train, test = split.parts(source)[0], split.test_samples(source)
    made = _fitted(train, test, split, settings, progress)
    factorization = made.factorization
    total = source.seconds_read + max(time.perf_counter() - began, made.seconds)
    seen = appearance(factorization, source)
    look = look_for_artefacts(factorization, source)
    verdict = judge(factorization, made.report, settings, train, test, (made.train, made.held_out), seen, look)
    return ComparisonRow(
        source.name,
        split,
        settings,
        factorization,
        made.report,
        made.train,
        made.held_out,
        len(source.samples),
        source.seconds_read,
        made.seconds,
        total,
        verdict,
        seen,
    )
