"""Compare image metrics that need whole pictures with the grades that people gave (docs/people.md).

Spheres of MERL's approximations and of their readings are drawn under the lamps of the package's table: radiance on
rings of equal θ of the normal, from which a picture is interpolated, since the materials are isotropic. ABC has the
index of refraction of the table. ColorVideoVDP is compared too where `pycvvdp` is installed.

    python scripts/verdict/opinion_pictures.py --work FOLDER [--data FOLDER] [--out FILE]
"""

import dataclasses
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.evaluation import image_metrics
from homofact.evaluation.opinion import opinion_table
from homofact.files import extras
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import displayed

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.data.published_fits import Abc, names, published
from scripts.shared.harness import Finished, data_folder, finish, markdown, parser_of
from scripts.verdict import opinion_study as study
from scripts.verdict.opinions import STUDY

SIZE, RINGS, AZIMUTHS = 96, 40, 72
_NODES = (24, 16)
Metric = Callable[[Tensor, Tensor, Tensor], float]
METRICS: dict[str, Metric] = {
    "RMS of encoded values (PSNR)": lambda a, b, mask: 10 ** (-image_metrics.psnr(a, b, mask) / 20),
    "1 − SSIM": lambda a, b, mask: 1 - image_metrics.ssim(a, b, mask),
    "FLIP": image_metrics.flip,
    "CIEDE2000": image_metrics.ciede2000,
    "ΔE ITP": image_metrics.delta_e_itp,
}


class Spheres:
    """Pictures of spheres of isotropic materials under the lamps of the table."""

    def __init__(self) -> None:
        """The light at every node of every ring and azimuth, times its weight."""
        table = opinion_table()
        theta = (torch.arange(RINGS, dtype=torch.float64) + 0.5) * (math.pi / 2 / RINGS)
        self._wo = torch.stack((theta.sin(), torch.zeros_like(theta), theta.cos()), 1)
        self._wi, solid = hemisphere_nodes(self._wo, *_NODES)
        around = (torch.arange(AZIMUTHS, dtype=torch.float64) + 0.5) * (2 * math.pi / AZIMUTHS)
        weights = (solid * self._wi[..., 2])[..., None]
        towards = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
        self._light = []
        for ring in range(RINGS):
            sine, cosine = theta[ring].sin(), theta[ring].cos()
            normals = torch.stack((sine * around.cos(), sine * around.sin(), cosine.expand(AZIMUTHS)), 1)
            # The frame of a ring: its tangent points to the viewer, as `_wo` has it.
            tangent = towards - normals * cosine
            tangent = tangent / tangent.norm(dim=1, keepdim=True)
            frames = torch.stack((tangent, torch.linalg.cross(normals, tangent), normals), 1)
            self._light.append(table.light.radiance(self._wi[ring] @ frames) * weights[ring])
        white = torch.stack([light.sum(1) for light in self._light]) / math.pi
        shares = (theta.sin() * theta.cos())[:, None].expand(RINGS, AZIMUTHS)
        self._exposure = table.light.white / _median(white.amax(2), shares)
        self._lookup()

    def _lookup(self) -> None:
        """Which rings and azimuths each pixel lies between."""
        ticks = ((torch.arange(SIZE, dtype=torch.float64) + 0.5) / SIZE * 2 - 1) / 0.97
        y, x = torch.meshgrid(-ticks, ticks, indexing="ij")
        radius = torch.hypot(x, y)
        self.mask = radius < 1
        ring = (torch.asin(radius.clamp(max=1)) / (math.pi / 2) * RINGS - 0.5).clamp(0, RINGS - 1)
        turn = torch.remainder(torch.atan2(y, x), 2 * math.pi) / (2 * math.pi) * AZIMUTHS - 0.5
        self._rings = ring.floor().long(), (ring.floor().long() + 1).clamp(max=RINGS - 1), (ring % 1)[..., None]
        first = turn.floor().long()
        self._turns = first % AZIMUTHS, (first + 1) % AZIMUTHS, (turn - turn.floor())[..., None]

    def draw(self, reflectance: Reflectance) -> Tensor:
        """The picture of a material, encoded sRGB (H, W, 3)."""
        wo = self._wo[:, None].expand_as(self._wi)
        values = reflectance.evaluate(self._wi.reshape(-1, 3), wo.reshape(-1, 3)).double().reshape(*wo.shape[:2], 3)
        polar = torch.stack([(light * own).sum(1) for light, own in zip(self._light, values, strict=True)])
        (a, b, down), (c, d, across) = self._rings, self._turns
        near, far = (polar[ring, c] * (1 - across) + polar[ring, d] * across for ring in (a, b))
        image = SphereImage(near * (1 - down) + far * down, self.mask.double())
        return displayed(image, self._exposure, curve="srgb")


def _median(values: Tensor, shares: Tensor) -> float:
    order = values.reshape(-1).argsort()
    running = shares.reshape(-1)[order].cumsum(0)
    return float(values.reshape(-1)[order[int(torch.searchsorted(running, running[-1] / 2))]])


def all_metrics() -> dict[str, Metric]:
    """`METRICS`, and ColorVideoVDP on a display of full HD where it is installed."""
    if not extras.installed("pycvvdp"):
        return METRICS
    import pycvvdp  # pyright: ignore[reportMissingImports]

    judge = pycvvdp.cvvdp(display_name="standard_fhd")

    def jod(a: Tensor, b: Tensor, mask: Tensor) -> float:
        return 10 - float(judge.predict(b.float().numpy(), a.float().numpy(), dim_order="HWC")[0])

    return METRICS | {"10 − JOD of ColorVideoVDP": jod}


def measure(name: str, folder: Path, spheres: Spheres, metrics: dict[str, Metric]) -> dict[str, Any]:
    """Every metric of each approximation of a material beside its reading."""
    own = spheres.draw(published("nbrdf", name, folder))
    found = {}
    for method in STUDY:
        model = published(method, name, folder)
        if isinstance(model, Abc):
            model = dataclasses.replace(model, index=opinion_table().made_from["index_of_abc"])
        mine = spheres.draw(model)
        found[method] = {words: metric(own, mine, spheres.mask) for words, metric in metrics.items()}
    return found


def table_of(found: dict[str, Any], scores: dict[tuple[str, str], float], metrics: dict[str, Metric]) -> str:
    """Spearman's ρ of each metric with the scores."""
    cells = []
    for words in metrics:
        rows = [
            (method, values[method][words], scores[label, study.plain(material)])
            for method, label in STUDY.items()
            for material, values in found.items()
            if (label, study.plain(material)) in scores
        ]
        method, metric, score = (np.array(column) for column in zip(*rows, strict=True))
        parts = [np.ones(len(rows), dtype=bool), method != "abc", *(method == each for each in STUDY)]
        cells.append([words, *(f"{study.rank_correlation(metric[part], score[part]):.2f}" for part in parts)])
    return markdown(["metric", "all", "without ABC", *STUDY.values()], cells)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--work", type=Path, help="a folder in which finished materials are kept")
    chosen = parser.parse_args(arguments)
    folder = data_folder(chosen.data)
    try:
        scores = study.read_distances(folder / "perception" / "distances.csv")
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    metrics = all_metrics()
    spheres = Spheres()
    done = Finished(None if chosen.work is None else chosen.work / "opinion_pictures.jsonl")
    every = names(folder)[:: 20 if chosen.short else 1]
    found = {name: done.get(name, lambda name=name: measure(name, folder, spheres, metrics)) for name in every}
    return finish(table_of(found, scores, metrics), chosen)


if __name__ == "__main__":
    sys.exit(main())
