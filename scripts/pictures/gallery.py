"""Make the gallery: a sheet for each of four measured paints, two sampled ones and six surrogates.

    python scripts/pictures/gallery.py [--data FOLDER] [--only NAME ...] [--out docs/gallery.md]

Each sheet is `figures.compare_picture` of the source and the default fit of three 32² textures: a point light, a round
lamp, a sky, the differences. The RGL paints are tables of measurements (Dupuy and Jakob 2018); the Cornell paints
scattered samples, interpolated between and hatched beyond them; the surrogates networks that were fitted to MERL
materials (Sztrajman et al. 2021; never MERL itself). The pictures go beside the page, into pictures/.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from homofact.brdf.channels import display_of
from homofact.brdf.source import Source, open_source
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.evaluation.machine import machine
from homofact.figures.compare_picture import FitPanel, compare_picture
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, data_folder, figure, markdown, parser_of, progress, write

PAGE = ROOT / "docs" / "gallery.md"
PAINTS = ("aurora_white", "vch_golden_yellow", "chm_light_blue", "irid_flake_paint1")
SAMPLED = ("garnet_red", "krylon_blue")
SURROGATES = ("chrome", "gold-metallic-paint", "nylon", "pink-plastic", "steel", "blue-acrylic")
PIXELS = 176


def materials(folder: Path) -> Iterator[tuple[str, str, str]]:
    """(name, what it is, path) of what is there; the others are named on stderr."""
    networks = folder / "nbrdf" / "merl_nbrdf_weights.npz"
    places = [
        *((name, "an RGL paint", folder / "rgl" / f"{name}_rgb.bsdf", "") for name in PAINTS),
        *((name, "a Cornell paint", folder / "cornell" / f"{name}.brdf", "") for name in SAMPLED),
        *((name, "a surrogate of the MERL material", networks, f"#{name}") for name in SURROGATES),
    ]
    for name, kind, file, member in places:
        if file.is_file():
            yield name, kind, f"{file}{member}"
        else:
            print(f"skipped {name}: no {file} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)


def numbers(row: ComparisonRow) -> list[str]:
    """What stands under a fit's sphere."""
    terms, held = row.factorization.terms, row.held_out
    kinds = ", ".join(dict.fromkeys(term.projection.coordinates for term in terms))
    lines = [f"{len(terms)} textures, {row.factorization.nbytes:,} bytes: {kinds}"]
    if row.appearance is not None:
        energy = row.appearance.energy
        lines += [
            f"energy {energy.energy_overall:.3f}, worst albedo {energy.albedo_worst:.3f} (the source is 1)",
            f"relative RMS {energy.rms:.3f}, floor of a reciprocal fit {energy.floor:.3f}",
            f"PSNR {row.appearance.psnr_sky:.1f} dB under sky, {row.appearance.psnr_light:.1f} dB under point light",
        ]
    return [*lines, f"log MSE {figure(held.log_mse)} held out, {figure(row.train.log_mse)} training"]


def told(name: str, row: ComparisonRow) -> tuple[str, ...]:
    """A line of the table."""
    cole = figure(row.held_out.log_mse)
    if row.appearance is None:
        return (f"[{name}](#{name})", "–", "–", "–", "–", "–", cole)
    energy = row.appearance.energy
    found = (energy.energy_overall, energy.albedo_worst, energy.rms, energy.floor)
    return (f"[{name}](#{name})", *(f"{value:.3f}" for value in found), f"{row.appearance.psnr_sky:.1f}", cole)


def sheet(path: Path, name: str, source: Source, row: ComparisonRow, size: int) -> None:
    """Draw a material's sheet."""
    title = f"homofact: {len(row.factorization.terms)} textures of {row.settings.size}²"
    path.parent.mkdir(parents=True, exist_ok=True)
    panels = [FitPanel(title, row.factorization, numbers(row))]
    compare_picture(path, (name, source.reflectance), panels, size=size, to_rgb=display_of(source.samples.channels))


def main(arguments: list[str] | None = None) -> int:
    """Fit, draw, and write the page."""
    parser = parser_of(__doc__, "data", "effort")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these materials alone")
    parser.add_argument("--out", type=Path, default=PAGE, help="the page (%(default)s)")
    options = parser.parse_args(arguments)
    method = Search(textures=3, size=32, effort=options.effort)
    count, size = 45_000, PIXELS
    found = [each for each in materials(data_folder(options.data)) if not options.only or each[0] in options.only]
    if options.short:
        method, count, size, found = Search(textures=1, size=4, effort=5.0), 400, 32, found[:1]
        found = found or [("phong-10", "a model", "material:phong-10")]
    rows, parts = [], []
    for name, kind, path in found:
        source = open_source(path, count=count)
        row = fit_and_measure(source, method)
        picture = Path("pictures") / f"gallery-{name}.png"
        sheet(options.out.parent / picture, name, source, row, size)
        rows.append(told(name, row))
        progress(*rows[-1])
        listed = " Its source is a list of samples, so the sheet shows an interpolation of the samples instead."
        parts += [
            f"## {name}",
            f"{kind[0].upper()}{kind[1:]}.{listed if row.appearance is None else ''}",
            f"![{name}: source, fit, differences]({picture})",
        ]
    header = ("material", "energy", "worst albedo", "RMS", "floor", "sky dB", "Cole error")
    introduction = (
        "This page shows how well default fits reproduce paints, plastics and metals. Each sheet shows the source"
        " and its default fit with three textures of 32² texels (36 KiB). The lights are a point light, a round lamp"
        " 10° wide, and a sky. The difference pictures are on the right, each with its colour scale below. Angles"
        " without measurements are hatched. A surrogate is a network that Sztrajman et al. (2021) fitted to a MERL"
        " material; it serves as the source because homofact may not ship the MERL measurement. The [table"
        " below](#errors) lists the errors."
    )
    errors = (
        "`python scripts/pictures/gallery.py` makes these sheets and this table. [Light](light.md) explains energy,"
        " worst directional albedo, relative RMS, the floor (the smallest RMS of any reciprocal fit), and the PSNR"
        " under the sky. A fit can have an RMS below the floor if the search dropped reciprocity. RMS and floor are"
        " errors of f. The columns `rms` and `floor` of `homofact factorize` and the floors on the page [Straighten a"
        " measurement](straightening.md) are errors of f cosθi cosθo,"
        " so they differ. The Cole error is measured on held-out samples (20% of all samples). For a list of samples,"
        " the table has only this error, because the others need a source that homofact can evaluate everywhere."
    )
    text = "\n\n".join(
        [
            "# Gallery",
            introduction,
            *parts,
            "## Errors",
            errors,
            markdown(header, rows),
            f"Settings: effort {options.effort}, {count:,} pairs of directions, seed 0. {machine()}",
            *(["a smoke test: the figures mean nothing"] if options.short else []),
        ]
    )
    write(options.out, text + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
