"""Draw the error of fits against the processor time that they take: this search, Cole's, McCool's, NPF and NBRDF.

Ten measurements of RGL and three Cornell paints, each fitted to 80% of its samples by every way in turn: the search
with the efforts quick and normal, the search that tries every mix with the units of normal (what normal was in 0.2.0),
Cole's procedure and McCool's projections, all with two textures of 16²; a search within the bytes of NPF; then two GGX
lobes, non-parametric factors (NPF) and the neural network NBRDF at their own sizes. Errors are the Cole error of the
held-out samples at random azimuths and the relative RMS of f cosθi cosθo; seconds are of the processor, on one thread,
without reading the file.

    python scripts/speed/error_against_time.py [--work FILE] [--plot FILE] [--data FOLDER]
"""

import sys
import time
from collections.abc import Mapping
from pathlib import Path
from statistics import median
from typing import Any

from homofact.brdf.source import open_source
from homofact.evaluation.energy import energy_errors
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.figures.log_axis import log_x, log_y
from homofact.linear.normal import warm_up
from homofact.methods.effort import LEVELS
from homofact.methods.table import made

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.accuracy.known_mixes import MEASURED
from scripts.shared.harness import CORNELL, Finished, data_folder, figure, finish, markdown, parser_of, progress

# Each way's method, what is given to it, and the colour and shape of its points.
WAYS: dict[str, tuple[str, dict[str, Any], str, str]] = {
    "search, quick": ("search", {"textures": 2, "size": 16, "effort": "quick"}, "#d55e00", "o"),
    "search, 3.2 KiB": ("search", {"textures": 2, "bytes": 3264, "effort": "normal"}, "#e69f00", "s"),
    "search, normal": ("search", {"textures": 2, "size": 16, "effort": "normal"}, "#d55e00", "s"),
    "search, every mix": ("search", {"textures": 2, "size": 16, "effort": LEVELS["normal"] * 4}, "#d55e00", "D"),
    "cole": ("cole", {"textures": 2, "size": 16}, "#0072b2", "^"),
    "mccool": ("mccool", {"size": 16}, "#009e73", "v"),
    "ggx:2": ("ggx", {"lobes": 2}, "#999999", "P"),
    "npf": ("npf", {}, "#cc79a7", "X"),
    "nbrdf": ("nbrdf", {}, "#56b4e9", "*"),
}

# What the key of the picture calls a way whose name is a method's label, or has its own bytes.
LABELS = {
    "search, 3.2 KiB": "search, normal, bytes of NPF", "cole": "Cole", "mccool": "McCool", "ggx:2": "two GGX lobes",
    "npf": "NPF", "nbrdf": "NBRDF",
}  # fmt: skip


def fitted(path: str, way: str) -> dict[str, float]:
    """Errors, processor seconds and bytes of one fit."""
    name, settings, *_ = WAYS[way]
    source = open_source(path)
    train, held = source.samples.split(0.2, 0)
    held = held.rotated_at_random(0) if held.isotropic else held
    method = made(name, settings | {"epsilon": source.default_epsilon, "seed": 0})
    began = time.process_time()
    fit = method.fit(train)
    seconds = time.process_time() - began
    error = measure(fit.factorization, held, fit.factorization.transform).log_mse
    rms = energy_errors(fit.factorization, source.reflectance, source.samples.isotropic).rms
    return {"seconds": seconds, "error": error, "rms": rms, "bytes": float(fit.factorization.nbytes)}


def draw(found: Mapping[str, Mapping[str, Mapping[str, float]]], path: Path) -> None:
    """Draw both errors against seconds: a small point per material, and the median of each way large with its name."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    drawn, panels = pyplot.subplots(1, 2, figsize=(10.5, 4.4), layout="constrained")
    kinds = (("error", "Cole error of held-out samples"), ("rms", "relative RMS of f cosθi cosθo"))
    for axes, (kind, words) in zip(panels, kinds, strict=True):
        for way, (_, _, colour, shape) in WAYS.items():
            figures = [by_way[way] for by_way in found.values()]
            times, errors = [each["seconds"] for each in figures], [each[kind] for each in figures]
            axes.plot(times, errors, shape, color=colour, markersize=4, alpha=0.35, linestyle="none")
            label = f"{LABELS.get(way, way)}, {median(each['bytes'] for each in figures) / 1024:.1f} KiB"
            axes.plot(
                [median(times)], [median(errors)], shape, color=colour, markersize=11, markeredgecolor="black",
                linestyle="none", label=label,
            )  # fmt: skip
        axes.set(xlabel="processor time of the fit [s]", ylabel=words)
        log_x(axes, *_ends(found, "seconds"))
        log_y(axes, *_ends(found, kind))
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(True, which="major", alpha=0.25)
    drawn.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    drawn.suptitle(f"{len(found)} measured materials (small marks) and their medians (large marks)")
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn.savefig(path, dpi=130)
    pyplot.close(drawn)


def _ends(found: Mapping[str, Mapping[str, Mapping[str, float]]], key: str) -> tuple[float, float]:
    """The ends of an axis a little beyond all numbers."""
    numbers = [each[key] for by_way in found.values() for each in by_way.values()]
    return min(numbers) / 1.4, max(numbers) * 1.4


def main(arguments: list[str] | None = None) -> int:
    """Fit, print medians and every material, and draw them where that is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--work", type=Path, help="where results are kept, so that an ended run goes on")
    parser.add_argument("--plot", type=Path, help="a picture (.png, .svg, .pdf)")
    parser.add_argument("--ways", nargs="+", default=list(WAYS), choices=WAYS, help="which methods")
    options = parser.parse_args(arguments)
    folder, kept = data_folder(options.data), Finished(options.work)
    files = [folder / "rgl" / f"{name}_rgb.bsdf" for name in MEASURED]
    files += [folder / "cornell" / f"{name}.brdf" for name in CORNELL]
    paths = [str(file) for file in files if file.is_file()]
    if options.short:
        paths = ["material:phong-30"]
    warm_up()
    found: dict[str, dict[str, dict[str, float]]] = {}
    for path in paths:
        name = Path(path).stem.removesuffix("_rgb")
        found[name] = {}
        for way in options.ways:
            found[name][way] = kept.get(f"{name} {way}", lambda path=path, way=way: fitted(path, way))
            progress(name, way, *(f"{key} {figure(value)}" for key, value in found[name][way].items()))
    columns = ("bytes", "seconds", "error", "rms")
    medians = [
        (way, *(figure(median(each[way][key] for each in found.values())) for key in columns)) for way in options.ways
    ]
    whole = [
        (name, *(figure(ways[way][key]) for way in options.ways for key in ("seconds", "error")))
        for name, ways in found.items()
    ]
    if options.plot is not None and len(options.ways) == len(WAYS):
        draw(found, options.plot)
    heads = ("material", *(f"{way} {key}" for way in options.ways for key in ("s", "error")))
    return finish(
        [
            f"Medians over {len(found)} materials. {machine()}",
            markdown(("method", "bytes", "CPU s", "Cole error", "RMS"), medians),
            markdown(heads, whole),
        ],
        options,
    )


if __name__ == "__main__":
    sys.exit(main())
