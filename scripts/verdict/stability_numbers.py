"""Measure how steady fits are: noise in the data, the seed of the search, and the stated confidence.

    python scripts/verdict/stability_numbers.py [--only noise seeds confidence] [--effort quick] [--short]

Blue paint (`lafortune-blue-paint`), 16², ε = 1e-5.

* noise: a search on data with 1% multiplicative noise fixes projections and λ; the textures are solved again for other
  draws of the noise. How far each exported texture moves, root mean square over its texels and channels: of the log
  texture as it is (0.01 is 1% of the exponentiated texel), and of its exponential over its root mean square.
* seeds: five textures, one search a seed; errors on a second draw of the samples.
* confidence: noise of 5% in the log, thirty draws; the spread of every texel over the draws beside `Term.deviation`
  of the first, by texture.
"""

import sys
from dataclasses import replace
from pathlib import Path

import torch

from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.factor.confidence import with_deviations
from homofact.factor.factorization import Term
from homofact.factor.textures import LogSamples, solve_terms
from homofact.methods.search import Search
from homofact.methods.search_fit import fit_search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import add_effort, figure, markdown, parser_of

PARTS = ("noise", "seeds", "confidence")
EPSILON = 1e-5


def noisy(samples: Samples, level: float, seed: int) -> Samples:
    """The samples times exp(level · normal)."""
    generator = torch.Generator().manual_seed(1000 + seed)
    draw = torch.randn(samples.values.shape, dtype=torch.float64, generator=generator)
    return replace(samples, values=samples.values * torch.exp(level * draw))


def solved_again(samples: Samples, terms: tuple[Term, ...], smoothing: tuple[float, ...], like) -> tuple[Term, ...]:
    """Textures of other samples for the projections, shapes and λ of a fit."""
    logs = LogSamples.of(samples, like.transform)
    shapes = tuple(term.size for term in terms)
    return solve_terms(logs, tuple(term.projection for term in terms), shapes, smoothing, "cholesky").terms


def noise(samples: Samples, effort: str | float, draws: int) -> None:
    """How far 1% of noise moves the textures, at two and five."""
    rows = []
    for count in (2, 5):
        fit = fit_search(noisy(samples, 0.01, 0), Search(textures=count, epsilon=EPSILON, effort=effort))
        terms = tuple(fit.factorization.terms)
        smoothing = tuple(fit.factorization.provenance["smoothing"])
        again = [
            solved_again(noisy(samples, 0.01, draw), terms, smoothing, fit.factorization)
            for draw in range(1, draws + 1)
        ]
        for j, term in enumerate(terms):
            logs, exported = [], []
            for other in again:
                here = term.mask & other[j].mask
                one, two = term.texture[here], other[j].texture[here]
                logs.append(float((two - one).square().mean().sqrt()))
                exported.append(
                    float((two.exp() - one.exp()).square().mean().sqrt() / one.exp().square().mean().sqrt())
                )
            rows.append([count, j, term.projection.name, *(figure(max(x)) for x in (logs, exported))])
    print("\n## 1% of noise: how far textures move, worst of the draws (asked: at most 0.05)\n")
    print(markdown(["textures", "texture", "projection", "RMS of the log", "RMS of the exponential"], rows))


def seeds(samples: Samples, test: Samples, effort: str | float, count: int) -> None:
    """Errors of five-texture searches over seeds."""
    errors = []
    for seed in range(count):
        fit = fit_search(samples, Search(textures=5, epsilon=EPSILON, effort=effort, seed=seed)).factorization
        errors.append(measure(fit, test, fit.transform).log_mse)
    ordered = sorted(errors)
    print(f"\n## Five textures over {count} seeds, effort {effort}: log MSE on a second draw\n")
    print(markdown(["best", "median", "worst", "worst / best (asked: 1.25)"], [[
        figure(ordered[0]), figure(ordered[len(ordered) // 2]), figure(ordered[-1]), figure(ordered[-1] / ordered[0])
    ]], 0))  # fmt: skip


def confidence(samples: Samples, effort: str | float, draws: int) -> None:
    """The observed spread of every texel beside the stated one."""
    level = 0.05
    fit = fit_search(noisy(samples, level, 0), Search(textures=2, epsilon=EPSILON, effort=effort))
    smoothing = tuple(fit.factorization.provenance["smoothing"])
    terms = tuple(fit.factorization.terms)
    again = [solved_again(noisy(samples, level, draw), terms, smoothing, fit.factorization) for draw in range(draws)]
    logs = LogSamples.of(noisy(samples, level, 0), fit.factorization.transform)
    rows = []
    for j, term in enumerate(with_deviations(logs, again[0], smoothing)):
        assert term.deviation is not None
        here = term.mask
        observed = torch.stack([terms[j].texture for terms in again]).std(0)[here]
        stated = term.deviation[here]
        ratio = observed / stated
        rows.append(
            [
                j,
                term.projection.name,
                figure(float(stated.square().mean().sqrt())),
                figure(float(observed.square().mean().sqrt() / stated.square().mean().sqrt())),
                figure(float(ratio.median())),
            ]
        )
    print(
        f"\n## Confidence, noise of {level:.0%}, {draws} draws: observed over stated spread (asked: within 20% of 1)\n"
    )
    print(markdown(["texture", "projection", "stated RMS", "observed / stated RMS", "median texel"], rows))


def main(arguments: list[str] | None = None) -> int:
    """Print the parts asked for."""
    parser = parser_of(__doc__)
    parser.add_argument("--only", nargs="*", choices=PARTS, default=PARTS)
    add_effort(parser, "quick")
    options = parser.parse_args(arguments)
    count = 3000 if options.short else 45_000
    effort = 1.0 if options.short else options.effort
    model = material("lafortune-blue-paint").model
    samples, test = (sample_model(model, count, "discs", seed) for seed in (0, 1))
    print(f"lafortune-blue-paint, {count} pairs, 16², ε = {EPSILON:g}, effort {effort}; {machine()}")
    if "noise" in options.only:
        noise(samples, effort, 3 if options.short else 10)
    if "seeds" in options.only:
        seeds(samples, test, effort, 2 if options.short else 20)
    if "confidence" in options.only:
        confidence(samples, effort, 5 if options.short else 30)
    return 0


if __name__ == "__main__":
    sys.exit(main())
