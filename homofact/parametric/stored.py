"""A saved model without textures read back, every entry checked. No torch is loaded here.

`ModelFit.load` reads a model of tensors, `homofact.runtime` one of arrays: the formulas take both.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from homofact.brdf.analytic.common import AnalyticModel
from homofact.brdf.analytic.ggx import Ggx, GgxLobe
from homofact.brdf.analytic.spherical_gaussians import Gaussian, SphericalGaussians
from homofact.brdf.factored import BINS, FactoredBrdf
from homofact.brdf.neural import LAYERS, NeuralBrdf
from homofact.errors import BadInput
from homofact.factor.evaluation import Exponential
from homofact.factor.stored import channels_and_transform
from homofact.files.saved import SavedFit

FORMAT, FORMAT_VERSION = "homofact-model", 1
Made = Callable[[np.ndarray], Any]


@dataclass(frozen=True)
class StoredModel:
    """A saved model, ε and A (C,) by which its error is measured, channels and provenance."""

    model: AnalyticModel
    transform: Exponential
    channels: tuple[str, ...]
    provenance: dict[str, Any]

    @classmethod
    def load(cls, path: str | os.PathLike[str], made: Made = np.asarray) -> "StoredModel":
        """Read what `save` wrote, a network's and a table's arrays as `made` makes them.

        Raises BadInput for a file that is none, is damaged, or is from a newer version.
        """
        saved = SavedFit.read(path, FORMAT, FORMAT_VERSION)
        fields = saved.fields
        channels, transform = channels_and_transform(saved)
        restored = _RESTORED[fields.text("kind", _RESTORED)]
        try:
            model = restored(saved, channels, made)
        except BadInput as error:
            raise BadInput(f"{path}: {error}") from error
        return cls(model, transform, channels, fields.inner("provenance").found)


def _ggx(saved: SavedFit, channels: tuple[str, ...], made: Made) -> Ggx:
    specular = saved.floats("specular", (None, len(channels)), least=0)
    count = (len(specular),)
    shapes = [saved.floats(name, count).tolist() for name in ("roughness", "reflectance")]
    lobes = zip(specular.tolist(), *shapes, strict=True)
    diffuse = tuple(saved.floats("diffuse", (len(channels),), least=0).tolist())
    return Ggx(diffuse, tuple(GgxLobe(tuple(colour), *rest) for colour, *rest in lobes), channels=channels)


def _gaussians(saved: SavedFit, channels: tuple[str, ...], made: Made) -> SphericalGaussians:
    amplitude = saved.floats("amplitude", (None, len(channels)), least=0)
    sharpness = saved.floats("sharpness", (len(amplitude),)).tolist()
    gaussians = tuple(Gaussian(tuple(a), s) for a, s in zip(amplitude.tolist(), sharpness, strict=True))
    diffuse = tuple(saved.floats("diffuse", (len(channels),), least=0).tolist())
    return SphericalGaussians(diffuse, gaussians, float(saved.floats("reflectance", (1,))[0]), channels=channels)


def _network(saved: SavedFit, channels: tuple[str, ...], made: Made) -> NeuralBrdf:
    w0, w1, w2 = (made(saved.floats(f"w{k}", shape)) for k, shape in enumerate(LAYERS))
    b0, b1, b2 = (made(saved.floats(f"b{k}", shape[1:])) for k, shape in enumerate(LAYERS))
    return NeuralBrdf((w0, w1, w2), (b0, b1, b2), channels=channels)


def _factored(saved: SavedFit, channels: tuple[str, ...], made: Made) -> FactoredBrdf:
    return FactoredBrdf(made(saved.floats("table", (2 + 3 * BINS, len(channels)))), channels=channels)


_RESTORED: dict[str, Callable[[SavedFit, tuple[str, ...], Made], AnalyticModel]] = {
    "ggx": _ggx,
    "gaussians": _gaussians,
    "network": _network,
    "factored": _factored,
}
