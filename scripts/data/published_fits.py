"""Evaluate five published methods' fits of the 100 MERL materials. Each fit is available by its name.

    nbrdf   networks of Sztrajman et al. 2021 (`homofact.brdf.neural`), 2700 bytes
    npf     factors of Bagher, Snyder and Nowrouzezahrai 2016 (`homofact.brdf.factored`), 3264 bytes
    nps     Neural Processes of Zheng et al. 2021: 28 bytes a material, and a decoder of 4 MB that all share
    abc     Löw, Kronander, Ynnerman and Unger 2012: 9 numbers
    sgd     Bagher, Soler and Holzschuch 2012: 33 numbers

The formulas are those of the parameters' own README. None is MERL: each is one reading of it. Names differ between the
files by hyphens alone.
"""

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel, grazing, half_vector, v_grooves
from homofact.brdf.analytic.cook_torrance import dielectric
from homofact.brdf.factored import FactoredBrdf
from homofact.brdf.formats.nbrdf import load, material_names
from homofact.geometry.coordinates import axes_of

PUBLISHED = ("nbrdf", "npf", "nps", "abc", "sgd")


@dataclass(frozen=True)
class Abc(AnalyticModel):
    """π f = kd + F D G/(cosθi cosθo), D = a/(1 + b (1 − cosθh))ᶜ, G of the V-grooves, F of a dielectric."""

    diffuse: tuple[float, ...]
    a: tuple[float, ...]
    b: float
    c: float
    index: float

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The model's values."""
        h, cosine = half_vector(wi, wo)
        ni, no = grazing(wi[:, 2]), grazing(wo[:, 2])
        fallen = (h[:, 0] ** 2 + h[:, 1] ** 2) / (1 + h[:, 2])
        lobe = dielectric(cosine, self.index) * (1 + self.b * fallen) ** -self.c * v_grooves(wi, wo) / (ni * no)
        return (self.colour(self.diffuse, wi) + lobe[:, None] * self.colour(self.a, wi)) / math.pi


@dataclass(frozen=True)
class Sgd(AnalyticModel):
    """π f = ρd + ρs F D G(θi) G(θo)/(cosθi cosθo), each with parameters of its own a channel."""

    numbers: Mapping[str, tuple[float, ...]]

    @property
    def nbytes(self) -> int:
        """33 numbers as float32."""
        return 4 * 33

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The model's values."""
        p = {name: torch.tensor(values, dtype=wi.dtype) for name, values in self.numbers.items()}
        h, cosine = half_vector(wi, wo)
        ni, no, peak = (grazing(x)[:, None] for x in (wi[:, 2], wo[:, 2], h[:, 2]))
        tangent = (1 - peak**2).clamp_min(0) / peak**2
        x = p["alpha"] + tangent / p["alpha"]
        distribution = p["kappa"] * torch.exp(-x) / (math.pi * x ** p["p"] * peak**4)
        fresnel = p["f0"] - cosine[:, None] * p["f1"] + (1 - cosine[:, None]).clamp_min(0) ** 5 * (1 - p["f0"])

        def masking(cosines: Tensor) -> Tensor:
            beyond = (torch.acos(cosines.clamp(-1, 1)) - p["theta0"]).clamp_min(0)
            return (1 + p["lambda"] * (1 - torch.exp(p["c"] * beyond ** p["k"]))).clamp(0, 1)

        lobe = p["rho_s"] * fresnel.clamp_min(0) * distribution * masking(ni) * masking(no) / (ni * no)
        return ((p["rho_d"] + lobe) / math.pi).clamp_min(0)


@dataclass(frozen=True)
class NeuralProcess(AnalyticModel):
    """The shared decoder at a latent vector of 7 numbers and the pair's angles."""

    latent: Tensor
    layers: tuple[tuple[Tensor, Tensor], ...]

    @property
    def nbytes(self) -> int:
        """The latent vector alone."""
        return 28

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The decoder's output, e^y − 1 taken four times, in float32."""
        angles = axes_of(("theta_h", "theta_d", "azimuth_d"), wi, wo).float()
        double = 2 * (angles[:, 2] % math.pi)
        inputs = (0.5 * double.cos() + 0.5, 0.5 * double.sin() + 0.5, *(angles[:, :2] / (math.pi / 2)).unbind(1))
        x = torch.cat((torch.stack(inputs, 1), self.latent.expand(len(wi), -1)), 1)
        for weight, bias in self.layers:
            x = torch.relu(torch.addmm(bias, x, weight))
        x = 0.15 * x
        for _ in range(4):
            x = torch.expm1(x)
        return x.to(wi)


def plain(name: str) -> str:
    """A material's name by letters and digits alone."""
    return "".join(c for c in name.lower() if c.isalnum())


def names(folder: Path) -> list[str]:
    """The materials that all five know, as the networks' file names them."""
    kept = set.intersection(*(set(_file(kind, folder)) for kind in PUBLISHED[1:]))
    return [name for name in material_names(_networks(folder)) if plain(name) in kept]


def published(kind: str, name: str, folder: Path) -> AnalyticModel:
    """One of `PUBLISHED` for a material of `names`."""
    if kind == "nbrdf":
        return load(f"{_networks(folder)}#{name}")
    return _file(kind, folder)[plain(name)]


def _networks(folder: Path) -> Path:
    return folder / "nbrdf" / "merl_nbrdf_weights.npz"


@lru_cache(maxsize=8)
def _file(kind: str, folder: Path) -> dict[str, AnalyticModel]:
    place = folder / "merl_fits"
    if kind == "npf":
        with np.load(place / "npf.npz") as data:
            tables = torch.from_numpy(data["table"]).double()
            return {plain(str(name)): FactoredBrdf(table) for name, table in zip(data["names"], tables, strict=True)}
    if kind == "nps":
        with np.load(place / "nps.npz") as data:
            layers = tuple((torch.from_numpy(data[f"w{k}"]), torch.from_numpy(data[f"b{k}"])) for k in range(7))
            latents = torch.from_numpy(data["latents"])
            return {plain(str(name)): NeuralProcess(z, layers) for name, z in zip(data["names"], latents, strict=True)}
    with (place / f"{kind}.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    make = {"abc": _abc, "sgd": _sgd}[kind]
    return {plain(row["name"]): make(row) for row in rows}


def _colour(row: Mapping[str, str], name: str) -> tuple[float, ...]:
    return tuple(float(row[f"{name}_{c}"]) for c in "rgb")


def _abc(row: Mapping[str, str]) -> Abc:
    return Abc(_colour(row, "kd"), _colour(row, "a"), float(row["b"]), float(row["c"]), float(row["ior"]))


def _sgd(row: Mapping[str, str]) -> Sgd:
    parts = ("rho_d", "rho_s", "alpha", "p", "f0", "f1", "kappa", "lambda", "c", "k", "theta0")
    return Sgd({name: _colour(row, name) for name in parts})
