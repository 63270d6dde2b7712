"""Compare textures as fitted, with each texel rounded to 8 bits, and solved for 8 bits.

    python scripts/accuracy/quantization.py [--data FOLDER] [--repeats 3] [--short]

Each material is fitted by `search` on training samples, once a seed, and its texels are stored both ways
(`homofact.factor.quantize`). Errors are Cole errors on the training samples and on samples held out and turned at
random, then their ratios to the fit in floating point, side by side in one run; `moved` is the root mean square change
of the logarithms at the held-out samples. Where a fit is far from its samples, what rounding adds to the error may
have either sign, and `moved` tells what it does.
"""

import sys
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from statistics import mean

from homofact.brdf.source import open_source
from homofact.evaluation.compare import held_out_samples
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.factor.factorization import Factorization
from homofact.factor.quantize import rounded
from homofact.methods.common import quantized
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import cornell_files, data_folder, figure, finish, markdown, parser_of

MATERIAL, PAINT, STORAGE, HELD_OUT, TARGET = "material:lafortune-blue-paint", "garnet_red", "png8", 0.2, 1.3
# Textures, and texels per side.
SIZES = ((2, 16), (5, 32))
WAYS = ("as fitted", "each texel rounded", "solved for 8 bits")


def errors(
    text: str, textures: int, size: int, seed: int, effort: str | float
) -> dict[str, tuple[float, float, float]]:
    """Cole errors on training and held-out samples, and how far the logarithms moved, of each of `WAYS`."""
    source = open_source(text, seed=seed)
    train = source.samples.split(HELD_OUT, seed)[0]
    held = held_out_samples(source, HELD_OUT, seed)
    method = Search(textures=textures, size=size, epsilon=source.default_epsilon, effort=effort, seed=seed)
    fitted = method.fit(train).factorization
    assert isinstance(fitted, Factorization)
    fits = (
        fitted,
        rounded(fitted, STORAGE),
        quantized(fitted, train, method, STORAGE),
    )
    before = fitted.evaluate_log(held.wi, held.wo)
    return {
        way: (
            measure(fit, train, fitted.transform).log_mse,
            measure(fit, held, fitted.transform).log_mse,
            float((fit.evaluate_log(held.wi, held.wo) - before).square().mean().sqrt()),
        )
        for way, fit in zip(WAYS, fits, strict=True)
    }


def table(
    texts: Sequence[str], sizes: Sequence[tuple[int, int]], seeds: Sequence[int], effort: str | float
) -> tuple[str, float]:
    """The table as Markdown, and the largest ratio of solved texels, mean over seeds."""
    rows, worst = [], 0.0
    for text, (textures, size) in product(texts, sizes):
        found = [errors(text, textures, size, seed, effort) for seed in seeds]
        base = [mean(each[WAYS[0]][k] for each in found) for k in (0, 1)]
        for way in WAYS:
            values = [mean(each[way][k] for each in found) for k in (0, 1, 2)]
            ratios = [value / start for value, start in zip(values, base, strict=False)]
            if way == WAYS[2]:
                worst = max(worst, *ratios)
            name = f"{Path(text).stem.removeprefix('material:')}, {textures} × {size}²"
            rows.append((name, way, *map(figure, (*values[:2], *ratios, values[2]))))
    header = ("material, textures", "texels", "training", "held out", "of the fit, training", "held out", "moved")
    return markdown(header, rows, 2), worst


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args(arguments)
    files, missing = cornell_files(data_folder(options.data))
    texts = [MATERIAL, *(str(file) for file in files if file.stem == PAINT)]
    if len(texts) == 1:
        print("\n".join(line for line in missing if PAINT in line), file=sys.stderr)
    repeats, effort = (1, 1.0) if options.short else (options.repeats, "quick")
    found, worst = table(texts, SIZES[:1] if options.short else SIZES, range(repeats), effort)
    text = "\n\n".join(
        [
            found,
            f"Most: {figure(worst)} times the fit in floating point; expected at most {figure(TARGET)}.",
            f"At most so many textures; searched with effort {effort}, mean of seeds 0 to {repeats - 1}. {machine()}",
        ]
    )
    return finish(text, options)


if __name__ == "__main__":
    sys.exit(main())
