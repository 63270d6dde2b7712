"""Read the factors that McCool published (University of Waterloo CGL): two 8-bit parabolic maps p and q, whose
product p(ωi) q(h) p(ωo) is the BRDF.

Each paint has two PNG files and a text file (name, number of specular maps, an RGB scale, a range). Neither
the absolute scale nor the reading of the texels is documented with them. So a constant for each channel is
fitted before anything is compared, and the reading is the candidate that fits measured training samples
best. The textures are symmetric under mirroring and transposition (`asymmetry` says how far), so that which
way they are held makes no difference to an isotropic material. A texel of 0 says only that a value was
under the resolution: it is read as 0 or as half of a step, again by what fits.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.geometry.directions import normalize
from homofact.geometry.parabolic import to_disc
from homofact.linear.bilinear import lookup

FILES = {
    "garnet_red": ("garnetred/garnetred64_0.png", "garnetred/garnetred64_1.png", "garnetred/garnetred64.txt"),
    "krylon_blue": (
        "krylonblue/krylonbluep.png",
        "krylonblue/krylonblueq.png",
        "krylonblue/krylonblue.txt",
    ),
    "cayman": ("cayman/cayman_0.png", "cayman/cayman_1.png", "cayman/cayman.txt"),
}
STEP = 1 / 255
SUBSET = 2000


@dataclass(frozen=True)
class Convention:
    """One way to read the textures.

    `encoding`: texel = value ("linear"), value^(1/2.2) ("gamma"), or 1 + log value / log range ("log").
    `disc`: "parabolic" coordinates of a direction, or its x and y ("orthographic"). `rim`: the disc's rim at
    the "centre" of the outermost texels or at their outer "edge". `cosine`: the product is f cosθi.
    """

    encoding: str
    disc: str
    rim: str
    cosine: bool

    def __str__(self) -> str:
        """In words."""
        product = "f·cosθi" if self.cosine else "f"
        return f"{self.encoding} texels, {self.disc} map, rim at the texel {self.rim}, product = {product}"


CONVENTIONS = tuple(
    Convention(*choice)
    for choice in itertools.product(
        ("linear", "gamma", "log"), ("parabolic", "orthographic"), ("centre", "edge"), (False, True)
    )
)


@dataclass(frozen=True)
class PublishedTextures:
    """The factors of one paint under a convention; a `Reflectance` up to the constant for each channel.

    `p`, `q` are texel codes / 255 (rows, columns, 3); `span` the fourth line of the text file; `zero` what a
    code of 0 is read as; `constant` (3,).
    """

    p: Tensor
    q: Tensor
    span: float
    convention: Convention = CONVENTIONS[0]
    zero: float = 0.0
    constant: tuple[float, float, float] = (1.0, 1.0, 1.0)
    channels: tuple[str, ...] = ("R", "G", "B")

    @property
    def nbytes(self) -> int:
        """Bytes of the 8-bit texels."""
        return self.p.numel() + self.q.numel()

    @property
    def fetches(self) -> int:
        """p twice and q once."""
        return 3

    @property
    def zeros(self) -> int:
        """Texel values that are 0, channels counted apart."""
        return int((self.p == 0).sum() + (self.q == 0).sum())

    @property
    def asymmetry(self) -> int:
        """The largest difference, in steps of 255, between a texture and its mirror images and transpose."""
        return max(
            round(float((texture - other).abs().max()) / STEP)
            for texture in (self.p, self.q)
            for other in (texture.flip(0), texture.flip(1), texture.transpose(0, 1))
        )

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Values (N, 3), in sr⁻¹ once the constant is fitted to values in sr⁻¹; 0 under the horizon."""
        product = self._at(self.p, wi) * self._at(self.q, normalize(wi + wo)) * self._at(self.p, wo)
        if self.convention.cosine:
            product = product / wi[:, 2:].clamp_min(1e-3)
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        return product * torch.tensor(self.constant, dtype=wi.dtype) * above[:, None]

    def _at(self, codes: Tensor, w: Tensor) -> Tensor:
        values = torch.where(codes == 0, torch.full_like(codes, self.zero), codes)
        if self.convention.encoding == "gamma":
            values = values**2.2
        elif self.convention.encoding == "log":
            values = self.span ** (values - 1)
        uv = to_disc(w) if self.convention.disc == "parabolic" else w[:, :2]
        if self.convention.rim == "edge":
            uv = uv * (codes.shape[0] / (codes.shape[0] - 1))
        return lookup(values, uv)


def read(folder: Path, name: str) -> PublishedTextures:
    """The textures of one paint of `FILES` under the first convention. Raises BadInput for files that are none."""
    first, second, text = (folder / file for file in FILES[name])
    codes = []
    for path in (first, second):
        try:
            with Image.open(path) as image:
                codes.append(torch.from_numpy(np.asarray(image.convert("RGB"), dtype=np.float64) * STEP))
        except OSError as error:
            raise BadInput(f"cannot be read ({error})", where=path, expected="an 8-bit RGB PNG") from error
    try:
        span = float(text.read_text(encoding="utf-8").split("\n")[3])
    except (OSError, ValueError, IndexError) as error:
        raise BadInput(f"cannot be read ({error})", where=text, expected="four lines, the last a number") from error
    return PublishedTextures(codes[0], codes[1], span)


def best_constant(found: Tensor, expected: Tensor, transform: LogTransform) -> Tensor:
    """The constants c (C,) for values (N, C) that minimise the Cole error of c · found against `expected`.

    On a grid of log c, then on finer ones around the best; not quite the mean log ratio, because of ε.
    """
    target = transform.forward(expected)
    best = []
    for channel in range(found.shape[1]):
        single = LogTransform(transform.epsilon, transform.mean[channel : channel + 1])
        # Around the ratio of the means, so that the unit of the values does not matter.
        centre = float(torch.log(expected[:, channel].mean() / found[:, channel].mean()))
        for reach in (8.0, 0.8, 0.08, 0.008, 0.0008):
            logs = centre + torch.linspace(-reach, reach, 33, dtype=torch.float64)
            scaled = torch.exp(logs)[:, None, None] * found[:, channel : channel + 1]
            errors = ((single.forward(scaled) - target[:, channel : channel + 1]) ** 2).mean((1, 2))
            centre = float(logs[errors.argmin()])
        best.append(centre)
    return torch.exp(torch.tensor(best, dtype=torch.float64))


def cole_error(textures: PublishedTextures, samples: Samples, transform: LogTransform) -> float:
    """The Cole error of the textures as they are."""
    found = transform.forward(textures.evaluate(samples.wi, samples.wo))
    return float(((found - transform.forward(samples.values)) ** 2).mean())


def calibrated(textures: PublishedTextures, samples: Samples, transform: LogTransform) -> PublishedTextures:
    """The textures with the constants, and the reading of a zero texel, that fit `samples` best."""
    choices = []
    for zero in (0.0, STEP / 2):
        plain = replace(textures, zero=zero, constant=(1.0, 1.0, 1.0))
        constant = best_constant(plain.evaluate(samples.wi, samples.wo), samples.values, transform)
        red, green, blue = constant.tolist()
        choices.append(replace(plain, constant=(red, green, blue)))
    return min(choices, key=lambda choice: cole_error(choice, samples, transform))


def choose_convention(
    paints: Sequence[tuple[PublishedTextures, Samples, LogTransform]],
) -> list[tuple[float, Convention]]:
    """(error, convention), best first: the geometric mean over the paints of the calibrated Cole error.

    At most SUBSET of each paint's samples are looked at.
    """
    table = []
    # Textures that are the same at every azimuth gain nothing from more copies of a sample.
    paints = [(textures, samples.subset(SUBSET, 0), transform) for textures, samples, transform in paints]
    for convention in CONVENTIONS:
        logs = []
        for textures, samples, transform in paints:
            fitted = calibrated(replace(textures, convention=convention), samples, transform)
            logs.append(np.log(cole_error(fitted, samples, transform)))
        table.append((float(np.exp(np.mean(logs))), convention))
    return sorted(table, key=lambda row: row[0])
