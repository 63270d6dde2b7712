"""A fit as a source: what it says of reflectance, sampled, as a measurement or a model would be."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.export.result import open_result
from homofact.factor.fitted import Fitted
from homofact.files.archive import member_names
from homofact.files.reading import read_bytes


@dataclass(frozen=True)
class _Drawable:
    """A fit that says whether it is isotropic; a model without textures always is."""

    base: Fitted

    @property
    def channels(self) -> tuple[str, ...]:
        """Those of the fit."""
        return self.base.channels

    @property
    def nbytes(self) -> int:
        """Those of the fit."""
        return self.base.nbytes

    @property
    def fetches(self) -> int:
        """Those of the fit."""
        return self.base.fetches

    @property
    def isotropic(self) -> bool:
        """Whether no texture knows an azimuth."""
        return not self.base.textures or self.base.evaluation.isotropic

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The fit's values (N, C) in sr⁻¹ without the cosine."""
        return self.base.evaluate(wi, wo)


def is_fit(place: str | os.PathLike[str]) -> bool:
    """Whether a place is a folder, or an .npz that does not hold samples. Raises BadInput for a damaged archive."""
    path = Path(place)
    if path.is_dir():
        return True
    if path.suffix.lower() != ".npz" or not path.is_file():
        return False
    names = member_names(path, read_bytes(path, "an archive"), "an .npz of samples or of a fit")
    return "header" in names and "wi" not in names


def fit_as_source(place: str | os.PathLike[str], count: int, scheme: str, seed: int) -> Source:
    """The fit of a result's folder, of an export's or of a saved file, with `count` samples drawn of it.

    Raises BadInput where there is none.
    """
    begun = time.perf_counter()
    fitted = open_result(place)
    reflectance: Reflectance = _Drawable(fitted)
    samples = sample_model(_Drawable(fitted), count, scheme, seed, noise_free=False)
    samples.provenance["comments"] = ["values of a fit"]
    seconds = time.perf_counter() - begun
    return Source(Path(place).name, "drawn", samples, reflectance, fitted.transform.epsilon, seconds)
