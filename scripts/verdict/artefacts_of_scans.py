"""Count artefacts that the verdict reports in fits of goniometers' scans, and how many are there in truth.

    python scripts/verdict/artefacts_of_scans.py [--materials 24] [--seed 0] [--out FILE.md]

A material is a diffuse base under one or two GGX lobes, drawn at random. It is scanned as gonioreflectometers often do:
coarsely over the hemisphere, and finely about the mirror direction in the plane of incidence, with 1% of noise. Its fit
by `search` is looked at as the verdict does (`homofact.evaluation.artefacts`): against the samples, and against the
material itself. A finding is false if none of its kind is found against the material. Then artefacts of every kind are
planted on fits without a finding (`scripts.verdict.planted_artefacts`), to count how many are found.
"""

import sys
from pathlib import Path

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.samples import Samples
from homofact.brdf.source import Source
from homofact.evaluation.artefacts.look import SourcePictures
from homofact.linear.threads import one_thread
from homofact.methods.search import Search
from scripts.shared.harness import finish, markdown, parser_of, progress
from scripts.verdict.planted_artefacts import KINDS, drawn_artefact

BYTES, NOISE, EPSILON = 6144, 0.01, 0.01
DIFFERS, OF_PIXELS = 0.05, 0.01


def scan(material: GgxBrdf, generator: np.random.Generator) -> Samples:
    """The material's samples: at 10° of θi, 5° of θo and 15° of Δφ, and at half degrees about the mirror direction.

    The instrument's angles are off by a few tenths of a degree, the same ones in the whole scan.
    """
    coarse = [(i, o, p) for i in range(0, 71, 10) for o in range(0, 81, 5) for p in (range(0, 181, 15) if i else (0,))]
    fine = [(i, i + off, 180) for i in range(10, 71, 10) for off in np.arange(-6, 6.1, 0.5)]
    angles = np.unique(np.array(coarse + fine, float), axis=0)
    angles[:, :2] = np.abs(angles[:, :2] + generator.uniform(-0.2, 0.2, 2))
    theta_i, theta_o, phi = np.radians(angles).T
    wi = np.stack((np.sin(theta_i), 0 * theta_i, np.cos(theta_i)), 1)
    wo = np.stack((np.sin(theta_o) * np.cos(phi), np.sin(theta_o) * np.sin(phi), np.cos(theta_o)), 1)
    exact = material.evaluate(torch.from_numpy(wi), torch.from_numpy(wo)).numpy()
    return Samples(wi, wo, exact * np.exp(NOISE * generator.standard_normal(exact.shape)))


def drawn_material(generator: np.random.Generator) -> GgxBrdf:
    """One of a diffuse base and one or two lobes of α from 0.03 to 0.12."""
    base = tuple(np.exp(generator.uniform(np.log(0.01), np.log(0.4), 3)))
    lobes = []
    for alpha in np.exp(generator.uniform(np.log(0.03), np.log(0.12), generator.integers(1, 3))):
        lobes.append(GgxLobe((1.0, 1.0, 1.0), float(alpha), float(generator.uniform(0.03, 0.08))))
    return GgxBrdf(base, tuple(lobes))


def differs(one: list[np.ndarray], two: list[np.ndarray], pictures: SourcePictures) -> bool:
    """Whether a planted artefact is visible: 1% of the pixels of a picture differ by 5% of white."""
    return any(
        (np.abs(a - b).max(2)[shown.view.inside] > DIFFERS).mean() > OF_PIXELS
        for shown, a, b in zip(pictures.shown, one, two, strict=True)
    )


@one_thread
def main(arguments: list[str] | None = None) -> int:
    """Scan, fit and look at the materials; print the tables."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--materials", type=int, default=24, help="how many are drawn (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of materials, noise and planted artefacts (%(default)s)")
    chosen = parser.parse_args(arguments)
    generator = np.random.default_rng(chosen.seed)
    count = 2 if chosen.short else chosen.materials
    found = false = 0
    planted = {kind: [0, 0] for kind in KINDS}
    for number in range(count):
        material = drawn_material(generator)
        samples = scan(material, generator)
        fit = Search(bytes=BYTES, epsilon=EPSILON).fit(samples).factorization
        exact = SourcePictures(Source("material", "material", samples, material, EPSILON, 0.0))
        true = {each.kind for each in exact.look(exact.pictures(fit)).artefacts}
        pictures = SourcePictures(samples)
        clean = pictures.pictures(fit)
        kinds = {each.kind for each in pictures.look(clean).artefacts}
        found, false = found + bool(kinds), false + bool(kinds - true)
        progress(number, *(f"{each.value}{'' if each in true else ' (false)'}" for each in kinds))
        draws = torch.Generator().manual_seed(chosen.seed + number)
        for kind in KINDS if not kinds else ():
            bad = pictures.pictures(drawn_artefact(fit, kind, draws))
            if differs(clean, bad, pictures):
                planted[kind][0] += 1
                planted[kind][1] += bool(pictures.look(bad).artefacts)
    tables = [
        markdown(("fits", "with a finding", "with a false one"), [(count, found, false)], 0),
        markdown(("planted", "visible", "found"), [(kind, *figures) for kind, figures in planted.items()]),
    ]
    return finish(tables, chosen)


if __name__ == "__main__":
    sys.exit(main())
