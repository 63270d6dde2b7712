"""Draw the picture at the head of README: paints and metals on spheres, each cut in two.

    python scripts/pictures/hero_picture.py [--data FOLDER] [--keep FOLDER] [--out docs/pictures/hero.jpg]

The left half of a sphere is the measurement, the right half its fit with textures of 8 bits, 16 for the golden yellow;
below them the bytes of the textures and the PSNR of the fit's whole sphere, as the picture shows it. The measurements
are three paints of the RGL database (Dupuy and Jakob 2018) and two networks that were fitted to MERL materials
(Sztrajman et al. 2021; not MERL itself); the brushed aluminium is Ward's model (Ward 1992). The light is P. Debevec's
probe of St. Peter's, also out of focus behind the spheres, which are `rendering.filtered`'s, without noise. `--keep`
keeps the fits, and takes those that are there. Without the measurements the script says which file is missing.
"""

import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter, map_coordinates

from homofact.brdf.source import open_source
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import BadInput
from homofact.evaluation.compare import fit_and_measure
from homofact.exporting.result import open_result
from homofact.factor.fitted import Fitted
from homofact.methods.search import Search
from homofact.rendering.environment import read_environment
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.lobe_patches import DRAFT
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import encode_srgb

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, data_folder, parser_of, progress

PLACE = ROOT / "docs" / "pictures" / "hero.jpg"
NETWORKS = "nbrdf/merl_nbrdf_weights.npz"
MATERIALS = (
    ("golden yellow", "satin paint, RGL", "rgl/vch_golden_yellow_rgb.bsdf", "", 16),
    ("light blue", "chrome paint, RGL", "rgl/chm_light_blue_rgb.bsdf", "", 8),
    ("red metallic", "car paint, MERL surrogate", NETWORKS, "#red-metallic-paint", 8),
    ("flake paint", "iridescent, RGL", "rgl/irid_flake_paint1_rgb.bsdf", "", 8),
    ("brass", "metal, MERL surrogate", NETWORKS, "#brass", 8),
    ("brushed aluminium", "Ward's model", "", "material:ward-brushed", 8),
)
LIGHT = "envmaps/stpeters_probe_latlong.hdr"
WIDTH, HEIGHT, FINER = 1600, 500, 2
STEP, LEVEL = 262, 205  # pixels from sphere to sphere, and from the top to their middles
SIDE = 268  # of a sphere's picture, whose radius is 0.94 of half of it
VIEW = (0.0, 0.0, 1.0)
MIDDLE, TURN, ACROSS, BLUR, DIM = 0.17, 0.0, 150.0, 1.6, 0.22  # exposure; degrees; texels of the map


class Pair(NamedTuple):
    """A material's name, what it is, its measurement's and its fit's sphere, and the bytes of the textures."""

    name: str
    kind: str
    source: SphereImage
    fit: SphereImage
    size: int


def fitted(name: str, path: str, bits: int, options: "Options") -> Fitted:
    """The fit of three textures of 32² with texels of so many bits; taken from `keep` where it is there."""
    effort, keep = options.effort, options.keep
    kept = None if keep is None else keep / f"{name.replace(' ', '-')}.npz"
    if kept is not None and kept.is_file():
        return open_result(kept)
    short = not isinstance(effort, str)
    settings = Search(textures=3, size=4 if short else 32, effort=effort, quantize=f"png{bits}")
    found = fit_and_measure(open_source(path, count=400 if short else 45_000), settings, HELD_OUT).factorization
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        found.save(kept)
    return found


def pairs(light: EnvironmentMap, folder: Path, options: "Options") -> Iterator[Pair]:
    """Both spheres of each material."""
    around = Surroundings.of(light, options.side, VIEW, DRAFT)
    for name, kind, file, member, bits in MATERIALS[: 1 if options.short else None]:
        path = f"{folder / file}{member}" if file else member
        fit = fitted(name, path, bits, options)
        source = open_source(path, count=64).reflectance
        images = [FilteredMaterial.of(each, view=VIEW, fineness=DRAFT).under(around) for each in (source, fit)]
        size = sum(texture.texels.size for texture in fit.textures) * bits // 8
        progress(name, size)
        yield Pair(name, kind, images[0], images[1], size)


class Options(NamedTuple):
    """What the command line says."""

    short: bool
    effort: str | float
    keep: Path | None

    @property
    def side(self) -> int:
        """Pixels of a sphere's picture before everything is made smaller."""
        return 32 if self.short else FINER * SIDE


def surroundings(folder: Path) -> EnvironmentMap:
    """The light in 256 rows. Raises BadInput where it cannot be read."""
    full = read_environment(folder / LIGHT).radiance
    factor = max(full.shape[0] // 256, 1)
    rows, columns = full.shape[0] // factor, full.shape[1] // factor
    small = full[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor, 3).mean((1, 3))
    return EnvironmentMap(small, math.radians(TURN), LIGHT)


def backdrop(light: EnvironmentMap, exposure: float) -> np.ndarray:
    """Linear values (H, W, 3), below the curve, of what stands behind the spheres: a wide strip, out of focus."""
    # Blurred where it is shown, so that lamps stay discs.
    shown = filmic(light.radiance.numpy() * exposure)
    rows, columns = shown.shape[:2]
    shown = np.stack([gaussian_filter(shown[..., k], BLUR, mode="wrap") for k in range(3)], -1)
    height, width = FINER * HEIGHT, FINER * WIDTH
    across = (np.arange(width) + 0.5) / width - 0.5
    down = (np.arange(height) + 0.5) / height - 0.45
    column = (0.5 + math.radians(TURN) / (2 * math.pi) + across * ACROSS / 360) % 1 * columns - 0.5
    row = (0.5 + down * ACROSS / 180 * height / width) * rows - 0.5
    places = np.broadcast_arrays(row[:, None], column[None])
    return np.stack([map_coordinates(shown[..., k], places, order=1, mode="grid-wrap") for k in range(3)], -1)


def filmic(linear: np.ndarray) -> np.ndarray:
    """Linear values below the curve of `rendering.tonemap`, clipped."""
    x = np.maximum(linear, 0)
    return np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0, 1)


def decibels(pair: Pair, exposure: float) -> float:
    """PSNR of the fit's sphere as the picture shows it, sRGB values of peak 1."""
    inside = pair.source.coverage.numpy() > 0
    shown = [encoded(filmic(each.radiance.numpy() * exposure)) for each in (pair.source, pair.fit)]
    return -10 * math.log10(float(((shown[0] - shown[1])[inside] ** 2).mean()))


def encoded(linear: np.ndarray) -> np.ndarray:
    """The sRGB curve."""
    return encode_srgb(torch.from_numpy(np.ascontiguousarray(linear))).numpy()


def drawn(light: EnvironmentMap, found: list[Pair], side: int) -> Image.Image:
    """The picture."""
    width = FINER * WIDTH
    middles = (np.arange(len(found)) - (len(found) - 1) / 2) * FINER * STEP
    medians = [float(each.source.radiance.mean(2)[each.source.coverage > 0].median()) for each in found]
    exposure = MIDDLE / math.exp(float(np.log(medians).mean()))
    linear = DIM * backdrop(light, exposure)
    # The captions' ground.
    row = np.linspace(0, HEIGHT, len(linear))[:, None, None]
    linear *= 1 - 0.9 * np.clip((row - 315) / 70, 0, 1)
    for pair, middle in zip(found, middles, strict=True):
        left, top = round(width / 2 + middle - side / 2), round(FINER * LEVEL - side / 2)
        half = side // 2
        both = np.concatenate((pair.source.radiance.numpy()[:, :half], pair.fit.radiance.numpy()[:, half:]), 1)
        shown, share = filmic(both * exposure), pair.source.coverage.numpy()[..., None].copy()
        shown[:, half - 1 : half + 1] = 0.5 * shown[:, half - 1 : half + 1] + 0.5
        place = np.s_[top : top + side, left : left + side]
        linear[place] = shown * share + linear[place] * (1 - share)
    pixels = (encoded(linear) * 255).round().astype(np.uint8)
    picture = Image.fromarray(pixels).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    write_captions(picture, found, middles / FINER, exposure)
    return picture


def write_captions(picture: Image.Image, found: list[Pair], middles: np.ndarray, exposure: float) -> None:
    """Name, kind, bytes and decibels below each sphere."""
    draw = ImageDraw.Draw(picture)
    for pair, middle in zip(found, middles, strict=True):
        x = WIDTH / 2 + float(middle)
        for y, size, colour, text in (
            (378, 24, "#ffffff", pair.name),
            (405, 17, "#c9ccd2", pair.kind),
            (432, 20, "#ffe9b0", f"{pair.size / 1024:.1f} KiB · {decibels(pair, exposure):.0f} dB"),
        ):
            draw.text((x, y), text, font=font(size), fill=colour, anchor="mm")
    words = "left halves: the measurement or model · right halves: homofact, two or three small textures"
    draw.text((WIDTH / 2, 474), words, font=font(18), fill="#c9ccd2", anchor="mm")


def font(size: int) -> ImageFont.FreeTypeFont:
    """Matplotlib's own DejaVu Sans."""
    from matplotlib.font_manager import findfont

    return ImageFont.truetype(findfont("DejaVu Sans"), size)


def main(arguments: list[str] | None = None) -> int:
    """Fit, draw, write."""
    parser = parser_of(__doc__, "data", "effort")
    parser.add_argument("--keep", type=Path, help="a folder for the fits")
    parser.add_argument("--out", type=Path, default=PLACE, help="where the picture goes (%(default)s)")
    chosen = parser.parse_args(arguments)
    folder = data_folder(chosen.data)
    options = Options(chosen.short, 5.0 if chosen.short else chosen.effort, chosen.keep)
    for file in dict.fromkeys((LIGHT, *(each[2] for each in MATERIALS if each[2]))):
        if not (folder / file).is_file():
            print(f"nothing is drawn: no {folder / file} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
            return 0 if options.short else 2
    try:
        light = surroundings(folder)
        found = list(pairs(light, folder, options))
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    drawn(light, found, options.side).save(chosen.out, quality=90, optimize=True, subsampling=0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
