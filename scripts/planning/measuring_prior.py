"""Make the prior of `homofact measure` (`homofact/measuring/prior.json`) of surrogates of MERL and RGL materials.

All 100 neural surrogates of MERL, and those of RGL but for families (`RELATED`) of which a measurement is in shared
data: these judge the choice of directions (`measuring_choices.py`). Each is drawn at `COUNT` pairs, and the nodes of
the grid are fitted to the logarithm of its brightness and to the ratios of its channels.

Materials that the statistics leave out show what to expect: a fifth of the families at a time, and all of RGL's under
statistics of MERL's alone, after 5, 10 and 20 directions that were chosen in rounds of 5. `--every N` takes every Nth
of them. Real materials differ from surrogates more than these from one another. The factors on the intervals
(`widening`) are therefore set on every second RGL file (`measured_files`); the others test them.

    python scripts/planning/measuring_prior.py [--write] [--data FOLDER] [--every N]
    python scripts/planning/measuring_prior.py --widen [--write] [--data FOLDER]
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from homofact.brdf.formats.nbrdf import load, material_names
from homofact.brdf.pair_density import RIM, draw_lobe
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import open_source
from homofact.geometry.directions import draw_in_discs
from homofact.measuring.aims import measuring_aims
from homofact.measuring.foretelling import COVERED, AimErrors, Foretold, aim_errors, foretold
from homofact.measuring.goniometer import Goniometer, directions_of
from homofact.measuring.half_grid import HalfGrid
from homofact.measuring.posterior import BrdfPosterior, after_values, before_samples
from homofact.measuring.prior import EPSILON, TABLE, BrdfPrior, read_prior
from homofact.measuring.rounds import chosen_angles

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, finish, markdown, parser_of, progress, write
from scripts.verdict.drawn_cases import MORE_NETWORKS, NETWORKS

# Beginnings of RGL's names: families of which a measurement is at hand.
RELATED = ("aurora", "cc_", "chm_", "cm_", "irid_flake", "vch_")
COUNT, SEED = 16_000, 20261126
# Of second and first differences between nodes.
_SMOOTH, _LEVEL = 0.03, 0.003
COUNTS, ROUND = (5, 10, 20), 5


@dataclass(frozen=True)
class Surrogate:
    """One material of the table."""

    name: str
    material: Reflectance

    @property
    def family(self) -> str:
        """What is left out together: RGL's names begin with their family."""
        database, name = self.name.split("/")
        return self.name if database == "merl" else f"rgl/{name.split('_')[0]}"


def surrogates(folder: Path) -> list[Surrogate]:
    """All materials of the table."""
    found = [
        Surrogate(f"merl/{name}", load(f"{folder / NETWORKS}#{name}")) for name in material_names(folder / NETWORKS)
    ]
    names = [name for name in material_names(folder / MORE_NETWORKS) if not name.startswith(RELATED)]
    return found + [Surrogate(f"rgl/{name}", load(f"{folder / MORE_NETWORKS}#{name}")) for name in names]


def values_at(material: Reflectance, wi: torch.Tensor, wo: torch.Tensor) -> np.ndarray:
    """Values (N, C) in float64, not negative."""
    return material.evaluate(wi, wo).double().clamp_min(0).numpy()


class NodeFit:
    """Values at the nodes of a grid by least squares, smooth where no pair is; one factorization for all materials."""

    def __init__(self, grid: HalfGrid, count: int = COUNT) -> None:
        """Draw the pairs, half of them by lobes."""
        from scipy import sparse
        from scipy.sparse.linalg import splu

        chance = torch.Generator().manual_seed(SEED)
        parts = (draw_lobe(count // 2, chance), draw_in_discs(count - count // 2, chance, RIM))
        self.wi, self.wo = (torch.cat([part[which] for part in parts]) for which in (0, 1))
        # Grazing pairs show little in any picture, and networks say little of them.
        self.weight = (4 * (self.wi[:, 2] * self.wo[:, 2]).sqrt()).clamp_max(1).numpy()
        self.rows = sparse.diags(self.weight) @ grid.matrix(self.wi, self.wo)
        smooth = sparse.vstack(list(_differences(grid)))
        self.solver = splu((self.rows.T @ self.rows + smooth.T @ smooth).tocsc())

    def of(self, material: Reflectance) -> tuple[np.ndarray, np.ndarray]:
        """L (n,) and the ratios (C, n) of a material."""
        values = values_at(material, self.wi, self.wo)
        bright = values.mean(1)
        given = np.column_stack((np.log(bright + EPSILON), (values + EPSILON) / (bright + EPSILON)[:, None]))
        found = self.solver.solve(self.rows.T @ (self.weight[:, None] * given))
        return found[:, 0], found[:, 1:].T.clip(0)


def _differences(grid: HalfGrid) -> Iterator[object]:
    from scipy import sparse

    numbers = np.arange(grid.size).reshape(grid.shape)
    for axis in range(3):
        along = np.moveaxis(numbers, axis, -1)
        for weight, pattern in ((_SMOOTH, (1.0, -2.0, 1.0)), (_LEVEL, (1.0, -1.0))):
            steps = along.shape[-1] - len(pattern) + 1
            columns = [along[..., start : start + steps].reshape(-1) for start in range(len(pattern))]
            count = len(columns[0])
            data = np.concatenate([np.full(count, weight * each) for each in pattern])
            place = (np.tile(np.arange(count), len(pattern)), np.concatenate(columns))
            yield sparse.csr_matrix((data, place), shape=(count, grid.size))


def measured_rounds(
    prior: BrdfPrior, material: Reflectance, goniometer: Goniometer, count: int, each: int = ROUND, noise: float = 0.0
) -> Iterator[tuple[int, np.ndarray, BrdfPosterior]]:
    """(directions so far, their angles, what they tell) after each round of measuring a known material."""
    posterior = before_samples(prior, 3)
    angles = np.zeros((0, 3))
    chance = np.random.default_rng(SEED)
    values = np.zeros((0, 3))
    while len(angles) < count:
        chosen = chosen_angles(prior, posterior, goniometer, min(each, count - len(angles)))
        new = values_at(material, *directions_of(chosen))
        values = np.concatenate((values, new * np.exp(noise * chance.standard_normal(new.shape))))
        angles = np.concatenate((angles, chosen))
        posterior = after_values(prior, prior.grid.matrix(*directions_of(angles)), values)
        yield len(angles), angles, posterior


def left_out(
    logs: np.ndarray, ratios: np.ndarray, known: list[Surrogate], every: int
) -> Iterator[tuple[str, int, tuple[Foretold, AimErrors]]]:
    """(name, directions, (foretold, what it was)) of materials that the statistics leave out."""
    grid, goniometer = HalfGrid(), Goniometer()
    aims = measuring_aims(grid)
    families = sorted({each.family for each in known})
    part = dict(zip(families, np.random.default_rng(SEED).permutation(len(families)) % 5, strict=True))
    merl = np.array([each.name.startswith("merl") for each in known])
    tests = [(np.array([part[each.family] != fold for each in known]), fold) for fold in range(5)]
    tests.append((merl, -1))
    for kept, fold in tests:
        prior = BrdfPrior.of(grid, logs[kept], ratios[kept])
        for number in np.nonzero(~kept)[0][::every]:
            truth = values_at(known[number].material, aims.wi, aims.wo)
            for count, _, posterior in measured_rounds(prior, known[number].material, goniometer, max(COUNTS)):
                if count in COUNTS:
                    was = aim_errors(aims, truth, posterior.values(aims.matrix))
                    yield known[number].name, count, (foretold(prior, posterior, aims), was)
                    progress(fold, known[number].name, count, f"{was.psnr:.1f} dB")


def widenings(found: list[tuple[str, int, tuple[Foretold, AimErrors]]]) -> dict[str, float]:
    """The factors and the offset by which intervals cover `COVERED` of what was found."""
    pairs = [pair for _, _, pair in found]
    factors = {}
    for name in ("albedo", "highlight"):
        apart = [np.abs(getattr(was, name)) / np.log(getattr(told, f"{name}_factor")) for told, was in pairs]
        factors[name] = float(np.quantile(np.concatenate(apart), COVERED))
    off = np.array([was.psnr - told.psnr for told, was in pairs])
    factors["psnr"] = float(np.median(off))
    spread = np.array([max(told.psnr - told.psnr_least, 0.1) for told, _ in pairs])
    factors["psnr_spread"] = float(np.quantile((factors["psnr"] - off) / spread, COVERED))
    return {name: round(value, 3) for name, value in factors.items()}


def measured_files(folder: Path) -> list[Path]:
    """Every second RGL file, on which the factors are set; the others test them."""
    return sorted((folder / "rgl").glob("*.bsdf"))[::2]


def of_measurements(prior: BrdfPrior, files: list[Path]) -> list[tuple[str, int, tuple[Foretold, AimErrors]]]:
    """(name, directions, (foretold, what it was)) of measurements after each round."""
    goniometer, aims, found = Goniometer(), measuring_aims(prior.grid), []
    for file in files:
        material = open_source(str(file), count=1000).reflectance
        truth = values_at(material, aims.wi, aims.wo)
        for count, _, posterior in measured_rounds(prior, material, goniometer, max(COUNTS)):
            was = aim_errors(aims, truth, posterior.values(aims.matrix))
            found.append((file.stem, count, (foretold(prior, posterior, aims), was)))
        progress(file.stem, f"{found[-1][2][1].psnr:.1f} dB")
    return found


def main(arguments: list[str] | None = None) -> int:
    """Make the statistics, set the factors, and store both where that is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--write", action="store_true", help="store the table in the package")
    parser.add_argument("--every", type=int, default=6, help="try every Nth left-out material (%(default)s)")
    parser.add_argument(
        "--widen", action="store_true", help="set the factors again on measurements alone, with the stored statistics"
    )
    options = parser.parse_args(arguments)
    if options.widen:
        return _widened(options)
    known = surrogates(data_folder(options.data))
    if options.short:
        known, options.every = known[::8], 4
    fit = NodeFit(HalfGrid(), 3000 if options.short else COUNT)
    nodes = [fit.of(each.material) for each in known]
    logs, ratios = np.array([each[0] for each in nodes]), np.array([each[1] for each in nodes])
    found = list(left_out(logs, ratios, known, options.every))
    bare = BrdfPrior.of(HalfGrid(), logs, ratios)
    files = [] if options.short else measured_files(data_folder(options.data))
    factors = widenings(of_measurements(bare, files) if files else found)
    prior = replace(bare, widening=factors)
    digest = hashlib.sha256(logs.round(2).tobytes() + ratios.round(2).tobytes()).hexdigest()
    made = {"materials": len(known), "seed": SEED, "pairs": COUNT, "nodes": digest, "left_out": len(found)}
    record = prior.record()
    text = json.dumps({"version": record.pop("version"), "made_from": made, **record}, separators=(",", ":")) + "\n"
    if options.write:
        write(TABLE, text)
    rows = []
    for count in COUNTS:
        own = [pair for _, each, pair in found if each == count]
        rows.append([str(count), str(len(own)), f"{np.median([was.psnr for _, was in own]):.1f}"])
    table = markdown(["directions", "left-out materials", "PSNR, median (dB)"], rows)
    return finish([table, f"{len(text)} bytes; factors {prior.widening}"], options)


def _widened(options: argparse.Namespace) -> int:
    """Set the factors anew, with the stored statistics."""
    stored = json.loads(TABLE.read_text(encoding="utf-8"))
    files = measured_files(data_folder(options.data))
    before, stored["widening"] = (
        stored["widening"], widenings(of_measurements(replace(read_prior(), widening={}), files)),
    )  # fmt: skip
    if options.write:
        write(TABLE, json.dumps(stored, separators=(",", ":")) + "\n")
    return finish([f"factors before {before}", f"set on {len(files)} measurements {stored['widening']}"], options)


if __name__ == "__main__":
    sys.exit(main())
