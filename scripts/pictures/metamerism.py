"""Draw a paint, its fit by spectral basis vectors, a metamer and its RGB fit under daylight, a bulb and a tube.

    python scripts/pictures/metamerism.py [--data FOLDER] [--tolerance 0.5] [--out FILE.png] [--short]

Spheres under one lamp of D65, A and F11, in sRGB as an observer sees them who is adapted to each light (Bradford), at
one exposure. From left to right: the fit of all 31 bands of garnet red; the fit by basis vectors; a metamer of the
paint; and the RGB fit, which looks the same under every adapted light. Under each sphere is the mean CIEDE2000 of its
lit pixels to the first one in its row.

The metamer is made up: the bands of the second fit times a factor from 1/4 to 4, of which a linear program finds
the one that changes the paint's mean colour the most from red to green under F11, while under D65 the mean colour and
that of a flat spectrum stay. Nothing in the fit changes but the 31 numbers A.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from scipy.optimize import linprog
from torch import Tensor

from homofact.brdf.cielab import ciede2000
from homofact.brdf.colour_difference import ILLUMINANTS, lab_of, lab_of_xyz
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.source import open_source
from homofact.brdf.spectral import to_rgb, xyz_weights
from homofact.brdf.tristimulus import to_xyz
from homofact.factor.fitted import Fitted
from homofact.factor.spectral_fit import SpectralFit
from homofact.files import extras
from homofact.files.atomic import replace_file
from homofact.methods.common import in_spectral_basis
from homofact.methods.search import Search
from homofact.rendering.light import DirectionalLight
from homofact.rendering.sphere import SphereImage
from homofact.rendering.surface import seen_surface
from homofact.rendering.tonemap import tonemap

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, cornell_files, data_folder, markdown, parser_of

PAINT, PIXELS = "garnet_red", 220
LAMP = DirectionalLight((-0.4, 0.5, 1.0))
# Of a metamer's bands to the paint's: at least, at most, and by how much from one to the next.
LEAST, MOST, STEP = 0.25, 4.0, 1.0
WORDS = {"D65": "D65, daylight", "A": "A, an incandescent bulb", "F11": "F11, a fluorescent tube"}


def apparent(fit: Fitted, size: int) -> tuple[Tensor, Tensor, Tensor]:
    """(f cosθ (P, C) of the lit pixels, which these are, the coverage (size, size))."""
    coverage, surface = seen_surface(size, (0.0, 0.0, 1.0))
    wi = surface.frame @ LAMP.unit()
    lit = wi[:, 2] > 0
    return fit.evaluate(wi[lit], surface.wo[lit]) * wi[lit, 2:], surface.pixels[lit], coverage


def factor_of_metamer(mean: np.ndarray, bands: Sequence[float]) -> np.ndarray:
    """The factor (W,) by which a metamer's bands differ from those of a spectrum `mean` (W,)."""
    count = len(bands)
    daylight, tube = (xyz_weights(bands, name) / xyz_weights(bands, name).sum(0) for name in ("D65", "F11"))
    # Both spectra keep X, Y and Z under D65.
    kept = np.concatenate(((mean[:, None] * daylight).T / mean.mean(), daylight.T))
    smooth = np.eye(count - 1, count, 1) - np.eye(count - 1, count)
    redder = mean * (tube[:, 0] - tube[:, 1])
    found = linprog(
        redder / abs(redder).max(),
        A_ub=np.concatenate((smooth, -smooth)),
        b_ub=np.full(2 * (count - 1), STEP),
        A_eq=kept,
        b_eq=kept.sum(1),
        bounds=(LEAST, MOST),
    )
    return found.x


def labs(values: Tensor, bands: Sequence[float], illuminant: str) -> np.ndarray:
    """L*a*b* (P, 3) of spectra or of linear sRGB, which is the same under every light."""
    if values.shape[1] == 3:
        return lab_of_xyz(to_xyz(values, ("R", "G", "B")).numpy(), xyz_weights(range(360, 781)).sum(0))
    return lab_of(values.numpy(), bands, illuminant)


def draw(
    path: Path, fits: dict[str, Fitted], bands: Sequence[float], curves: dict[str, np.ndarray], size: int
) -> list[tuple[str, ...]]:
    """Write the picture; the rows of mean differences to the first fit."""
    pyplot = extras.library("matplotlib.pyplot", "the picture")
    lit = {name: apparent(fit, size) for name, fit in fits.items()}
    _, _, coverage = next(iter(lit.values()))
    level = float(torch.quantile(to_rgb(next(iter(lit.values()))[0], bands)[0].max(1).values, 0.9))
    figure, axes = pyplot.subplots(
        len(ILLUMINANTS), len(fits) + 1, figsize=(13, 8.4), width_ratios=[1] * len(fits) + [1.25], dpi=88
    )
    rows = []
    for place, name in zip(axes[0], fits, strict=False):
        place.set_title(name, fontsize=10)
    for row, light in zip(axes, ILLUMINANTS, strict=True):
        first = labs(next(iter(lit.values()))[0], bands, light)
        cells = []
        for place, (values, pixels, _) in zip(row, lit.values(), strict=False):
            shown = values if values.shape[1] == 3 else to_rgb(values, bands, light)[0]
            radiance = torch.zeros(size * size, 3, dtype=torch.float64).index_copy(0, pixels, shown)
            image = SphereImage(radiance.reshape(size, size, 3), coverage)
            place.imshow(tonemap(image, 0.55 / level).pixels.numpy())
            apart = float(ciede2000(first, labs(values, bands, light)).mean())
            cells.append(f"{apart:.2f}")
            place.set_xticks([])
            place.set_yticks([])
            place.set_frame_on(False)
            if place is not row[0]:
                place.set_xlabel(f"ΔE2000 {apart:.2f}")
        row[0].set_ylabel(WORDS[light])
        rows.append((light, *cells[1:]))
        power = xyz_weights(bands, light)
        row[-1].plot(bands, power.sum(1) / power.sum(1).max(), color="0.8", label="light × eye")
        for (name, curve), colour in zip(curves.items(), ("tab:red", "tab:blue"), strict=True):
            row[-1].plot(bands, curve / max(map(np.max, curves.values())), color=colour, label=name)
        row[-1].set_yticks([])
        row[-1].set_xlabel("wavelength in nm")
    axes[0, -1].legend(fontsize=8, frameon=False)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, lambda beside: figure.savefig(beside, format="png"))
    pyplot.close(figure)
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit, draw, and print the differences; 1 where the paint is not there."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--tolerance", type=float, default=0.5, help="the basis's tolerance (%(default)s)")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "pictures" / "metamerism.png")
    options = parser.parse_args(arguments)
    files, missing = cornell_files(data_folder(options.data))
    chosen = [file for file in files if file.stem == PAINT]
    if not chosen:
        print("\n".join(line for line in missing if PAINT in line), file=sys.stderr)
        return 1
    method = Search(size=6, effort="quick", epsilon=1e-2) if options.short else Search(epsilon=1e-2)
    rgb, source = (open_source(str(chosen[0]), channels=channels) for channels in ("rgb", "spectral"))
    whole = method.fit(source.samples)
    basis = in_spectral_basis(
        whole, source.samples, replace(method, spectral_tolerance=options.tolerance)
    ).factorization
    assert isinstance(basis, SpectralFit)
    bands = basis.wavelengths
    mean = apparent(basis, 64)[0].numpy().mean(0)
    transform = basis.transform
    factor = factor_of_metamer(mean, bands)
    metamer = replace(basis, transform=LogTransform(transform.epsilon, transform.mean * factor))
    fits = {
        f"all 31 bands\n{whole.nbytes:,} bytes": whole.factorization,
        f"{basis.basis.rank} basis vectors\n{basis.nbytes:,} bytes": basis,
        "a metamer of the paint\n(made up)": metamer,
        "RGB fit\n(the same under all lights)": method.fit(rgb.samples).factorization,
    }
    curves = {"paint": mean, "metamer": mean * factor}
    rows = draw(options.out, fits, bands, curves, 48 if options.short else PIXELS)
    print(markdown(("light", *(name.split("\n")[0] for name in list(fits)[1:])), rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
