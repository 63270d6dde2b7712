"""Use a fit as a source: draw samples of its reflectance, as of a measurement or a model."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from homofact.brdf.reflectance import Derived
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.brdf.source_names import DEFAULT_COUNT, DEFAULT_SCHEME
from homofact.exporting.result import open_result
from homofact.factor.fitted import Fitted
from homofact.files.archive import member_names
from homofact.files.reading import read_bytes


@dataclass(frozen=True)
class Drawn(Derived):
    """A reflectance with a flag for isotropy, which drawing samples requires."""

    isotropic: bool


def knows_no_azimuth(fitted: Fitted) -> bool:
    """Return whether a fit is isotropic by its coordinates; a model without textures always is."""
    return fitted.evaluation is None or fitted.evaluation.isotropic


def is_fit(place: str | os.PathLike[str]) -> bool:
    """Return whether a path is a fit rather than a source: a folder, or an .npz file with a fit's header.

    Raises BadInput for a damaged archive.
    """
    path = Path(place)
    if path.is_dir():
        return True
    if path.suffix.lower() != ".npz" or not path.is_file():
        return False
    names = member_names(path, read_bytes(path, "an archive"), "an .npz of samples or of a fit")
    return "header" in names and "wi" not in names


def fit_as_source(place: str | os.PathLike[str], count: int, scheme: str, seed: int) -> Source:
    """Return the fit in a result folder, an export or a saved file as a source with `count` samples.

    Raises BadInput if there is no fit.
    """
    return as_source(open_result(place), Path(place).name, count, scheme, seed)


def as_source(
    fitted: Fitted, name: str, count: int = DEFAULT_COUNT, scheme: str = DEFAULT_SCHEME, seed: int = 0
) -> Source:
    """Return a fit as the source `name`, with `count` samples of it."""
    begun = time.perf_counter()
    reflectance = Drawn(fitted, knows_no_azimuth(fitted))
    samples = sample_model(reflectance, count, scheme, seed, noise_free=False)
    samples.provenance["comments"] = ["values of a fit"]
    return Source(name, "drawn", samples, reflectance, fitted.transform.epsilon, time.perf_counter() - begun)
