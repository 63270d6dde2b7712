"""Count how often suspected units and conventions are right, missed, or accuse a clean material.

    python scripts/verdict/suspicion_numbers.py [--materials 24] [--count 3000] [--seed 0] [--out FILE.md]

Materials are drawn from the neural surrogates of MERL materials and the analytic models, and each is measured in one of
five ways in turn: at pairs drawn in the discs, by lobes, on a goniometer's rings in the order of its angles, the same
with 3% of noise, and the same in random order. Every fault of `scripts.verdict.planting` is planted at each
of its strengths, and all checks are asked as `homofact info` asks them. Named rightly: the fault's own check speaks,
whatever else does; accused wrongly: others speak, and it does not. What is planted on a material that cannot show it
(no highlight, no colours) counts as silent all the same.

A goniometer's coarse rings have few samples near the light, and few angles of the light. There the shadow of the arm
and a bad ring are planted on materials of the calibration's report part (`drawn_cases.py`), on which no weight of these
checks was set.
"""

import math
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import torch

from homofact.brdf.formats.nbrdf import load, material_names
from homofact.brdf.materials import MATERIALS
from homofact.brdf.quality.suspicion.suspects import suspicions
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.geometry.directions import from_spherical
from homofact.linear.threads import one_thread
from homofact.stability.fault import CasePart

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, finish, markdown, parser_of, progress
from scripts.verdict.drawn_cases import NETWORKS, drawn_case
from scripts.verdict.planting import FAULTS

LAYOUTS = ("discs", "lobe", "rings", "noisy rings", "shuffled rings")
ODDS = (50, 200, 1000, 1e5, math.inf)
_NOISE = 0.03
# Steps of θi, θo and Δφ in degrees.
COARSE = ((15, 10, 15), (15, 5, 10), (15, 5, 30), (20, 5, 5), (10, 10, 20))
_COARSE_NOISE = 0.01


@dataclass(frozen=True)
class Said:
    """What was said of one material: the planted fault ("" for none), and (check, odds) of all that is suspected."""

    fault: str
    strength: float
    layout: str
    right: tuple[str, ...]
    said: tuple[tuple[str, float], ...]

    @property
    def named(self) -> bool:
        """Whether the fault's own check speaks."""
        return any(name in self.right for name, _ in self.said)


def on_rings(model: Reflectance, count: int) -> Samples:
    """About `count` samples as a goniometer takes them: eight lights, rings of θo out to 80°, Δφ from 0 to 180°."""
    side = max(int(math.sqrt(count / 8)), 4)
    theta_i = torch.deg2rad(torch.arange(10.0, 81.0, 10.0, dtype=torch.float64))
    theta_o = torch.deg2rad(torch.linspace(0, 80, side + 1, dtype=torch.float64)[1:])
    turn = torch.linspace(0, math.pi, side, dtype=torch.float64)
    i, o, phi = (each.reshape(-1) for each in torch.meshgrid(theta_i, theta_o, turn, indexing="ij"))
    wi, wo = from_spherical(i, i * 0), from_spherical(o, phi)
    return Samples(wi, wo, model.evaluate(wi, wo), channels=model.channels, isotropic=True)


def measured(model: Reflectance, layout: str, count: int, seed: int) -> Samples:
    """The model's samples in one of `LAYOUTS`."""
    generator = torch.Generator().manual_seed(seed)
    if "rings" not in layout:
        return replace(sample_model(model, count, layout, seed), provenance={})  # type: ignore[arg-type]
    samples = on_rings(model, count)
    if "noisy" in layout:
        noise = torch.randn(samples.values.shape, dtype=torch.float64, generator=generator)
        return replace(samples, values=samples.values * torch.exp(_NOISE * noise))
    return samples.select(torch.randperm(len(samples), generator=generator)) if "shuffled" in layout else samples


def on_coarse_rings(model: Reflectance, steps: tuple[int, int, int], seed: int) -> Samples:
    """A goniometer's samples with 1% of noise: θi out to 75° and θo to 80° from the normal, Δφ to 180°."""
    angles = (
        torch.arange(0, most + 1, step, dtype=torch.float64).deg2rad()
        for most, step in zip((75, 80, 180), steps, strict=True)
    )
    i, o, phi = (each.reshape(-1) for each in torch.meshgrid(*angles, indexing="ij"))
    wi, wo = from_spherical(i, i * 0), from_spherical(o, phi)
    values = model.evaluate(wi, wo).to(torch.float64)
    noise = torch.randn(values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    return Samples(wi, wo, values * torch.exp(_COARSE_NOISE * noise), channels=model.channels, isotropic=True)


def asked_on_coarse_rings(folder: Path, materials: int, seed: int) -> Iterator[Said]:
    """What is said of materials on each of `COARSE`, clean, with the shadow of the arm, and with a bad ring."""
    faults = [fault for fault in FAULTS if {"shadow", "ring"} & {*fault.found_as}]
    planted = [(None, 0.0), *((fault, strength) for fault in faults for strength in fault.strengths)]
    for number in range(materials):
        case = drawn_case(CasePart.REPORT, number, folder, seed)
        for steps in COARSE:
            clean = on_coarse_rings(case.material, steps, seed + number)
            for fault, strength in planted:
                samples = clean if fault is None else fault.plant(clean, strength, number)
                said = tuple((each.name, each.odds) for each in suspicions(samples))
                words = "" if fault is None else fault.name
                progress(f"{case.name}, rings of {steps}, {words or 'clean'} {strength:g}: {said}")
                name = "×".join(f"{step}°" for step in steps)
                yield Said(words, strength, name, () if fault is None else fault.found_as, said)


def coarse_table(found: list[Said]) -> str:
    """Per grid: the clean materials that a check accuses, and how often each fault of each strength is named."""
    planted = sorted({(each.fault, each.strength) for each in found if each.fault}, reverse=True)
    rows = []
    for layout in dict.fromkeys(each.layout for each in found):
        those = [each for each in found if each.layout == layout]
        clean = [each for each in those if not each.fault]
        accused = Counter(name for each in clean for name, _ in each.said)
        named = [sum(each.named for each in those if (each.fault, each.strength) == fault) for fault in planted]
        words = ", ".join(f"{name} {count}" for name, count in accused.most_common()) or "–"
        rows.append((layout, len(clean), words, *named))
    heads = (
        f"{fault.removesuffix(' of the arm').removeprefix('a ')} {strength:g} detected" for fault, strength in planted
    )
    return markdown(("steps of θi, θo, Δφ", "materials", "false suspicions on clean samples", *heads), rows)


def asked(folder: Path, materials: int, count: int, seed: int) -> Iterator[Said]:
    """What is said of every clean material, and of each fault planted on it."""
    networks = folder / NETWORKS
    names = [("model", name) for name in MATERIALS]
    if networks.is_file():
        names += [("network", name) for name in material_names(networks)]
    order = torch.randperm(len(names), generator=torch.Generator().manual_seed(seed)).tolist()
    for number, (kind, name) in enumerate(names[k] for k in order[:materials]):
        model = load(f"{networks}#{name}") if kind == "network" else MATERIALS[name].model
        layout = LAYOUTS[number % len(LAYOUTS)]
        clean = measured(model, layout, count, seed + number)
        planted = [("", 0.0, (), clean)]
        planted += [(f.name, s, f.found_as, f.plant(clean, s, seed + number)) for f in FAULTS for s in f.strengths]
        for fault, strength, right, samples in planted:
            said = tuple((each.name, each.odds) for each in suspicions(samples))
            progress(f"{name}, {layout}, {fault or 'clean'} {strength:g}: {said}")
            yield Said(fault, strength, layout, right, said)


def tables(found: list[Said]) -> str:
    """Faults and how they are named, the clean materials, and how often each range of odds is right."""
    clean = [each for each in found if not each.fault]
    rows = []
    for fault in FAULTS:
        accused = sum(any(name in fault.found_as for name, _ in each.said) for each in clean)
        for strength in fault.strengths:
            those = [each for each in found if (each.fault, each.strength) == (fault.name, strength)]
            named, silent = sum(each.named for each in those), [each for each in those if not each.said]
            instead = Counter(each.said[0][0] for each in those if each.said and not each.named)
            words = ", ".join(f"{name} {count}" for name, count in instead.most_common(3))
            label = f"{fault.name} {strength:g}" if len(fault.strengths) > 1 else fault.name
            rows.append((label, fault.found_as[0], named, len(silent), sum(instead.values()), words or "–", accused))
    header = ("planted", "check", "named rightly", "silent", "accused wrongly", "of what", "of clean ones")
    by_layout = [
        (layout, len(those), sum(bool(each.said) for each in those),
         ", ".join(f"{n} {c}" for n, c in Counter(n for each in those for n, _ in each.said).most_common()) or "–")
        for layout in LAYOUTS if (those := [each for each in clean if each.layout == layout])
    ]  # fmt: skip
    return "\n\n".join(
        [
            markdown(header, rows, 2),
            "Clean materials, by measurement layout:",
            markdown(("measured", "materials", "accused", "of what"), by_layout),
            "Suspicions per test, on clean and faulty materials together; \"right\" means that the suspicion names the"
            " simulated fault:",
            markdown(("check", "said", "right", "share"), _by_check(found)),
            "The suspicions of all tests, grouped by their odds:",
            markdown(("odds to 1", "said", "right", "share"), _by_odds(found)),
        ]
    )  # fmt: skip


def _by_check(found: list[Said]) -> list[tuple[str, int, int, str]]:
    """(check, how often it speaks, how often of its own fault, share)."""
    said: dict[str, list[bool]] = {}
    for each in found:
        for name, _ in each.said:
            said.setdefault(name, []).append(name in each.right)
    return [(name, len(those), sum(those), f"{sum(those) / len(those):.0%}") for name, those in sorted(said.items())]


def _by_odds(found: list[Said]) -> list[tuple[str, int, int, str]]:
    """(range, how often said, how often it is the planted fault's own check, share)."""
    rows = []
    for low, high in pairwise(ODDS):
        those = [name in each.right for each in found for name, odds in each.said if low <= odds < high]
        words = f"{low:,.0f} to {high:,.0f}" if high < math.inf else f"over {low:,.0f}"
        rows.append((words, len(those), sum(those), f"{sum(those) / len(those):.0%}" if those else "–"))
    return rows


@one_thread
def main(arguments: list[str] | None = None) -> int:
    """Plant, ask, print the tables, and write them where it is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--materials", type=int, default=24, help="how many are drawn (%(default)s)")
    parser.add_argument("--count", type=int, default=3000, help="samples of each material (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the materials and of their samples (%(default)s)")
    chosen = parser.parse_args(arguments)
    materials, count = (1, 600) if chosen.short else (chosen.materials, chosen.count)
    folder = data_folder(chosen.data)
    coarse = coarse_table(list(asked_on_coarse_rings(folder, materials, chosen.seed)))
    found = list(asked(folder, materials, count, chosen.seed))
    return finish(f"{tables(found)}\n\nOn a goniometer's coarse rings, with 1% of noise:\n\n{coarse}", chosen)


if __name__ == "__main__":
    sys.exit(main())
