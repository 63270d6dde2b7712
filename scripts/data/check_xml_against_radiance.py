"""Compare homofact's reading and writing of WINDOW and Radiance XML and pab-opto tables with Radiance's programs.

Radiance comes with pyradiance (`pip install pyradiance`, of any environment: `--python` names its interpreter). Four
comparisons, Y throughout:

- read: real files, ours and Radiance's value at random pairs of directions;
- written: a model, or a fit of a measured paint, written as a Klems matrix and as a tensor tree. Radiance's values at
  the middles of random pairs of bands (of the matrix), and of its program bsdf2klems (of the tree), beside means over
  the bands that are computed anew from the fit with other points;
- hemispherical: what Radiance says the written matrix reflects of the light at 0 to 80 degrees, beside the fit's own;
- pab-opto: tables of a model with a highlight and a lobe off the plane, made a matrix by pabopto2bsdf and bsdf2klems,
  beside the model's means, and beside those with left and right exchanged.

Radiance changes values by up to 0.03% of themselves on purpose, by their place in the matrix.
"""

import argparse
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

import homofact
from homofact.brdf.formats import open_file, window_writer
from homofact.brdf.klems import FULL, KlemsTable, opposite, planar
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance, innermost
from homofact.brdf.tristimulus import CieY
from homofact.errors import BadInput, MissingDependency
from homofact.geometry.directions import draw_uniform, from_spherical, to_spherical
from homofact.geometry.quadrature import hemisphere_nodes

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, markdown

COUNT, BANDS, POINTS, SEED = 5000, 1500, 8192, 11
REAL = ("klems_mcs6216", "klems_blinds", "tensortree_blinds")
SIDES = ("front", "back")
# A value, or what a side reflects: arguments are a file, pairs (.npy, N rows of four angles in degrees) and the answer.
_PROGRAM = """
import sys, numpy
from pyradiance import bsdf
path, given, answer = sys.argv[1:]
held = bsdf.load_file(path)
rows = numpy.load(given)
if rows.shape[1] == 4:
    found = [bsdf.query(held, *map(float, row))[1] for row in rows]
else:
    found = [bsdf.direct_hemi(held, float(row[0]), float(row[1]), int(row[2])) for row in rows]
numpy.save(answer, found)
"""


class Radiance:
    """Radiance's library and programs in another interpreter's environment.

    Raises MissingDependency where there is no pyradiance.
    """

    def __init__(self, python: str) -> None:
        self._python = python
        where = "import pyradiance, os; print(os.path.dirname(pyradiance.__file__), pyradiance.__version__)"
        done = subprocess.run([python, "-c", where], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise MissingDependency(f"{python}: no pyradiance, expected it there: pip install pyradiance")
        folder, self.version = done.stdout.split()
        self._programs = Path(folder) / "bin"

    def values(self, path: Path, side: str, wi: Tensor, wo: Tensor) -> Tensor:
        """Y (N,) at directions (N, 3) in the frame of a side of the file. Raises BadInput where Radiance refuses."""
        sign = torch.tensor([-1.0, 1, -1] if side == "front" else [1.0, 1, 1], dtype=wi.dtype)
        angles = [angle.rad2deg() for w in (wi, wo) for angle in to_spherical(w * sign)]
        return self._asked(path, torch.stack(angles, 1))

    def reflected(self, path: Path, theta: Tensor) -> Tensor:
        """What the file's Reflection Back reflects of light at θ (N,) in degrees."""
        # All of it: there is no transmission in these files.
        return self._asked(path, torch.stack((theta, 0 * theta, 0 * theta + 15), 1))

    def _asked(self, path: Path, rows: Tensor) -> Tensor:
        with tempfile.TemporaryDirectory() as folder:
            given, answer = Path(folder) / "given.npy", Path(folder) / "answer.npy"
            np.save(given, rows.double().numpy())
            command = [self._python, "-c", _PROGRAM, str(path), str(given), str(answer)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise BadInput(f"{path}: Radiance failed: {' '.join(done.stderr.split())[-300:]}")
            return torch.from_numpy(np.load(answer)).double()

    def made(self, out: Path, program: str, *arguments: str) -> None:
        """What a program writes to its standard output, in `out`. Raises BadInput where it fails."""
        with open(out, "wb") as file:
            command = [str(self._programs / program), *arguments]
            # Its programs call each other, and read files of their own.
            found = {"PATH": f"{self._programs}{os.pathsep}{os.environ['PATH']}"}
            found |= {"RAYPATH": f".{os.pathsep}{self._programs.parent / 'lib'}"}
            done = subprocess.run(command, stdout=file, stderr=subprocess.PIPE, check=False, env=os.environ | found)
        if done.returncode != 0:
            raise BadInput(f"{program} failed: {' '.join(done.stderr.decode().split())[-300:]}")


def band_means(reflectance: Reflectance, light: Tensor, view: Tensor, flipped: bool = False) -> Tensor:
    """Y (N,) of pairs of bands (N,), means over points of their own."""
    draws = torch.quasirandom.SobolEngine(4, scramble=True, seed=SEED).draw(POINTS, dtype=torch.float64)
    found = []
    for i, o in zip(light.tolist(), view.tolist(), strict=True):
        one = _within(i, draws[:, :2])
        other = _within(o, draws[:, 2:])
        pair = (planar(opposite(one), flipped), planar(other, flipped))
        found.append(reflectance.evaluate(*pair)[:, 0].double().mean())
    return torch.stack(found)


def _within(band: int, draws: Tensor) -> Tensor:
    ring, place = int(FULL.rings[band]), int(FULL.places[band])
    low, high = (math.cos(math.radians(FULL.bounds[ring + k])) ** 2 for k in (0, 1))
    theta = torch.acos((low + (high - low) * draws[:, 0]).sqrt().clamp(0, 1 - 1e-12))
    return from_spherical(theta, 2 * math.pi * (place + draws[:, 1] - 0.5) / FULL.counts[ring])


def quantiles(found: Tensor, wanted: Tensor) -> list[str]:
    """Median, 99th percentile and largest relative difference, and the difference of the sums."""
    off = ((found - wanted).abs() / wanted.abs().clamp_min(1e-9)).sort().values
    cells = [f"{float(off[min(int(q * len(off)), len(off) - 1)]):.2%}" for q in (0.5, 0.99, 1)]
    return [*cells, f"{float(found.sum() / wanted.sum() - 1):+.2%}"]


def read_rows(radiance: Radiance, folder: Path) -> list[list[str]]:
    """Real files, both sides."""
    wi, wo = draw_uniform(COUNT, torch.Generator().manual_seed(SEED))
    rows = []
    for name in REAL:
        for side in SIDES:
            path = folder / "lighting" / f"{name}.xml"
            reflectance = open_file(f"{path}#{side}").reflectance
            assert reflectance is not None
            ours = reflectance.evaluate(wi, wo)[:, 0]
            rows.append([f"read {name}, {side}", *quantiles(radiance.values(path, side, wi, wo), ours)])
    return rows


def written_rows(
    radiance: Radiance, name: str, reflectance: Reflectance, isotropic: bool, folder: Path
) -> list[list[str]]:
    """A reflectance as a matrix and as a tree, evaluated by Radiance."""
    luminance = CieY(reflectance)
    matrix, tree, resampled = (folder / f"{kind}.xml" for kind in ("matrix", "tree", "resampled"))
    window_writer.write_klems(matrix, reflectance, isotropic, name)
    window_writer.write_tree(tree, reflectance, isotropic, name)
    generator = torch.Generator().manual_seed(SEED)
    # Half at random, half where the highlight is: the light's own number is that of the mirror direction.
    light = torch.randint(FULL.size, (BANDS,), generator=generator)
    view = torch.where(torch.arange(BANDS) % 2 == 0, light, torch.randint(FULL.size, (BANDS,), generator=generator))
    rows = []
    for side in SIDES:
        flipped = side == "front"
        wanted = band_means(luminance, light, view, flipped)
        wi, wo = planar(opposite(FULL.middles()[light]), flipped), planar(FULL.middles()[view], flipped)
        rows.append([f"{name}, matrix, {side}", *quantiles(radiance.values(matrix, side, wi, wo), wanted)])
    radiance.made(resampled, "bsdf2klems", str(tree))
    table = innermost(_opened(f"{resampled}#back"))
    assert isinstance(table, KlemsTable)
    found = _luminance(table)[light, view]
    rows.append([f"{name}, tree by bsdf2klems", *quantiles(found, band_means(luminance, light, view))])
    theta = torch.arange(0, 81, 10, dtype=torch.float64)
    means = torch.stack([_hemispherical(luminance, float(t)) for t in _spread(theta)]).reshape(len(theta), -1).mean(1)
    rows.append([f"{name}, reflected at 0 to 80°", *quantiles(radiance.reflected(matrix, theta), means)])
    return rows


def _opened(path: str) -> Reflectance:
    reflectance = open_file(path).reflectance
    assert reflectance is not None
    return reflectance


def _luminance(table: KlemsTable) -> Tensor:
    values = CieY(table)
    wi, wo = opposite(FULL.middles()), FULL.middles()
    pairs = (wi[:, None].expand(145, 145, 3).reshape(-1, 3), wo.repeat(145, 1))
    return values.evaluate(*pairs).reshape(145, 145)


def _spread(theta: Tensor) -> Tensor:
    """Angles evenly in cos² over the band of each θ, which is all that the matrix knows of it."""
    rows = []
    for t in theta.tolist():
        ring = next(k for k in range(len(FULL.counts)) if t < FULL.bounds[k + 1])
        low, high = (math.cos(math.radians(FULL.bounds[ring + k])) ** 2 for k in (0, 1))
        rows.append(torch.acos((low + (high - low) * (torch.arange(16) + 0.5) / 16).sqrt()).rad2deg())
    return torch.cat(rows)


def _hemispherical(reflectance: Reflectance, theta: float) -> Tensor:
    wi = from_spherical(torch.tensor(math.radians(theta)), torch.tensor(math.pi)).double()
    wo, solid = hemisphere_nodes(wi[None])
    values = reflectance.evaluate(wi.expand(wo.shape[1], 3), wo[0])[:, 0]
    return (values * solid[0] * wo[0, :, 2]).sum()


def _lopsided(wi: Tensor, wo: Tensor) -> Tensor:
    """f (N,): a highlight, and a lobe left of it seen against the light."""
    mirror = wi * wi.new_tensor([-1.0, -1, 1])
    phi = torch.atan2(mirror[:, 1], mirror[:, 0]) + 0.9
    left = from_spherical(torch.full_like(phi, 0.7), phi)
    return 0.05 + 0.8 * torch.exp(-12 * (1 - (wo * mirror).sum(1))) + 0.4 * torch.exp(-12 * (1 - (wo * left).sum(1)))


def pabopto_rows(radiance: Radiance, folder: Path) -> list[list[str]]:
    """Tables of light all round, read by us exactly, and by Radiance's programs as a matrix."""
    theta, phi = (
        x.reshape(-1) for x in torch.meshgrid(torch.arange(0, 86, 3.0), torch.arange(0, 360, 6.0), indexing="ij")
    )
    wo = from_spherical(theta.deg2rad(), phi.deg2rad()).double()
    files = []
    for light, turn in [(0, 0), *((t, p) for t in (15, 30, 45, 60, 75) for p in range(0, 360, 30))]:
        wi = from_spherical(torch.tensor(math.radians(light)), torch.tensor(math.radians(turn))).double()
        values = _lopsided(wi.expand(len(wo), 3), wo) * wo[:, 2]
        head = f'#sample_name "lopsided"\n#format: theta phi DSF\n#intheta {light}\n#inphi {turn}\n#upphi 90\n'
        rows = [f"{t:g} {p:g} {v:.8g}" for t, p, v in zip(theta.tolist(), phi.tolist(), values.tolist(), strict=True)]
        files.append(folder / f"scan_{light}_{turn}.txt")
        files[-1].write_text(head + "\n".join(rows) + "\n")
    samples = open_file(files[0]).samples
    rows = [["pab-opto, our samples", *quantiles(samples.values[:, 0], _lopsided(samples.wi, samples.wo))]]
    radiance.made(folder / "scan.sir", "pabopto2bsdf", *map(str, files))
    radiance.made(folder / "scan.xml", "bsdf2klems", str(folder / "scan.sir"))
    table = innermost(_opened(str(folder / "scan.xml")))
    assert isinstance(table, KlemsTable)
    inner = (FULL.rings < 8).nonzero()[:, 0]
    light, view = (x.reshape(-1) for x in torch.meshgrid(inner, inner, indexing="ij"))
    wi, wo = planar(opposite(FULL.middles()[light]), table.flipped), planar(FULL.middles()[view], table.flipped)
    found = table.evaluate(wi, wo)[:, 0]
    side = "front" if table.flipped else "back"
    for name, sign in (("", 1.0), (", left and right exchanged", -1.0)):
        change = torch.tensor([1.0, sign, 1.0], dtype=torch.float64)
        rows.append([f"pab-opto by Radiance ({side}){name}", *quantiles(found, _lopsided(wi * change, wo * change))])
    return rows


def main() -> int:
    """Print the table; 2 where pyradiance is missing or the 99th percentile of a written matrix is above 1%."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="folder of real measurements")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has pyradiance")
    arguments = parser.parse_args()
    data = data_folder(arguments.data)
    try:
        radiance = Radiance(arguments.python)
        rows = read_rows(radiance, data)
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            for name in ("lafortune-blue-paint", "ward-brushed"):
                model = material(name).model
                rows += written_rows(radiance, name, model, model.isotropic, folder)
            fit = homofact.fit(str(data / "cornell" / "garnet_red.brdf"), seed=0)
            rows += written_rows(radiance, "fit of garnet_red", fit.factorization, True, folder)
            rows += pabopto_rows(radiance, folder)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    print(f"pyradiance {radiance.version}. Real files at {COUNT} pairs, {BANDS} pairs of bands, seed {SEED}.\n")
    print(markdown(["comparison", "median", "99%", "max", "sum"], rows))
    written = [cells for cells in rows if ", matrix, " in cells[0]]
    return 0 if all(float(cells[2].rstrip("%")) <= 1 for cells in written) else 2


if __name__ == "__main__":
    sys.exit(main())
