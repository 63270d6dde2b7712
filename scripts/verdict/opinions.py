"""Fit the grades that people gave approximations of MERL to a colour difference (`homofact/evaluation/opinion.json`).

Lavoué et al. 2021 publish scores of approximations of the 100 MERL materials. The parameters of three are public: NPF
(BAGHER in the study), SGD and ABC. The measurements are not at hand, so a reading stands for them: networks of
Sztrajman et al. 2021. Spheres of approximation and reading are compared under lamps fitted to the Grace probe of the
study. A run that was ended goes on with --work. With --write the package's table is made.

    python scripts/verdict/opinions.py --work FOLDER [--write] [--data FOLDER] [--out FILE]
"""

import dataclasses
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.evaluation import fixed_pictures as pictures
from homofact.evaluation import image_metrics
from homofact.evaluation.opinion import TABLE, VERSION, OpinionLaw, StudyLight, digest
from homofact.rendering.environment import read_environment
from homofact.rendering.fixed_lights import directions_of_map, sky
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.made_skies import made_sky
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import displayed

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.data.published_fits import Abc, names, published
from scripts.shared.harness import Finished, data_folder, finish, markdown, parser_of, progress, write
from scripts.verdict import opinion_study as study

SEED = 20210504
LAMPS, STEPS, ROWS = 32, 400, 64
WHITE = 0.3
STUDY = {"abc": "ABC", "sgd": "SGD", "npf": "BAGHER"}
# One index of refraction for all materials, in the pictures of ABC that the study showed; None is each one's own.
INDICES = (None, 1.6, 1.8, 2.0, 2.2, 2.4, 2.6, 2.8, 3.2)
READINGS = ("nbrdf", "nps")
LIGHTS = ("lamps", "grace", "sky", "lamp room")


def fit_lamps(radiance: Tensor, count: int = LAMPS, steps: int = STEPS) -> StudyLight:
    """Lamps whose square roots come nearest to those of a lat-long map (H, W, 3), by Adam from its bright places."""
    wanted = reduced(radiance).reshape(-1, 3)
    towards = directions_of_map(ROWS).reshape(-1, 3)
    sine = (1 - towards[:, 1] ** 2).sqrt()
    left, chosen = wanted.mean(1).clone(), []
    for _ in range(count):
        chosen.append(towards[int((left * sine.sqrt()).argmax())])
        left *= 1 - torch.exp(30 * (towards @ chosen[-1] - 1))
    parts = [torch.stack(chosen), torch.full((count,), 3.0), torch.full((count, 3), -1.0), torch.full((3,), -2.0)]
    parts = [part.double().clone().requires_grad_() for part in parts]
    optimizer = torch.optim.Adam(parts, lr=0.05)

    def light() -> StudyLight:
        place, sharpness, colour, even = parts
        unit = place / place.norm(dim=1, keepdim=True)
        return StudyLight(even.exp(), torch.cat((unit, sharpness.exp()[:, None], colour.exp()), 1), WHITE)

    for _ in range(steps):
        loss = (sine[:, None] * ((light().radiance(towards) + 0.02).sqrt() - (wanted + 0.02).sqrt()) ** 2).sum()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    made = light()
    # Digits that the table states.
    return StudyLight(rounded(made.even), rounded(made.lamps), WHITE)


def reduced(radiance: Tensor) -> Tensor:
    """A lat-long map (H, W, 3) averaged to `ROWS` rows."""
    rows = torch.nn.functional.interpolate(radiance.permute(2, 0, 1)[None].double(), (ROWS, 2 * ROWS), mode="area")
    return rows[0].permute(1, 2, 0)


def rounded(values: Tensor) -> Tensor:
    """Five significant digits."""
    numbers = [float(f"{value:.5g}") for value in values.detach().reshape(-1).tolist()]
    return torch.tensor(numbers, dtype=torch.float64).reshape(values.shape)


def variants(name: str, folder: Path) -> Iterator[tuple[str, Reflectance]]:
    """The readings, and the approximations of a material by method and, of ABC, by index."""
    for kind in (*READINGS, "npf", "sgd"):
        yield kind, published(kind, name, folder)
    abc = published("abc", name, folder)
    assert isinstance(abc, Abc)
    for index in INDICES:
        yield f"abc {index}", abc if index is None else dataclasses.replace(abc, index=index)


class Places:
    """Spheres at the places that the package compares, under each of `LIGHTS`."""

    def __init__(self, lamps: StudyLight, probe: Callable[[Tensor], Tensor]) -> None:
        self.nodes = pictures.sphere_nodes()
        lights = {
            "lamps": lamps.radiance,
            "grace": probe,
            "sky": lambda world: sky(world)[..., None].expand(*world.shape),
            "lamp room": lambda world: made_sky("lamp room").look_up(world)[0],
        }
        self.lights = {name: lights[name](self.nodes.world) * self.nodes.weights[..., None] for name in LIGHTS}

    def draw(self, reflectance: Reflectance) -> dict[str, Tensor]:
        """Encoded sRGB (1, K, 3) by light, a white sphere's median at `WHITE`."""
        wi, wo = (x.reshape(-1, 3) for x in (self.nodes.wi, self.nodes.wo))
        values = reflectance.evaluate(wi, wo).double().reshape(*self.nodes.weights.shape, 3)
        shown = {}
        for name, light in self.lights.items():
            radiance = (values * light).sum(1)[None]
            every = torch.ones(radiance.shape[:2]).double()
            exposure = pictures.exposure_for(light, WHITE)
            shown[name] = displayed(SphereImage(radiance, every), exposure, curve="srgb")
        return shown


def measure(name: str, folder: Path, places: Places) -> dict[str, Any]:
    """ΔE00 under each light against each reading, and other metrics under the lamps, by approximation."""
    shown = {kind: places.draw(model) for kind, model in variants(name, folder)}
    every = torch.ones(1, len(places.nodes.weights), dtype=torch.bool)
    found: dict[str, Any] = {}
    for kind, mine in shown.items():
        if kind in READINGS:
            continue
        found[kind] = {
            f"ciede2000 {light} {reading}": image_metrics.ciede2000(shown[reading][light], mine[light], every)
            for light in LIGHTS
            for reading in READINGS
        }
        pair = shown["nbrdf"]["lamps"], mine["lamps"], every
        found[kind] |= {
            "rms": 10 ** (-image_metrics.psnr(*pair) / 20),
            "delta_e_itp": image_metrics.delta_e_itp(*pair),
        }
    return found


def judged(found: dict[str, Any], scores: dict[tuple[str, str], float], key: str) -> study.Judged:
    """The scores beside the differences `key`; of ABC one column an index."""
    rows = []
    for method, label in STUDY.items():
        for material, values in found.items():
            score = scores.get((label, study.plain(material)))
            if score is not None:
                kinds = [f"abc {index}" for index in INDICES] if method == "abc" else [method] * len(INDICES)
                differences = [values[kind][key] for kind in kinds]
                rows.append((material, study.family_of(material), label, score, differences))
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return study.Judged(*columns)


def consistency(rows: study.Judged) -> str:
    """Is what is at hand what the study showed: how each method's differences rank beside its scores."""
    cells = []
    for label in dict.fromkeys(rows.method):
        own = rows.part(rows.method == label)
        chosen = own.variant()
        for column in sorted({0, chosen}):
            words = "" if label != "ABC" else ", own index" if INDICES[column] is None else f", index {INDICES[column]}"
            rho = study.rank_correlation(own.differences[:, column], own.distance)
            spread = f"{own.distance.mean():.3f} ± {own.distance.std():.3f}"
            bound = study.noise_bound(own.distance, SEED)
            cells.append([f"{label}{words}", len(own.distance), spread, f"{np.median(own.differences[:, column]):.2f}",
                          f"{rho:.2f}", f"{bound:.2f}"])  # fmt: skip
    return markdown(["method", "materials", "distance", "ΔE, median", "ρ", "noise bound"], cells)


def by_metric(found: dict[str, Any], scores: dict[tuple[str, str], float]) -> str:
    """ρ of all scores with each metric, light and reading; the index of ABC chosen for each."""
    cells = []
    keys = [f"ciede2000 {light} nbrdf" for light in LIGHTS] + ["ciede2000 lamps nps", "rms", "delta_e_itp"]
    words = {"rms": "RMS of encoded values (PSNR), lamps, nbrdf", "delta_e_itp": "ΔE ITP, lamps, nbrdf"}
    for key in keys:
        rows = judged(found, scores, key)
        chosen = rows.variant()
        label = words.get(key) or "CIEDE2000, {1}, {2}".format(*_named(key))
        without = rows.part(rows.method != "ABC")
        line = [rows, without, *(rows.part(rows.method == name) for name in STUDY.values())]
        rhos = [f"{study.rank_correlation(part.differences[:, chosen], part.distance):.2f}" for part in line]
        cells.append([label, INDICES[chosen] or "own", *rhos])
    return markdown(["metric, light, proxy", "index of ABC", "all", "without ABC", *STUDY.values()], cells)


def _named(key: str) -> tuple[str, str, str]:
    metric, *light, reading = key.split(" ")
    return metric, " ".join(light), reading


def validation(rows: study.Judged) -> str:
    """The law on what was left out of it."""
    cells = []
    parts = {"all": rows, "without ABC": rows.part(rows.method != "ABC")}
    for words, part in parts.items():
        for what, groups in (("materials", part.material), ("families", part.family), ("methods", part.method)):
            line = study.validated(part, groups, SEED)
            cells.append([f"{words}: {what}", *line, f"{study.noise_bound(part.distance, SEED):.2f}"])
    head = ["rows: left out", "ρ", "95% interval of ρ", "covered by 90% intervals", "width, grades", "RMS, grades",
            "noise bound of ρ"]  # fmt: skip
    by_method = []
    whole = study.left_out(rows, rows.material)
    for label in dict.fromkeys(rows.method):
        own = rows.method == label
        inside = (rows.distance >= whole.low) & (rows.distance <= whole.high)
        by_method.append([label, f"{inside[own].mean():.0%}", f"{4 * (whole.high - whole.low)[own].mean():.2f}"])
    return markdown(head, cells) + "\n\n" + markdown(["method, materials left out", "covered", "width"], by_method)


def made_table(rows: study.Judged, light: StudyLight) -> dict[str, Any]:
    """The content of the package's table."""
    chosen = rows.variant()
    law = study.fit_law(rows.differences[:, chosen], rows.distance)
    content: dict[str, Any] = {
        "version": VERSION,
        "law": {name: float(f"{value:.5g}") for name, value in vars(law).items()},
        "light": {"even": light.even.tolist(), "lamps": light.lamps.tolist(), "white": light.white},
        "made_from": {
            "scores": "Lavoué et al. 2021, doi 10.1111/cgf.142636", "light": "Grace probe, P. Debevec",
            "rows": len(rows.distance), "seed": SEED, "index_of_abc": INDICES[chosen],
        },
    }  # fmt: skip
    return content | {"sha256": digest(content)}


def law_table(content: dict[str, Any]) -> str:
    """What the law says of some differences."""
    law = OpinionLaw(**content["law"])
    asked = sorted((0.0, 0.5, 1.0, law.unseen, 2.0, 3.0, 5.0, 10.0))
    opinions = [law.opinion(each) for each in asked]
    cells = [[f"{each.delta_e:.2f}", f"{each.score:.2f}", f"{each.low:.2f} to {each.high:.2f}"] for each in opinions]
    return markdown(["ΔE under the study's light", "expected grade", "90% interval"], cells)


def main(arguments: list[str] | None = None) -> int:
    """Measure, validate, print, and with --write make the table."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--work", type=Path, help="a folder in which finished materials are kept")
    parser.add_argument("--write", action="store_true", help=f"make {TABLE.name}")
    chosen = parser.parse_args(arguments)
    folder = data_folder(chosen.data)
    probe = folder / "envmaps" / "grace_probe_latlong.hdr"
    try:
        scores = study.read_distances(folder / "perception" / "distances.csv")
        environment = EnvironmentMap(reduced(read_environment(probe).radiance))
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    light = fit_lamps(environment.radiance, *((4, 20) if chosen.short else ()))
    places = Places(light, lambda world: environment.look_up(world)[0])
    done = Finished(None if chosen.work is None else chosen.work / "opinions.jsonl")
    every = names(folder)[:: 12 if chosen.short else 1]
    found = {name: done.get(name, lambda name=name: measure(name, folder, places)) for name in every}
    rows = judged(found, scores, "ciede2000 lamps nbrdf")
    content = made_table(rows, light)
    if chosen.write:
        write(TABLE, json.dumps(content, ensure_ascii=False, separators=(",", ":")) + "\n")
        progress(f"wrote {TABLE}")
    return finish([consistency(rows), by_metric(found, scores), validation(rows), law_table(content)], chosen)


if __name__ == "__main__":
    sys.exit(main())
