"""A fitted model that has no textures: parameters, tables of one dimension, or a network's weights.

It is asked, measured and saved like any other fit, so that it can stand beside those that have textures. What wants
textures (a shader, an export, the viewer) refuses it.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn

import torch
from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel
from homofact.brdf.analytic.ggx import Ggx
from homofact.brdf.analytic.spherical_gaussians import SphericalGaussians
from homofact.brdf.factored import FactoredBrdf
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.neural import NeuralBrdf
from homofact.brdf.reflectance import Directions, answering_in_kind
from homofact.errors import BadInput
from homofact.factor.fitted import Evaluation, Grid, Texture
from homofact.files.archive import write_archive
from homofact.files.words import listed
from homofact.parametric.stored import FORMAT, FORMAT_VERSION, StoredModel


@dataclass(frozen=True)
class ModelFit:
    """A `Fitted` without textures: the `model`, and ε and A by which its error in log space is measured."""

    model: AnalyticModel
    transform: LogTransform
    provenance: dict[str, Any] = field(default_factory=dict)

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
        """None: a model is no product of textures."""
        return ()

    @property
    def textures(self) -> tuple[Texture, ...]:
        """None."""
        return ()

    @property
    def evaluation(self) -> Evaluation:
        """Raises BadInput: what is made from textures cannot be made from a model."""
        self._refuse()

    def with_textures(
        self,
        texels: Sequence[Tensor],
        grids: Sequence[Grid | None] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> "ModelFit":
        """Raises BadInput: it has none."""
        self._refuse()

    def _refuse(self) -> NoReturn:
        kind = _KINDS[type(self.model)].words
        raise BadInput(f"{kind}: has no textures, expected a fit by search, cole, mccool, svd or nmf")

    @answering_in_kind
    def evaluate(self, wi: Directions, wo: Directions) -> Any:
        """BRDF values (N, C) in sr⁻¹ without the cosine, 0 under the horizon, in the dtype of wi."""
        assert isinstance(wi, Tensor)
        assert isinstance(wo, Tensor)
        # The published networks and tables are of float32; what they are asked in decides what they answer in.
        return self.model.evaluate(wi, wo).to(wi)

    def describe(self) -> dict[str, Any]:
        """The kind of the model."""
        return {"kind": _KINDS[type(self.model)].name}

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
        write_archive(path, header, {name: array.to(torch.float64).numpy() for name, array in arrays.items()})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "ModelFit":
        """Read what `save` wrote. Raises BadInput for a file that is none, is damaged, or is from a newer version."""
        stored = StoredModel.load(path, torch.from_numpy)
        transform = LogTransform(stored.transform.epsilon, torch.from_numpy(stored.transform.mean))
        return cls(stored.model, transform, stored.provenance)


@dataclass(frozen=True)
class _Kind:
    """How a model is stored: its name in files and for people, and its arrays; `stored` reads them back."""

    name: str
    words: str
    arrays: Callable[[Any], dict[str, Tensor]]


def _tensor(values: Any) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def _ggx_arrays(model: Ggx) -> dict[str, Tensor]:
    return {
        "diffuse": _tensor(model.diffuse),
        "specular": _tensor([lobe.specular for lobe in model.lobes]),
        "roughness": _tensor([lobe.roughness for lobe in model.lobes]),
        "reflectance": _tensor([lobe.reflectance for lobe in model.lobes]),
    }


def _gaussian_arrays(model: SphericalGaussians) -> dict[str, Tensor]:
    return {
        "diffuse": _tensor(model.diffuse),
        "amplitude": _tensor([each.amplitude for each in model.gaussians]),
        "sharpness": _tensor([each.sharpness for each in model.gaussians]),
        "reflectance": _tensor([model.reflectance]),
    }


def _network_arrays(model: NeuralBrdf) -> dict[str, Tensor]:
    weights = {f"w{k}": weight for k, weight in enumerate(model.weights)}
    return weights | {f"b{k}": bias for k, bias in enumerate(model.biases)}


_KINDS: dict[type, _Kind] = {
    Ggx: _Kind("ggx", "a GGX fit", _ggx_arrays),
    SphericalGaussians: _Kind("gaussians", "a fit of spherical Gaussians", _gaussian_arrays),
    NeuralBrdf: _Kind("network", "a network", _network_arrays),
    FactoredBrdf: _Kind("factored", "a factored table", lambda model: {"table": model.table}),
}
