"""A fitted model that has no textures: parameters, tables of one dimension, or a network's weights.

It is evaluated, measured and saved like any other fit, so you can compare it with fits that have textures. Shaders
exist only for GGX models (`shading.ggx_statements`); functions that need textures reject every model.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from homofact.brdf.analytic.common import AnalyticModel
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.analytic.spherical_gaussians import Gaussian, SphericalGaussians
from homofact.brdf.factored import BINS, FactoredBrdf
from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.neural import LAYERS, NeuralBrdf
from homofact.errors import BadInput
from homofact.factor.evaluation import refuse_model
from homofact.factor.factorization import channels_and_transform
from homofact.factor.fitted import QuantizationGrid, Texture
from homofact.files.archive import write_archive
from homofact.files.saved import SavedFit
from homofact.files.words import listed
from homofact.linear.arrays import as_array

if TYPE_CHECKING:
    from torch import Tensor

FORMAT, FORMAT_VERSION = "homofact-model", 1


@dataclass(frozen=True)
class ModelFit:
    """A `Fitted` without textures: the `model`, and ε and A by which its error in log space is measured."""

    model: AnalyticModel
    transform: LogTransform
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Keep the numbers of a model as arrays, made of tensors where these are given."""
        object.__setattr__(self, "model", _KINDS[type(self.model)].kept(self.model))

    def __repr__(self) -> str:
        """In a line, without the numbers."""
        return f"<ModelFit: {type(self.model).__name__}, bytes {self.nbytes}, {listed(self.channels)}>"

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels."""
        return self.model.channels

    @property
    def nbytes(self) -> int:
        """Bytes of its numbers as float32."""
        return self.model.nbytes

    @property
    def fetches(self) -> int:
        """Tables that an evaluation looks up."""
        return self.model.fetches

    @property
    def terms(self) -> tuple[()]:
        """An empty tuple: a model is not a product of textures."""
        return ()

    @property
    def textures(self) -> tuple[Texture, ...]:
        """An empty tuple: a model has no textures."""
        return ()

    @property
    def evaluation(self) -> None:
        """None, because a model has no textures."""
        return None

    def with_textures(
        self,
        texels: Sequence[Any],
        grids: Sequence[QuantizationGrid | None] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> "ModelFit":
        """Return the fit unchanged. Raises BadInput if any texels are given."""
        if texels:
            refuse_model(self)
        return self

    @answering_in_kind
    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return BRDF values (N, C) in sr⁻¹ without the cosine, 0 under the horizon, in the dtype of wi."""
        # The published networks and tables are of float32; what they are asked in decides what they answer in.
        return self.model.evaluate(wi, wo).to(wi)

    def describe(self) -> dict[str, Any]:
        """Return the kind of the model, and its numbers by name."""
        kind = _KINDS[type(self.model)]
        return {
            "kind": kind.name,
            "model": {name: np.asarray(x).tolist() for name, x in kind.arrays(self.model).items()},
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the one .npz file that reads back bit-identical. Raises BadInput for an unwritable place."""
        kind = _KINDS[type(self.model)]
        header = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "kind": kind.name,
            "channels": list(self.channels),
            "epsilon": self.transform.epsilon,
            "provenance": self.provenance,
        }
        arrays = kind.arrays(self.model) | {"mean": self.transform.mean}
        write_archive(path, header, {name: as_array(array, np.float64) for name, array in arrays.items()})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "ModelFit":
        """Read a file that `save` wrote. Raises BadInput if it is no such file, damaged, or from a newer version."""
        saved = SavedFit.read(path, FORMAT, FORMAT_VERSION)
        fields = saved.fields
        channels, transform = channels_and_transform(saved)
        kinds = {kind.name: kind for kind in _KINDS.values()}
        kind = kinds[fields.text("kind", kinds)]
        try:
            model = kind.restored(saved, channels)
        except BadInput as error:
            raise error.at(path) from error
        return cls(model, transform, fields.inner("provenance").found)


@dataclass(frozen=True)
class _Kind:
    """How a model is stored: its name in files, its numbers as arrays, the model of these, and itself in arrays."""

    name: str
    arrays: Callable[[Any], dict[str, Any]]
    restored: Callable[[SavedFit, tuple[str, ...]], AnalyticModel]
    kept: Callable[[Any], AnalyticModel] = lambda model: model


def _ggx_arrays(model: GgxBrdf) -> dict[str, Any]:
    return {
        "diffuse": model.diffuse,
        "specular": [lobe.specular for lobe in model.lobes],
        "roughness": [lobe.roughness for lobe in model.lobes],
        "reflectance": [lobe.reflectance for lobe in model.lobes],
    }


def _gaussian_arrays(model: SphericalGaussians) -> dict[str, Any]:
    return {
        "diffuse": model.diffuse,
        "amplitude": [gaussian.amplitude for gaussian in model.gaussians],
        "sharpness": [gaussian.sharpness for gaussian in model.gaussians],
        "reflectance": [model.reflectance],
    }


def _network_arrays(model: NeuralBrdf) -> dict[str, Any]:
    weights = {f"w{k}": weight for k, weight in enumerate(model.weights)}
    return weights | {f"b{k}": bias for k, bias in enumerate(model.biases)}


def _network_kept(model: NeuralBrdf) -> NeuralBrdf:
    weights, biases = (tuple(map(as_array, parts)) for parts in (model.weights, model.biases))
    return replace(model, weights=weights, biases=biases)


def _factored_kept(model: FactoredBrdf) -> FactoredBrdf:
    return replace(model, table=as_array(model.table))


def _ggx(saved: SavedFit, channels: tuple[str, ...]) -> GgxBrdf:
    specular = saved.floats("specular", (None, len(channels)), least=0)
    count = (len(specular),)
    shapes = [saved.floats(name, count).tolist() for name in ("roughness", "reflectance")]
    lobes = zip(specular.tolist(), *shapes, strict=True)
    diffuse = tuple(saved.floats("diffuse", (len(channels),), least=0).tolist())
    return GgxBrdf(diffuse, tuple(GgxLobe(tuple(colour), *rest) for colour, *rest in lobes), channels=channels)


def _gaussians(saved: SavedFit, channels: tuple[str, ...]) -> SphericalGaussians:
    amplitude = saved.floats("amplitude", (None, len(channels)), least=0)
    sharpness = saved.floats("sharpness", (len(amplitude),)).tolist()
    gaussians = tuple(Gaussian(tuple(a), s) for a, s in zip(amplitude.tolist(), sharpness, strict=True))
    diffuse = tuple(saved.floats("diffuse", (len(channels),), least=0).tolist())
    return SphericalGaussians(diffuse, gaussians, float(saved.floats("reflectance", (1,))[0]), channels=channels)


def _network(saved: SavedFit, channels: tuple[str, ...]) -> NeuralBrdf:
    w0, w1, w2 = (saved.floats(f"w{k}", shape) for k, shape in enumerate(LAYERS))
    b0, b1, b2 = (saved.floats(f"b{k}", shape[1:]) for k, shape in enumerate(LAYERS))
    return NeuralBrdf((w0, w1, w2), (b0, b1, b2), channels=channels)


def _factored(saved: SavedFit, channels: tuple[str, ...]) -> FactoredBrdf:
    return FactoredBrdf(saved.floats("table", (2 + 3 * BINS, len(channels))), channels=channels)


_KINDS: dict[type, _Kind] = {
    GgxBrdf: _Kind("ggx", _ggx_arrays, _ggx),
    SphericalGaussians: _Kind("gaussians", _gaussian_arrays, _gaussians),
    NeuralBrdf: _Kind("network", _network_arrays, _network, _network_kept),
    FactoredBrdf: _Kind("factored", lambda model: {"table": model.table}, _factored, _factored_kept),
}
