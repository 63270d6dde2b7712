"""Render one scene in Mitsuba 3 with a measured material, by Mitsuba's own `measured` and by our fit.

python scripts/engines/mitsuba_comparison.py [FILE.bsdf] [--fit RESULT] [--picture PLACE.png] [--throughput]

The file is an RGL measurement in RGB (Dupuy and Jakob 2018). Both sides render in linear sRGB: the plugin's values in
an rgb variant are the file's own R, G and B, and the fit was made from the same three numbers, so that no spectrum is
converted on either side. The plugin's negative values (colours outside the gamut) stay as they are; ours are never
below 0. The plugin takes the camera's direction for the measurement's ωi; the fit is reciprocal, so that it does not
matter which is which.

Each side is rendered twice from different seeds: the picture is the mean, half the difference of the two its
Monte-Carlo noise. Errors are over pixels that the object covers wholly, of all three channels:

    relative RMS = √(Σ(fit − source)²/Σ source²),    noise = the same of half the difference of the two renderings.

Seconds are the processor's, all threads together: a busy machine does not change them much.

`--throughput` times `eval` (f cosθ, all three channels) of both instead, on one thread and on all, on the same pairs
of directions, both uniform on the hemisphere (`mitsuba_throughput`).
"""

import sys
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from torch import Tensor

from homofact.brdf.source import open_source
from homofact.cli.verdicts import verdict_lines
from homofact.errors import BadInput
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.machine import machine
from homofact.factor.fitted import Fitted
from homofact.figures.compare_picture import FLOOR, relative_difference
from homofact.files.atomic import replace_file
from homofact.geometry.directions import draw_uniform
from homofact.methods.search import Search
from homofact.rendering.mitsuba_bsdf import VARIANT, load_bsdf, measured_bsdf, open_fit, open_mitsuba
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import choose_exposure, tonemap

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.engines.mitsuba_throughput import BATCHES, throughput_of
from scripts.shared.harness import data_folder, figure, finish, markdown, parser_of

FILE = "vch_golden_yellow_rgb.bsdf"
SCENE = "a softbox before the sphere, a strip behind it, a made-up sky, a grey ground; up to 5 bounces"
_PANEL = 300  # pixels that the words under a picture need
_REACHES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


@dataclass(frozen=True)
class Rendering:
    """The mean of two renderings (H, W, 3), half their difference, CPU seconds of both, and of the first alone.

    The first makes the kernels; `seconds` is twice what the second took.
    """

    radiance: Tensor
    noise: Tensor
    seconds: float
    first: float


def scene(mi: Any, bsdf: Any, size: int, only_cover: bool = False) -> Any:
    """The sphere on its ground; with `only_cover` the object alone, which then shows its share of every pixel."""
    at = mi.ScalarTransform4f()
    camera = {
        "type": "perspective",
        "fov": 20.5,
        "to_world": at.look_at([0, -6.2, 2.6], [0, 0, 0.96], [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
        "sampler": {"type": "multijitter"},
    }
    sphere = {"type": "sphere", "center": [0, 0, 1], "radius": 1.0}
    if only_cover:
        shine = {"type": "area", "radiance": {"type": "rgb", "value": 1.0}}
        only = {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": camera,
            "object": sphere | {"emitter": shine},
        }
        return mi.load_dict(only)

    def lamp(place: list[float], width: float, height: float, radiance: float) -> dict[str, Any]:
        turned = at.look_at(place, [0, 0, 1], [0, 0, 1]) @ at.scale([width, height, 1])
        light = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
        return {"type": "rectangle", "to_world": turned, "emitter": light}

    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 6},
            "sensor": camera,
            "object": sphere | {"bsdf": bsdf},
            "ground": {
                "type": "rectangle",
                "to_world": at.scale([80, 80, 1]),
                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.3}},
            },
            "softbox": lamp([-2.8, -3.4, 5.0], 1.6, 1.6, 3.5),
            "strip": lamp([4.4, 3.0, 2.6], 0.8, 2.2, 6.0),
            "sky": {"type": "envmap", "bitmap": sky(mi), "to_world": at.rotate([1, 0, 0], 90), "scale": 1.5},
        }
    )


def sky(mi: Any) -> Any:
    """A made-up sky, 32 × 16: from the brown ground through a pale horizon to a blue zenith, linear sRGB."""
    height = np.linspace(1, -1, 16)[:, None, None]
    zenith, horizon, ground = (np.array(c) for c in ((0.28, 0.42, 0.70), (1.0, 0.95, 0.88), (0.2, 0.17, 0.14)))
    upper = horizon + (zenith - horizon) * np.clip(height, 0, 1) ** 0.5
    image = np.where(height > 0, upper, ground)
    return mi.Bitmap(np.ascontiguousarray(np.broadcast_to(image, (16, 32, 3)), dtype=np.float32))


def render(mi: Any, bsdf: Any, size: int, samples: int, seed: int) -> Rendering:
    """Two renderings of half the `samples` each."""
    whole = scene(mi, bsdf, size)
    images, seconds = [], []
    for k in range(2):
        began = time.process_time()
        images.append(torch.from_numpy(np.array(mi.render(whole, spp=samples // 2, seed=seed + k))).double())
        seconds.append(time.process_time() - began)
    return Rendering((images[0] + images[1]) / 2, (images[0] - images[1]) / 2, 2 * seconds[1], seconds[0])


def relative_rms(error: Tensor, source: Tensor, inside: Tensor) -> float:
    """√(Σ error²/Σ source²) over the pixels `inside` (H, W)."""
    return float((error[inside] ** 2).sum().sqrt() / (source[inside] ** 2).sum().sqrt())


def draw(
    path: Path, titles: list[str], renderings: list[Rendering], inside: Tensor, lines: list[str], footer: list[str]
) -> None:
    """Source, fit and difference side by side; what belongs to each under it, `footer` under all."""
    everything = torch.ones(inside.shape, dtype=torch.float64)
    images = [SphereImage(each.radiance, everything) for each in renderings]
    exposure = choose_exposure(SphereImage(images[0].radiance, inside.double()))
    difference = relative_difference(images[1], images[0], exposure)
    size = float(torch.quantile(difference[inside].abs().nan_to_num(), 0.98))
    reach = next((each for each in _REACHES if each >= size), _REACHES[-1])
    scale = Normalize(-reach, reach)
    coloured = colormaps["RdBu_r"](Normalize(-reach, reach, clip=True)(difference.nan_to_num().numpy()))[..., :3]
    shown = [tonemap(image, exposure).pixels.numpy() for image in images] + [coloured]
    pixels, gap, text, dpi = inside.shape[0], 16, 17, 100
    panel = max(pixels, _PANEL)
    width = 3 * panel + 4 * gap
    top, below = 30, 54 + text * max(len(line.split("\n")) for line in lines)
    height = top + pixels + below + text * (len(footer) + 1) + gap
    page = Figure(figsize=(width / dpi, height / dpi), dpi=dpi, facecolor="white")

    def write_lines(words: str, left: float, y: float) -> None:
        for k, line in enumerate(words.split("\n")):
            page.text(left / width, 1 - (y + (k + 0.7) * text) / height, line, fontsize=8.5, parse_math=False)

    for k, (title, picture) in enumerate(zip([*titles, "relative difference"], shown, strict=True)):
        left = gap + k * (panel + gap)
        page.text(left / width, 1 - (top - 9) / height, title, fontsize=10.5, weight="bold", parse_math=False)
        axes = page.add_axes((left / width, 1 - (top + pixels) / height, pixels / width, pixels / height))
        axes.imshow(picture, interpolation="none", aspect="auto")
        axes.set_axis_off()
        write_lines(lines[k], left, top + pixels + (46 if k == 2 else 6))
    left = gap + 2 * (panel + gap)
    bar = page.add_axes(((left + 16) / width, 1 - (top + pixels + 22) / height, (panel - 32) / width, 12 / height))
    ticks = [-reach, -reach / 2, 0, reach / 2, reach]
    page.colorbar(ScalarMappable(scale, colormaps["RdBu_r"]), cax=bar, orientation="horizontal").set_ticks(
        ticks, labels=["0" if t == 0 else f"{t * 100:+.3g}%".replace("-", "−") for t in ticks]
    )
    bar.tick_params(labelsize=8)
    words = [
        *footer,
        f"R, G, B of the file as linear sRGB on both sides, no spectra; exposure {exposure:.3g}, sRGB curve.",
    ]
    write_lines("\n".join(words), gap, top + pixels + below)
    replace_file(path, lambda beside: page.savefig(beside, dpi=dpi, format="png"))


def throughput(mi: Any, bsdfs: dict[str, Any], short: bool) -> str:
    """The table of rates on one thread and on all."""
    wi, wo = draw_uniform(1 << 16 if short else 1 << 20, torch.Generator().manual_seed(0))
    batches = BATCHES[:2] if short else BATCHES
    rows = []
    for threads in sorted({1, import_module("drjit").thread_count()}):
        for name, bsdf in bsdfs.items():
            found = throughput_of(mi, bsdf, wi, wo, threads, batches)
            rates = (f"{rate:.1f}" for rate in found.rates.values())
            rows.append((name, found.threads, *rates, f"{found.best:.1f} at {found.batch}"))
    return markdown(("eval, M/s", "threads", *(f"batch {count}" for count in batches), "best"), rows)


def main(arguments: list[str] | None = None) -> int:
    """Render, write and print; 2 where something is missing."""
    parser = parser_of(__doc__, "data", "effort")
    parser.add_argument("file", nargs="?", type=Path, help=f"RGL file in RGB ({FILE} of the real data)")
    parser.add_argument("--fit", type=Path, help="a result or saved file to compare, instead of a new fit")
    parser.add_argument("--out", type=Path, default=Path("out/mitsuba_comparison"), help="the folder to write")
    parser.add_argument("--picture", type=Path, help="where the picture goes (NAME.png in that folder)")
    parser.add_argument("--throughput", action="store_true", help="time eval instead of rendering")
    parser.add_argument("--textures", type=int, default=3, help="of the fit (%(default)s)")
    parser.add_argument("--projections", help="one name for all textures, or one each joined by + (the search chooses)")
    parser.add_argument("--texels", type=int, default=32, help="on a side of a texture (%(default)s)")
    parser.add_argument("--size", type=int, default=300, help="pixels per side (%(default)s)")
    parser.add_argument("--spp", type=int, default=512, help="samples per pixel (%(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    if chosen.short:
        chosen.size, chosen.spp, chosen.effort, chosen.texels = 96, 8, 1.0, 8
    try:
        return compare(chosen)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2


def compare(chosen: Any) -> int:
    """What `main` was asked for. Raises BadInput where a file or Mitsuba is missing or cannot be used."""
    mi = open_mitsuba()
    file = chosen.file or data_folder(chosen.data) / "rgl" / FILE
    chosen.out.mkdir(parents=True, exist_ok=True)
    place, words, verdict = chosen.fit, [], []
    if place is None:
        settings = Search(
            textures=chosen.textures,
            size=chosen.texels,
            effort=chosen.effort,
            seed=chosen.seed,
            projections=chosen.projections.split("+") if chosen.projections else None,
        )
        row = fit_and_measure(open_source(str(file)), settings)
        place = chosen.out / "factorization.npz"
        row.factorization.save(place)
        words = [f"log MSE {figure(row.held_out.log_mse)} on held-out samples, fitted in {row.seconds_fit:.1f} s"]
        verdict = [f"- {line.lstrip(' -')}" for line in verdict_lines(row)]
    fit = open_fit(place)
    measured = measured_bsdf(file)
    name = file.stem.removesuffix("_rgb")
    conditions = f"Mitsuba {mi.__version__}, {VARIANT}, {import_module('drjit').thread_count()} threads. {machine()}"
    if chosen.throughput:
        bsdfs = {f"fit: {described(fit)}": load_bsdf(place), f"measured: {name}": measured}
        table = throughput(mi, bsdfs, chosen.short)
        text = "\n".join(["# Throughput of eval in Mitsuba", "", f"- {conditions}", "", table, ""])
        return finish(text, chosen, chosen.out / "throughput.md")
    covered = torch.from_numpy(np.array(mi.render(scene(mi, None, chosen.size, True), spp=64)))[..., 0] > 0.999
    renderings = [render(mi, bsdf, chosen.size, chosen.spp, chosen.seed) for bsdf in (measured, load_bsdf(place))]
    source, ours = renderings
    error = relative_rms(ours.radiance - source.radiance, source.radiance, covered)
    noises = [relative_rms(each.noise, source.radiance, covered) for each in renderings]
    bias = float(ours.radiance[covered].sum() / source.radiance[covered].sum() - 1)
    lines = [
        f"Mitsuba's plugin measured, {file.stat().st_size // 1024} KiB of RGL\n{cost(source, noises[0])}",
        "\n".join([described(fit), cost(ours, noises[1]), *words]),
        f"(fit − source)/(source + {FLOOR:.0%} of white), luminance\n"
        f"relative RMS {error:.1%} on the sphere, mean {bias:+.1%}".replace("-", "−"),
    ]
    footer = [f"{SCENE[0].upper()}{SCENE[1:]}; {chosen.spp} samples per pixel. Mitsuba {mi.__version__}, {VARIANT}."]
    picture = chosen.picture or chosen.out / f"{name}.png"
    picture.parent.mkdir(parents=True, exist_ok=True)
    draw(
        picture,
        [name, "homofact's fit"],
        renderings,
        covered,
        lines,
        footer,
    )
    table = markdown(
        ("material", "rendered by", "relative RMS", "mean", "noise", "CPU seconds", "first half, kernels made"),
        [
            (name, "measured", "", "", f"{noises[0]:.3%}", f"{source.seconds:.2f}", f"{source.first:.2f}"),
            (name, described(fit), f"{error:.3%}", f"{bias:+.3%}", f"{noises[1]:.3%}", f"{ours.seconds:.2f}",
             f"{ours.first:.2f}"),
        ],
        2,
    )  # fmt: skip
    head = f"- {SCENE}; {chosen.size}² pixels, {chosen.spp} samples per pixel, seed {chosen.seed}"
    text = "\n".join([f"# {name} in Mitsuba", "", head, f"- {conditions}", *verdict, "", table, ""])
    finish(text, chosen, chosen.out / f"{name}.md")
    print(f"{chosen.out / name}.md, {picture}")
    return 0


def cost(rendering: Rendering, noise: float) -> str:
    """Noise and seconds of a rendering."""
    return f"{rendering.seconds:.0f} s of CPU time, Monte-Carlo noise {noise:.1%}"


def described(fit: Fitted) -> str:
    """Textures, bytes and fetches."""
    sizes = [f"{columns} × {rows}" for rows, columns in (texture.size for texture in fit.textures)]
    shape = f"of {sizes[0]}" if len(set(sizes)) == 1 else f"({', '.join(sizes)})"
    return f"{len(sizes)} textures {shape}, {fit.nbytes / 1024:.0f} KiB, {fit.fetches} fetches"


if __name__ == "__main__":
    sys.exit(main())
