"""What is true of a fit to stressed samples, for `verdict_blind.py`, and whether anybody could know it.

Stated before any verdict was looked at, and computed from the clean material, what was done to it, and where the
stressed samples stand; never from what the verdict says.

Bad: the fit's albedo is off from the clean material's by more than `OFF` in a channel at some θi of
`energy.ALBEDO_DEGREES`, or it explains less than `LEAST_EXPLAINED` of the variance of clean logarithms over the discs,
or (the third criterion, whose figures are counted apart) the light of its highlight, the brightest 1% of each
incidence, is off by more than `OFF`.

A bad fit cannot be known to be bad

* where its samples are those of *another material*, as likely as the clean one: what was done changes the values
  alone, all directions alike; it leaves every sample above zero (at most `CUT` of them are cut); the material that has
  such values reflects no more than it gets, albedo ≤ 1 at every angle in each channel; and the fit is a good one of
  that other material;
* where it is off *between samples* alone. A pair of directions is blind where the clean material is more than `TWICE`
  the brightest, or less than half of the darkest, of what it is at the `NEAREST` samples next to it in (√θh, θd): what
  it does there left no trace in any sample, those at other azimuths included. The fit is held against a material that
  is the fit itself at blind pairs, and the clean one everywhere else; where it is a good one of that, the fault lies
  where nobody measured. Such faults have to be covered by a finding of what is unknown; whether they are is counted.

Anything else has left its traces in the data, or is the fit's own fault, and can be known.
"""

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import Drawable, sample_model
from homofact.evaluation.energy import energy_errors
from homofact.factor.fitted import Fitted
from homofact.geometry.coordinates import rusinkiewicz_angles

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.verdict.verdict_cases import Map

OFF, LEAST_EXPLAINED = 0.15, 0.9
CUT, TWICE, NEAREST = 1e-3, 2.0, 6
_PAIRS = 2000
ANOTHER, BETWEEN = "another material", "between samples"


@dataclass(frozen=True)
class Truth:
    """The figures of a fit against its clean material.

    `unknowable` says why a bad one cannot be known, if so; `plainly_unknowable` why one that is `plainly_bad` cannot.
    """

    albedo: float
    explained: float
    highlight: float
    unknowable: str = ""
    plainly_unknowable: str = ""

    @property
    def plainly_bad(self) -> bool:
        """By albedo and logarithms, as the issue has it."""
        return abs(self.albedo - 1) > OFF or not self.explained >= LEAST_EXPLAINED

    @property
    def bad(self) -> bool:
        """By these, or by the highlight."""
        return self.plainly_bad or abs(self.highlight - 1) > OFF


@dataclass(frozen=True)
class _Other:
    """A reflectance whose values another makes of (directions, values)."""

    clean: Drawable
    samples: Samples
    fit: Fitted | None = None
    of_values: Map | None = None
    nbytes: int = 0
    fetches: int = 0

    @property
    def channels(self) -> tuple[str, ...]:
        """As the clean one's."""
        return self.clean.channels

    @property
    def isotropic(self) -> bool:
        """As the clean one."""
        return self.clean.isotropic

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The clean values, changed, and at blind pairs those of `fit`."""
        values = self.clean.evaluate(wi, wo).double()
        if self.of_values is not None:
            values = torch.where(values > 0, self.of_values(values).clamp_min(0), values)
        if self.fit is None:
            return values
        return torch.where(blind(self.clean, self.samples, wi, wo)[:, None], self.fit.evaluate(wi, wo), values)


def blind(clean: Reflectance, samples: Samples, wi: Tensor, wo: Tensor) -> Tensor:
    """Whether each pair (N, 3) is blind (N,), as the module's head says."""
    tree = KDTree(_place(samples.wi, samples.wo))
    count = min(NEAREST, len(samples))
    near = torch.from_numpy(np.reshape(tree.query(_place(wi, wo), k=count)[1], (len(wi), count)))
    beside = clean.evaluate(samples.wi, samples.wo).double().mean(1)[near]
    here = clean.evaluate(wi, wo).double().mean(1)
    return (here > TWICE * beside.amax(1)) | (TWICE * here < beside.amin(1))


def truth_of(fit: Fitted, clean: Drawable, train: Samples, of_values: Map | None, seed: int) -> Truth:
    """The truth of a fit made from `train`; `of_values` where the values alone were changed, all alike."""
    plain = _against(fit, clean, fit.transform, seed)
    if not plain.bad:
        return plain
    instead = {BETWEEN: _Other(clean, train, fit)}
    if of_values is not None and _physical(clean, train, of_values):
        instead = {
            ANOTHER: _Other(clean, train, of_values=of_values),
            f"{ANOTHER}, {BETWEEN}": _Other(clean, train, fit, of_values),
        }
    found = {why: _against(fit, other, fit.transform, seed) for why, other in instead.items()}
    unknowable = next((why for why, truth in found.items() if not truth.bad), "")
    plainly = next((why for why, truth in found.items() if not truth.plainly_bad), "") if plain.plainly_bad else ""
    return replace(plain, unknowable=unknowable, plainly_unknowable=plainly)


def _against(fit: Fitted, material: Drawable, transform: LogTransform, seed: int) -> Truth:
    energy = energy_errors(fit, material, material.isotropic)
    other = sample_model(material, _PAIRS, "discs", seed + 1)
    logs = [transform.forward(v) for v in (other.values, fit.evaluate(other.wi, other.wo))]
    missed = (logs[1] - logs[0]).square().sum(0) / (logs[0] - logs[0].mean(0)).square().sum(0).clamp_min(1e-6 * _PAIRS)
    return Truth(energy.albedo_worst, 1 - float(missed.max()), energy.highlight)


def _physical(clean: Drawable, train: Samples, of_values: Map) -> bool:
    """Whether a material may have the changed values: none is cut at zero, and none gives more light than it gets."""
    if float((train.values <= 0).double().mean()) > CUT:
        return False
    changed = _Other(clean, train, of_values=of_values)
    return max(max(row) for row in energy_errors(changed, clean, clean.isotropic).fit_albedo) <= 1


def _place(wi: Tensor, wo: Tensor) -> np.ndarray:
    theta_h, theta_d, _ = rusinkiewicz_angles(wi, wo)
    return torch.stack(((theta_h / (math.pi / 2)).clamp_min(0).sqrt(), theta_d / (math.pi / 2)), 1).numpy()
