"""Count how many planted artefacts the verdict finds, and what it finds in clean fits.

    python scripts/verdict/artefact_numbers.py [--planted 4] [--fits FOLDER] [--seed 0] [--out FILE.md]

Fits are looked at as the verdict does (`homofact.evaluation.artefacts`). Thresholds were set on the "tuning" half: MERL
surrogates and RGL measurements. The "test" half was not looked at before: other MERL surrogates, surrogates of other
RGL measurements, and analytic models. A fit is clean where in no picture more than 1% of the pixels differ from the
source's by 5% of white. On each fit without a finding, artefacts of every kind are planted
(`scripts.verdict.planted_artefacts`). One is visible where it changes 1% of the pixels of a picture by 5% of white.
--fits keeps the fits for another run.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from homofact.brdf.formats.nbrdf import material_names
from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput
from homofact.evaluation.artefacts.artefact import Artefact
from homofact.evaluation.artefacts.look import SourcePictures
from homofact.factor.fitted import Fitted
from homofact.linear.threads import one_thread
from homofact.methods.saved import open_saved
from homofact.methods.search import Search
from scripts.shared.harness import data_folder, figure, finish, markdown, parser_of, progress
from scripts.verdict.drawn_cases import NETWORKS
from scripts.verdict.planted_artefacts import KINDS, drawn_artefact

HALVES = ("tuning", "test")
RGL_NETWORKS = Path("nbrdf") / "rgl_nbrdf_weights.npz"
MODELS = ("blinn-phong-50", "cook-torrance-plastic", "lafortune-blue-paint", "phong-30", "torrance-sparrow-20")
FEW, MANY = (2, 16), (3, 32)  # textures and texels per side
DIFFERS, OF_PIXELS = 0.05, 0.01
Material = tuple[str, str, tuple[tuple[int, int], ...]]


@dataclass(frozen=True)
class Planted:
    """What became of a planted artefact: its kind, whether it is visible, and what was found."""

    kind: str
    visible: bool
    found: tuple[str, ...]


@dataclass(frozen=True)
class Looked:
    """A fit of a material: its half, the share of pixels that differ from the source's, what was found, and planted."""

    name: str
    half: str
    differs: float
    found: tuple[Artefact, ...]
    planted: tuple[Planted, ...]

    @property
    def clean(self) -> bool:
        """Whether the fit looks like its source."""
        return self.differs <= OF_PIXELS


def materials(data: Path, short: bool) -> dict[str, list[Material]]:
    """(name, what opens it, (textures, size) of its fits) of every material of each half."""
    models: list[Material] = [(name, f"material:{name}", (FEW,)) for name in MODELS]
    if short:
        return {"tuning": models[:1], "test": models[1:2]}
    merl, others = data / NETWORKS, data / RGL_NETWORKS
    files = {file.stem.removesuffix("_rgb"): file for file in sorted((data / "rgl").glob("*.bsdf"))}
    unseen = [name for name in material_names(others) if name.removesuffix("_rgb") not in files]
    return {
        "tuning": [
            *_networks(merl, material_names(merl)[2::6]),
            *((name, str(file), (FEW, MANY)) for name, file in files.items()),
        ],
        "test": [*_networks(merl, material_names(merl)[5::12]), *_networks(others, unseen[3::12]), *models],
    }


def _networks(file: Path, names: list[str]) -> list[Material]:
    """Networks of a file, every other one fitted in two sizes."""
    return [(name, f"{file}#{name}", (FEW, MANY) if k % 2 == 0 else (FEW,)) for k, name in enumerate(names)]


def fitted(source: Source, name: str, size: tuple[int, int], kept: Path | None) -> Fitted:
    """The fit with (textures, texels per side), from the folder `kept` where it is there."""
    place = None if kept is None else kept / f"{name}-{size[0]}x{size[1]}.npz"
    if place is not None and place.is_file():
        return open_saved(place)
    settings = Search(textures=size[0], size=size[1], effort="quick", epsilon=source.default_epsilon)
    fit = settings.fit(source.samples).factorization
    if place is not None:
        place.parent.mkdir(parents=True, exist_ok=True)
        fit.save(place)
    return fit


def looked_at(data: Path, planted: int, kept: Path | None, seed: int, short: bool) -> Iterator[Looked]:
    """Every fit of every material, one after the other."""
    everything = [(half, *each) for half, some in materials(data, short).items() for each in some]
    for number, (half, name, path, sizes) in enumerate(everything):
        source = open_source(path)
        pictures = SourcePictures(source)
        own = [each.picture for each in pictures.shown]
        for size in sizes:
            fit = fitted(source, name, size, kept)
            generator = torch.Generator().manual_seed(seed + 1000 * number + size[0])
            clean = pictures.pictures(fit)
            found = pictures.look(clean).artefacts
            several = []
            for kind in KINDS if not found else ():
                for _ in range(planted):
                    bad = pictures.pictures(drawn_artefact(fit, kind, generator))
                    seen = tuple(each.kind.value for each in pictures.look(bad).artefacts)
                    several.append(Planted(kind, _differs(pictures, clean, bad) > OF_PIXELS, seen))
            yield Looked(
                f"{name}, {size[0]} × {size[1]}²",
                half,
                _differs(pictures, own, clean),
                found,
                tuple(several),
            )
            progress(name, size, figure(_differs(pictures, own, clean)), *(each.words for each in found))


def _differs(pictures: SourcePictures, one: list[np.ndarray], two: list[np.ndarray]) -> float:
    """The largest share of a picture's pixels that differ by `DIFFERS` in a channel."""
    shares = [
        (np.abs(a - b).max(2)[shown.view.inside] > DIFFERS).mean()
        for shown, a, b in zip(pictures.shown, one, two, strict=True)
    ]
    return float(max(shares))


def tables(fits: list[Looked]) -> list[str]:
    """What was planted and found, what clean fits show, and every finding in a fit that nothing was planted on."""
    rows = []
    for half in HALVES:
        planted = [each for fit in fits if fit.half == half for each in fit.planted]
        for kind in KINDS:
            seen = [each for each in planted if each.kind == kind and each.visible]
            found = [each for each in seen if each.found]
            hidden = [each for each in planted if each.kind == kind and not each.visible]
            rows.append(
                (half, kind, len(seen), len(found), len(seen) - len(found), sum(kind in each.found for each in found),
                 len(hidden), sum(bool(each.found) for each in hidden))
            )  # fmt: skip
    header = ("half", "planted", "visible", "found", "missed", "named so", "hardly visible", "found of these")
    clean = [
        (half, len(some), sum(bool(fit.found) for fit in some))
        for half in HALVES
        if (some := [fit for fit in fits if fit.half == half and fit.clean])
    ]
    others = [
        (fit.name, f"{fit.differs:.1%}", "; ".join(each.words for each in fit.found) or "nothing")
        for fit in fits
        if not fit.clean or fit.found
    ]
    return [
        markdown(header, rows, 2),
        markdown(("half", "clean fits", "with a finding"), clean),
        markdown(("fit", "pixels that differ", "found"), others, 3),
    ]


@one_thread
def main(arguments: list[str] | None = None) -> int:
    """Look at the fits, print the tables; 0, or 2 where the data are missing."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--planted", type=int, default=4, help="artefacts of each kind for each fit (%(default)s)")
    parser.add_argument("--fits", type=Path, help="a folder that keeps the fits for another run")
    parser.add_argument("--seed", type=int, default=0, help="of the planted artefacts (%(default)s)")
    chosen = parser.parse_args(arguments)
    try:
        planted = 1 if chosen.short else chosen.planted
        fits = list(looked_at(data_folder(chosen.data), planted, chosen.fits, chosen.seed, chosen.short))
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    return finish(tables(fits), chosen)


if __name__ == "__main__":
    sys.exit(main())
