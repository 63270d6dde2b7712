"""Find the mixes that searches try first (`homofact/methods/known_mixes.json`).

Exhaustive searches (with what "normal" grants, textures of 16²): neural surrogates of MERL and RGL materials but those
in `MEASURED`, `REPORTED` and `drawn_cases.UNTOUCHED`, mixtures of two, measurements of them with noise on the rings of
a goniometer, and analytic models, anisotropic ones among them. Their results are gathered in --work, which a run that
was ended goes on with. Of all mixes found those are kept that together come nearest to the best of every material.

    python scripts/accuracy/known_mixes.py --work FOLDER [--write] [--data FOLDER]
"""

import hashlib
import json
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from homofact.brdf.analytic import AshikhminShirley, BlinnPhong, CookTorrance, TorranceSparrow, Ward
from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.formats.nbrdf import load, material_names
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import Drawable, sample_model
from homofact.methods.effort import LEVELS
from homofact.methods.known_mixes import TABLE, VERSION, mix_of_record, mix_record
from homofact.methods.mix import Mix
from homofact.methods.search import Search
from homofact.methods.search_fit import find_mixes, trials_of
from homofact.methods.trials import DESCENTS

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import Finished, data_folder, finish, markdown, parser_of, progress, write
from scripts.verdict.drawn_cases import MORE_NETWORKS, NETWORKS, UNTOUCHED, Mixture, on_rings

# Surrogates of RGL materials whose measurements are at hand, and of those that figures are reported on.
MEASURED = (
    "aurora_white", "cc_green_malachite", "cc_ibiza_sunset", "cc_iris_purple_gem", "cc_nothern_aurora",
    "chm_light_blue", "cm_military_green", "irid_flake_paint1", "irid_flake_paint1_fine", "vch_golden_yellow",
)  # fmt: skip
REPORTED = (
    "cardboard", "cc_amber_citrine", "cg_sunflower", "cm_toxic_green", "colodur_azure_4e", "ilm_l3_37_metallic",
    "satin_gold", "spectralon", "vch_dragon_eye_red",
)  # fmt: skip
COUNT, ON_RINGS, NOISE = 12_000, 4_000, 0.02
MIXTURES, MODELS, ANISOTROPIC = 30, 40, 30
SEED = 20020801
SETTINGS = Search(textures=3, size=16, effort=9 * LEVELS["normal"])
KEPT = (8, 16, 24)  # mixes of one texture, two and three


@dataclass(frozen=True)
class Case:
    """One training material: its family, its name, and what is measured of it."""

    family: str
    name: str
    material: Drawable
    rings: bool = False

    @property
    def key(self) -> str:
        """Names the case among all."""
        return f"{self.family}/{self.name}{' on rings' if self.rings else ''}"

    @property
    def isotropic(self) -> bool:
        """Whether the material does not know the azimuth."""
        return self.material.isotropic

    def samples(self) -> Samples:
        """Pairs around the lobe, or on a goniometer's rings with noise."""
        seed = sum(self.key.encode())
        if not self.rings:
            return replace(sample_model(self.material, COUNT, "lobe", seed), provenance={})
        samples = on_rings(self.material, ON_RINGS)
        noise = torch.randn(samples.values.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
        return replace(samples, values=samples.values * (1 + NOISE * noise))


def cases(folder: Path) -> Iterator[Case]:
    """Every training material, always the same."""
    chance = torch.Generator().manual_seed(SEED)

    def pick(count: int) -> int:
        return int(torch.randint(count, (1,), generator=chance))

    merl = [name for name in material_names(folder / NETWORKS) if name not in UNTOUCHED]
    rgl = [name for name in material_names(folder / MORE_NETWORKS) if name not in MEASURED + REPORTED]
    known = [("merl", f"{folder / NETWORKS}#{name}") for name in merl]
    known += [("rgl", f"{folder / MORE_NETWORKS}#{name}") for name in rgl]
    for family, path in known:
        yield Case(family, path.split("#")[1], load(path))
    for family, path in known[::3]:
        yield Case(family, path.split("#")[1], load(path), rings=True)
    for number in range(MIXTURES):
        one, two, share = known[pick(len(known))][1], known[pick(len(known))][1], (1 + pick(9)) / 10
        yield Case("mixture", f"{number}", Mixture(load(one), load(two), share))
    for number in range(MODELS + ANISOTROPIC):
        yield _model(number, pick, number >= MODELS)


def _model(number: int, pick: Callable[[int], int], stretched: bool) -> Case:
    def colour(most: float) -> tuple[float, float, float]:
        return tuple(most * (1 + pick(100)) / 100 for _ in range(3))  # type: ignore[return-value]

    width = 10 ** (-0.3 - 1.2 * pick(100) / 100)
    diffuse, specular = colour(0.6), colour(0.3)
    across = width * (2 + pick(4)) / 2 if stretched else width
    family = "anisotropic" if stretched else "model"
    kind = (0, 3, 4)[number % 3] if stretched else number % 6
    if kind == 0:
        return Case(family, f"ward {number}", Ward(diffuse, specular, width, across))
    if kind == 1:
        return Case(family, f"cook-torrance {number}", CookTorrance(diffuse, specular, width, 0.05 + pick(10) / 20))
    if kind == 2:
        return Case(family, f"torrance-sparrow {number}", TorranceSparrow(diffuse, specular, width))
    if kind == 3:
        nu, nv = 2 / width**2, 2 / across**2
        return Case(family, f"ashikhmin-shirley {number}", AshikhminShirley(diffuse, specular, nu, nv))
    if kind == 4:
        rough = width**0.5
        turned = 0.3 + pick(6) / 10 if stretched else 0.0
        model = MetallicRoughness(colour(0.9), pick(11) / 10, rough, pick(3) / 2, rough / 2, turned)
        return Case(family, f"metallic-roughness {number}", model)
    return Case(family, f"blinn-phong {number}", BlinnPhong(diffuse, specular, 2 / width**2))


def looked(case: Case, mixes: list[Mix]) -> list[float]:
    """What a first look at every mix says of a case: the least left-out error on small textures."""
    trials = trials_of(case.samples(), SETTINGS)
    return [trials.glanced(mix, DESCENTS)[0].error for mix in mixes]


def chosen(ratios: np.ndarray, count: int) -> list[int]:
    """Of the columns of ratios (cases, mixes) those whose least ratios have the least mean logarithm, one by one."""
    best, places = np.full(len(ratios), math.inf), []
    while len(places) < min(count, ratios.shape[1]):
        means = np.log(np.minimum(best[:, None], ratios)).mean(0)
        means[places] = math.inf
        place = int(means.argmin())
        places.append(place)
        best = np.minimum(best, ratios[:, place])
    return places


def main(arguments: list[str] | None = None) -> int:
    """Search, choose, and write what was chosen where that is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--work", type=Path, required=True, help="the folder where results are kept")
    parser.add_argument("--write", action="store_true", help="store the chosen mixes in the package")
    parser.add_argument("--part", default="0/1", help="every nth case only, as NUMBER/COUNT")
    steps = ("search", "look", "choose", "families")
    parser.add_argument("--step", choices=steps, default=steps[0], help="what is done, one after another")
    options = parser.parse_args(arguments)
    every = list(cases(data_folder(options.data)))
    number, count = map(int, options.part.split("/"))
    mine = every[number::count]
    if options.step == "search":
        search(mine, Finished(options.work / f"found-{number}-{count}.jsonl"))
    elif options.step == "look":
        look(mine, gathered(options.work, "found"), Finished(options.work / f"looks-{number}-{count}.jsonl"))
    elif options.step == "families":
        text = left_out(every, gathered(options.work, "looks"), gathered(options.work, "found"))
        return finish(text, options)
    else:
        stored = choose(every, gathered(options.work, "found"), gathered(options.work, "looks"))
        if options.write:
            write(TABLE, json.dumps(stored, indent=None, separators=(",", ":")) + "\n")
    return 0


def gathered(folder: Path, stem: str) -> dict[str, Any]:
    """The results of all parts of a step."""
    return {key: value for path in sorted(folder.glob(f"{stem}-*.jsonl")) for key, value in Finished(path).items()}


def search(mine: list[Case], found: Finished) -> None:
    """The best mixes of every case, by the exhaustive search."""
    for case in mine:
        if case.key not in found:
            outcome = find_mixes(case.samples(), SETTINGS)
            levels = [{"error": mix.error} | mix_record(mix) for mix in outcome.levels]
            found.keep(case.key, {"levels": levels, "evaluations": outcome.evaluations})
            progress(case.key, *(f"{mix.error:.3g}" for mix in outcome.levels), "+".join(outcome.mix.kinds))


def candidates(found: dict[str, Any], isotropic: bool) -> list[list[dict[str, Any]]]:
    """Every mix that was found, by number of textures, each once; of isotropic cases or of the others."""
    records: list[dict[str, dict[str, Any]]] = [{}, {}, {}]
    for key in sorted(found):
        if key.startswith("anisotropic") is not isotropic:
            for level in found[key]["levels"]:
                own = {name: value for name, value in level.items() if name != "error"}
                shape = {name: value for name, value in own.items() if name != "smoothing"}
                records[len(own["kinds"]) - 1].setdefault(json.dumps(shape), own)
    return [list(each.values()) for each in records]


def look(mine: list[Case], found: dict[str, Any], looks: Finished) -> None:
    """What every case makes of every mix that was found."""
    for case in mine:
        if case.key not in looks:
            errors = []
            for records in candidates(found, case.isotropic):
                errors.append(looked(case, [mix_of_record(record, True, "disc") for record in records]))
            looks.keep(case.key, errors)
            progress(case.key, *(f"{min(each):.3g}" for each in errors))


def choose(every: list[Case], found: dict[str, Any], looks: dict[str, Any]) -> dict[str, Any]:
    """The table: the mixes that together come nearest to the best of every case."""
    table: list[list[dict[str, Any]]] = [[], [], []]
    for isotropic in (True, False):
        keys = [case.key for case in every if case.isotropic is isotropic and case.key in looks]
        for level, records in enumerate(candidates(found, isotropic)):
            errors = np.array([looks[key][level][: len(records)] for key in keys])
            if not errors.size:
                continue
            ratios = errors / errors.min(1, keepdims=True)
            places = chosen(ratios, KEPT[level])
            table[level] += [records[place] for place in places if not _has(table[level], records[place])]
            left = ratios[:, places].min(1)
            kept = f"{level + 1} textures: {len(places)} of {len(records)} mixes"
            progress(f"{kept}, median {np.median(left):.3f} of the best, worst {left.max():.2f}")
    digest = hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()
    made = {"cases": len(found), "seed": SEED, "effort": SETTINGS.effort, "found": digest}
    return {"version": VERSION, "made_from": made, "mixes": table}


def left_out(every: list[Case], looks: dict[str, Any], found: dict[str, Any]) -> str:
    """What mixes known from all other families leave of a family's errors, beside the best of all mixes found."""
    rows = []
    isotropic = [case for case in every if case.isotropic and case.family != "anisotropic" and case.key in looks]
    groups = [(case.family + " on rings" * case.rings, case) for case in isotropic]
    for name in dict.fromkeys(group for group, _ in groups):
        family = [case for group, case in groups if group == name]
        # A family on rings is the same materials again: both are left out.
        others = [case for case in isotropic if case.family != family[0].family]
        cells = [name, str(len(family))]
        for level in range(3):
            best = [np.array([looks[case.key][level] for case in each]) for each in (others, family)]
            finders = _finders(found, level)
            allowed = [place for place, families in enumerate(finders) if families - {family[0].family}]
            ratios = [errors / errors.min(1, keepdims=True) for errors in best]
            places = [allowed[place] for place in chosen(ratios[0][:, allowed], KEPT[level])]
            least = ratios[1][:, places].min(1)
            cells += [f"{np.median(least):.3f}", f"{least.max():.2f}"]
        rows.append(cells)
    errors = [f"{count} textures, {what}" for count in (1, 2, 3) for what in ("median", "worst")]
    return markdown(["left out", "cases", *errors], rows)


def _finders(found: dict[str, Any], level: int) -> list[set[str]]:
    """The families that found each of the isotropic `candidates`."""
    seen: dict[str, set[str]] = {}
    for key in sorted(found):
        if not key.startswith("anisotropic"):
            for own in found[key]["levels"]:
                if len(own["kinds"]) == level + 1:
                    shape = {name: value for name, value in own.items() if name not in ("error", "smoothing")}
                    seen.setdefault(json.dumps(shape), set()).add(key.split("/")[0])
    return list(seen.values())


def _has(records: list[dict[str, Any]], record: dict[str, Any]) -> bool:
    """Whether a mix stands among records, whatever its λ."""
    return any({**own, "smoothing": None} == {**record, "smoothing": None} for own in records)


if __name__ == "__main__":
    sys.exit(main())
