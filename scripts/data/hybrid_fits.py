"""Evaluate published fits of RGL materials by a microfacet model with a small neural network. Each material is
available by its name.

De Oliveira et al. 2026 add a small network to a GGX lobe over a diffuse base. Their viewer's page publishes a shader
for each material, `Ours_ld4_32x2_NAME_rgb.brdf`: eight parameters of the base, four of the material's place among all,
and the network, which all materials of RGL share. With x = (ωi, ωo, z), z the four numbers,

    f = max(0, exp(c) + sigmoid(g) (kd/π + F D G/(4 cosθi cosθo))),   (c, g) = W2 u(W1 u(W0 x + b0) + b1) + b2,

u(x) = x min(max(x + 3/2, 0), 3)/3, D and G of anisotropic GGX, F that of a dielectric with an index per channel. The
shaders state the weights with three digits behind the point. Nothing of the files is part of this project: their
licence allows research alone. A folder of them has to be at hand.
"""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel, grazing, half_vector
from homofact.brdf.analytic.cook_torrance import dielectric
from homofact.errors import BadInput
from homofact.files.reading import read_bytes

# Inputs and outputs of each layer: two directions and four numbers; the correction and the gate of three channels.
LAYERS = ((10, 32), (32, 32), (32, 6))
_EXPECTED = "a shader of the hybrid's page: parameters and mlp_eval"
_PARAMETER = re.compile(r"^float (\w+) \S+ \S+ (\S+)$", re.MULTILINE)
_STATEMENT = re.compile(r"\bf(\d)_(\d) = ([^;]*);")
_BLOCK = re.compile(r"mat(\d)(?:x(\d))?\(([^)]*)\) \* f\d_(\d)")
_BIAS = re.compile(r"\+ vec\d\(([^)]*)\)")


@dataclass(frozen=True)
class HybridBrdf(AnalyticModel):
    """The formula of the module's head: `weights` (inputs, outputs) and `biases` of the sizes of `LAYERS`."""

    diffuse: tuple[float, ...]
    index: tuple[float, ...]
    roughness: tuple[float, ...]
    latent: tuple[float, ...]
    weights: tuple[Tensor, ...]
    biases: tuple[Tensor, ...]

    @property
    def isotropic(self) -> bool:
        """False: the network is given the directions themselves, whatever their azimuth."""
        return False

    @property
    def nbytes(self) -> int:
        """The material's own twelve numbers and the network, as float32."""
        own = len(self.diffuse + self.index + self.roughness + self.latent)
        return 4 * own + self.shared_nbytes

    @property
    def shared_nbytes(self) -> int:
        """Bytes of the network, which all materials of the database share."""
        return 4 * sum(part.numel() for part in (*self.weights, *self.biases))

    def base(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The GGX lobe over the diffuse base, (N, 3) in sr⁻¹."""
        h, cosine = half_vector(wi, wo)
        ax, ay = self.roughness
        spread = (h[:, 0] / ax) ** 2 + (h[:, 1] / ay) ** 2 + h[:, 2] ** 2
        peak = 1 / (math.pi * ax * ay * spread**2)
        masked = [2 / (1 + (1 + ((w[:, 0] * ax) ** 2 + (w[:, 1] * ay) ** 2) / grazing(w[:, 2]) ** 2).sqrt())
                  for w in (wi, wo)]  # fmt: skip
        lobe = peak * masked[0] * masked[1] / (4 * grazing(wi[:, 2]) * grazing(wo[:, 2]))
        fresnel = torch.stack([dielectric(cosine, index) for index in self.index], 1)
        return self.colour(self.diffuse, wi) / math.pi + fresnel * lobe[:, None]

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The base under the network's gate, and the network's correction."""
        x = torch.cat((wi, wo, torch.tensor(self.latent, dtype=wi.dtype).expand(len(wi), -1)), 1)
        layers = [(w.to(wi), b.to(wi)) for w, b in zip(self.weights, self.biases, strict=True)]
        for weight, bias in layers[:-1]:
            x = x @ weight + bias
            x = x * (x + 1.5).clamp(0, 3) / 3
        weight, bias = layers[-1]
        correction, gate = (x @ weight + bias).split(3, 1)
        return (correction.exp() + gate.sigmoid() * self.base(wi, wo)).clamp_min(0)


def hybrid_file(folder: Path, name: str) -> Path:
    """Where a folder of the page's shaders keeps a material of RGL."""
    return folder / f"Ours_ld4_32x2_{name}_rgb.brdf"


def read_hybrid(path: Path) -> HybridBrdf:
    """The material of one shader. Raises BadInput where the file is missing, or is no such shader."""
    text = read_bytes(path, _EXPECTED).decode("utf-8", "replace")
    found = dict(_PARAMETER.findall(text))
    try:
        diffuse, index, roughness, latent = (
            tuple(float(found[f"{kind}_{part}"]) for part in parts)
            for kind, parts in (("diffuse", "rgb"), ("eta", "rgb"), ("alpha", "xy"), ("latent", "0123"))
        )
        layers = _layers(text)
    except (KeyError, ValueError) as error:
        raise BadInput(f"cannot be read ({error})", where=path, expected=_EXPECTED) from error
    weights, biases = zip(*layers, strict=True)
    for k, (weight, bias, shape) in enumerate(zip(weights, biases, LAYERS, strict=True)):
        if tuple(weight.shape) != shape or tuple(bias.shape) != shape[1:] or not bool(weight.isfinite().all()):
            raise BadInput(f"layer {k} has {tuple(weight.shape)} weights", where=path, expected=f"{shape}, finite")
    return HybridBrdf(diffuse, index, roughness, latent, weights, biases)


def _layers(text: str) -> list[tuple[Tensor, Tensor]]:
    """(weights, biases) of each layer; GLSL states a matrix column by column, and a column is an input's weights."""
    parts: dict[int, dict[int, tuple[Tensor, Tensor]]] = {}
    for layer, part, expression in _STATEMENT.findall(text):
        blocks: dict[int, Tensor] = {}
        for columns, rows, numbers, source in _BLOCK.findall(expression):
            values = torch.tensor([float(x) for x in numbers.split(",")], dtype=torch.float64)
            blocks[int(source)] = values.reshape(int(columns), int(rows or columns))
        bias = _BIAS.search(expression)
        if not blocks or bias is None:
            continue
        weight = torch.cat([blocks[k] for k in sorted(blocks)])
        own = torch.tensor([float(x) for x in bias[1].split(",")], dtype=torch.float64)
        parts.setdefault(int(layer), {})[int(part)] = weight, own
    if len(parts) != len(LAYERS):
        raise ValueError(f"{len(parts)} of {len(LAYERS)} layers")
    made = []
    for layer in sorted(parts):
        own = [parts[layer][k] for k in sorted(parts[layer])]
        made.append((torch.cat([weight for weight, _ in own], 1), torch.cat([bias for _, bias in own])))
    return made
