"""Plant tilts in lists of samples, and count how often they are found, missed, or seen where there is none.

    python scripts/accuracy/tilted_samples.py [--materials 12] [--part report] [--seed 0] [--out FILE.md]

The materials are those of a part of the error bars' calibration (`scripts/verdict/drawn_cases.py`), made reciprocal: a
surrogate learned from a tilted measurement is tilted itself. Each is measured with 1% of noise in seven layouts: two
goniometer scans, fine in the plane of incidence and coarse elsewhere, three grids of rings, and pairs that are drawn
along the lobe or in the discs. Its sample leans by an angle, or it is upright and a fault of the instrument is planted.
At the end come the lists made of RGL's isotropic tables, whose tilt `brdf.quality.tilt` finds by reciprocity.
"""

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

from homofact.brdf.analytic.common import grazing
from homofact.brdf.quality.tilt import ReciprocalMean
from homofact.brdf.quality.tilt_finding import TiltAngle
from homofact.brdf.quality.tilt_of_samples import find_tilt_of_samples
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import open_source
from homofact.brdf.tilt import Tilt
from homofact.geometry.directions import from_spherical, normalize
from homofact.linear.threads import one_thread
from homofact.stability.fault import CasePart

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, finish, markdown, parser_of, progress
from scripts.verdict.drawn_cases import drawn_case
from scripts.verdict.planting import FAULTS

TILTS = (0.0, 0.05, -0.1, 0.2, -0.4)  # degrees
STRENGTHS = {
    "cosine of ωo in": 1.0,
    "divided by the cosine of ωi": 1.0,
    "drift with angle": 0.4,
    "drift in time": 0.3,
    "a bad ring": 0.3,
}
NOISE, DRAWN = 0.01, 2500
# Of θi, θo and Δφ in degrees.
GRIDS = {"rings 15 5 10": (15, 5, 10), "rings 10 10 20": (10, 10, 20), "rings 10 6 15": (10, 6, 15)}
LAYOUTS = ("fine scan", "scan", *GRIDS, "lobe", "discs")


@dataclass(frozen=True)
class Found:
    """What was found of one list: the planted tilt in degrees, the planted fault ("" for none), and the angle."""

    layout: str
    tilt: float
    fault: str
    angle: TiltAngle

    @property
    def right(self) -> bool:
        """Whether the angle is claimed and off by at most a third, or 0.03°."""
        return self.angle.claimed and abs(self.angle.degrees - self.tilt) <= max(0.03, abs(self.tilt) / 3)


def _grid(theta_i: Tensor, theta_o: Tensor, turn: Tensor) -> tuple[Tensor, Tensor]:
    i, o, phi = (each.reshape(-1).deg2rad() for each in torch.meshgrid(theta_i, theta_o, turn, indexing="ij"))
    return from_spherical(i, i * 0), from_spherical(o, phi)


def _steps(first: float, last: float, step: float) -> Tensor:
    return torch.arange(first, last + step / 2, step, dtype=torch.float64)


def directions(layout: str, model: Reflectance, seed: int) -> tuple[Tensor, Tensor]:
    """Return the pairs (N, 3) of a layout."""
    if layout in GRIDS:
        i, o, phi = GRIDS[layout]
        return _grid(_steps(0, 75, i), _steps(0, 80, o), _steps(0, 180, phi))
    if layout in ("lobe", "discs"):
        drawn = sample_model(model, DRAWN, layout, seed)  # type: ignore[arg-type]
        return drawn.wi, drawn.wo
    lights, step = ((10, 25, 40, 55, 70), 0.5) if layout == "fine scan" else ((15, 30, 45, 60), 1.0)
    angles = torch.tensor(lights, dtype=torch.float64)
    coarse = _grid(angles, _steps(0, 80, 5), _steps(0, 180, 15))
    near = [_grid(angle[None], angle + _steps(-4, 4, step), torch.tensor([180.0]).double()) for angle in angles]
    return tuple(torch.cat(parts) for parts in zip(coarse, *near, strict=True))  # type: ignore[return-value]


def measured(model: Reflectance, layout: str, degrees: float, seed: int) -> Samples:
    """Return the list that an instrument reports of a sample that leans by `degrees`."""
    wi, wo = directions(layout, model, seed)
    lit, seen = (normalize(w) for w in Tilt(math.radians(degrees)).true(wi, wo))
    above = torch.minimum(lit[:, 2], seen[:, 2]) > 0
    wi, wo, lit, seen = (w[above] for w in (wi, wo, lit, seen))
    values = model.evaluate(lit, seen).double() * grazing(seen[:, 2:]) / grazing(wo[:, 2:])
    noise = torch.randn(values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    return Samples(wi, wo, values * torch.exp(NOISE * noise), channels=model.channels, isotropic=True)


def planted(part: CasePart, materials: int, folder: Path, seed: int) -> Iterator[Found]:
    """Yield what is found of every material in every layout."""
    faults = {fault.name: fault for fault in FAULTS}
    for number in range(materials):
        case = drawn_case(part, number, folder, seed)
        model = ReciprocalMean(case.material)
        for layout in LAYOUTS:
            for degrees in TILTS:
                angle = find_tilt_of_samples(measured(model, layout, degrees, number)).in_plane
                yield Found(layout, degrees, "", angle)
            upright = measured(model, layout, 0.0, number)
            for name, strength in STRENGTHS.items():
                faulty = faults[name].plant(upright, strength, number)
                yield Found(layout, 0.0, name, find_tilt_of_samples(faulty).in_plane)
        progress(f"{number + 1} of {materials}: {case.name}")


def tables(found: list[Found]) -> list[str]:
    """By layout the lists in which each tilt is claimed and right, of how many; by fault the lists that are accused."""

    def cell(those: list[Found]) -> str:
        claimed = [each for each in those if each.angle.claimed]
        right = sum(each.right for each in claimed)
        words = f"{len(claimed)} of {len(those)}"
        return words if right == len(claimed) or not those[0].tilt else f"{words}, {right} right"

    rows = [
        (layout, *(cell([each for each in found if (each.layout, each.tilt, each.fault) == (layout, degrees, "")])
                   for degrees in TILTS))
        for layout in LAYOUTS
    ]  # fmt: skip
    accused = [(name, cell([each for each in found if each.fault == name])) for name in STRENGTHS]
    header = ("layout", *(f"{degrees:+g}°" if degrees else "no tilt" for degrees in TILTS))
    return [markdown(header, rows), markdown(("planted fault, no tilt", "a tilt is claimed"), accused)]


def of_tables(folder: Path) -> str:
    """The tilts of RGL's isotropic tables: by reciprocity, and by lists of pairs along the lobe drawn from them."""
    rows = []
    for path in sorted((folder / "rgl").glob("*_rgb.bsdf")):
        source = open_source(str(path))
        tilt = source.samples.provenance.get("tilt")
        if tilt is None:
            continue
        raw = open_source(str(path), calibrate=["none"]).samples
        listed = find_tilt_of_samples(replace(raw, provenance={})).in_plane
        angles = (tilt["in_plane"]["degrees"], listed.degrees)
        interval = f"{listed.low:+.3f} to {listed.high:+.3f}"
        claims = ("yes" if tilt["in_plane"]["claimed"] else "no", "yes" if listed.claimed else "no")
        rows.append((path.name.removesuffix("_rgb.bsdf"), f"{angles[0]:+.3f}", claims[0], f"{angles[1]:+.3f}",
                     interval, claims[1]))  # fmt: skip
        progress(rows[-1])
    return markdown(("file", "table, °", "undone", "list, °", "95% interval", "claimed"), rows)


@one_thread
def main(arguments: list[str] | None = None) -> int:
    """Print the tables."""
    parser = parser_of(__doc__, "out", "data")
    parser.add_argument("--materials", type=int, default=12)
    parser.add_argument("--part", choices=[part.value for part in CasePart], default=CasePart.REPORT.value)
    parser.add_argument("--seed", type=int, default=0)
    chosen: argparse.Namespace = parser.parse_args(arguments)
    folder = data_folder(chosen.data)
    materials = 1 if chosen.short else chosen.materials
    found = list(planted(CasePart(chosen.part), materials, folder, chosen.seed))
    if chosen.short:
        return finish(tables(found), chosen)
    return finish([*tables(found), of_tables(folder)], chosen)


if __name__ == "__main__":
    raise SystemExit(main())
