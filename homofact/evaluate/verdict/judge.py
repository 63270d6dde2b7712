"""Whether a fit is to be trusted, and why not: every fit ends with a verdict that its user sees.

The verdict needs the fit, what it was made from and the held-out samples, and where there is a source to be asked, the
fit's appearance beside it. What is measured is measured here and in `flux`; `of_fit` and `of_data` say what is off.
"""

import math
from dataclasses import replace

import torch
from torch import Tensor

from homofact.brdf.pair_density import over_discs, scheme_of
from homofact.brdf.samples import Samples
from homofact.brdf.scatter import local_scatter
from homofact.brdf.suspicion.suspects import suspicions
from homofact.errors import Report
from homofact.evaluate.appearance import Appearance
from homofact.evaluate.metrics import SixErrors, explained_variance
from homofact.evaluate.peak import texels_per_radian
from homofact.evaluate.verdict import flux
from homofact.evaluate.verdict.finding import ordered
from homofact.evaluate.verdict.of_data import oddities_of_the_data, suspected, unknowns
from homofact.evaluate.verdict.of_fit import faults_of_the_fit
from homofact.evaluate.verdict.verdict import Verdict
from homofact.factor.fitted import Fitted
from homofact.methods.fitting import Method

_MOST_SAMPLES = 40_000


def judge(
    fitted: Fitted,
    report: Report,
    settings: Method,
    train: Samples,
    test: Samples,
    errors: tuple[SixErrors, SixErrors],
    seen: Appearance | None = None,
) -> Verdict:
    """The verdict on a fit of `train`, whose `errors` on (what it was given, `test`) are known.

    `seen` is its appearance beside its source, None where that cannot be asked. `train` are the training samples as
    measured: azimuth copies agree with each other perfectly and would hide it.
    """
    transform, held_out = fitted.transform, errors[1].log_mse
    drawn = train.subset(_MOST_SAMPLES, settings.seed)
    values, light = fitted.evaluate(drawn.wi, drawn.wo).to(torch.float64), flux.flux_of(drawn)
    misses = (transform.forward(values) - transform.forward(drawn.values)).square().mean(1).sqrt()
    held, held_light = fitted.evaluate(test.wi, test.wo).to(torch.float64), flux.flux_of(test)
    expected, found = (transform.forward(each) for each in (test.values, held))
    zero = transform.forward(torch.zeros(1, len(train.channels), dtype=torch.float64))
    is_cut = (found <= zero + 1e-9) & (expected > zero + math.log(2))
    scatter = local_scatter(drawn, settings.seed)
    zeros, dark, black = flux.dark_light(drawn, light)
    albedos = flux.albedos(fitted, train.isotropic)
    step, step_where = flux.largest_step(albedos)
    ring, share, where = flux.worst_ring(drawn, light, values)
    asymmetry, unmeasured = flux.light_of(fitted, train)
    apart = None if seen is None else seen.explained
    off, off_where = _off(seen, drawn, light, values)
    width = None if seen is None else seen.energy.half_width
    verdict = Verdict(
        status=report.status,
        condition=report.details.get("condition"),
        determined=report.details.get("determined"),
        gap=held_out / max(errors[0].log_mse, 1e-300),
        explained=explained_variance(expected, found, over_discs(test)) if apart is None else apart,
        misplaced=flux.misplaced(held_light, test.values, held),
        off=off,
        off_where=off_where,
        highlight=flux.brightest(drawn, light, values) if seen is None else seen.energy.highlight,
        cut=flux.cut_light(held_light, test.values, is_cut),
        albedo=float(albedos.max()),
        step=step,
        step_where=step_where,
        source_albedo=None if seen is None else max(max(row) for row in seen.energy.source_albedo),
        reciprocity=asymmetry,
        data_reciprocity=flux.asymmetry_of_samples(drawn, light, settings.seed)
        if seen is None
        else seen.energy.asymmetry,
        floor=None if seen is None else seen.energy.floor,
        scatter=None if scatter is None else scatter.relative,
        noise=None if scatter is None else scatter.floor,
        outliers=flux.standing_out(drawn, light, values, misses),
        zeros=zeros,
        gamut=_cut_by_the_gamut(train),
        dark=dark,
        black=black,
        clipped=flux.clipped_light(train, flux.flux_of(train)),
        rounded=flux.rounded_light(train, flux.flux_of(train)),
        repeated=flux.differing_light(drawn, light),
        ring=ring,
        ring_where=where if share > flux.LEAST_OF_THE_LIGHT else "",
        unmeasured=unmeasured,
        unresolved=flux.between_samples(drawn, light) if seen is None else 0.0,
        rising=flux.rising(drawn, light) if seen is None and scheme_of(train) is None else 0.0,
        texels_across=None if width is None or not fitted.textures else width * texels_per_radian(fitted),
        findings=(),
    )
    found_of = [
        *faults_of_the_fit(verdict, settings),
        *oddities_of_the_data(verdict, transform.epsilon, held_out),
        *(suspected(suspicions(train, settings.seed), verdict.rounded) if scheme_of(train) is None else ()),
        *unknowns(verdict, train),
    ]
    return replace(verdict, findings=ordered(found_of))


def _cut_by_the_gamut(samples: Samples) -> float:
    """The share of samples that their reader cut at zero in a channel, since their colour lies outside sRGB."""
    clipped = (samples.provenance.get("colour") or {}).get("clipped", {})
    shares = (samples.values == 0).double().mean(0).tolist()
    cut = [share for name, share in zip(samples.channels, shares, strict=True) if clipped.get(name)]
    return max(cut, default=0.0)


def _off(seen: Appearance | None, samples: Samples, light: Tensor, values: Tensor) -> tuple[float | None, str]:
    """(light of the fit over that of the source or, where it cannot be asked, of the samples; where)."""
    if seen is not None:
        ratio, degrees, channel = seen.energy.worst_albedo
        return ratio, f"{samples.channels[channel]} at θi = {degrees:g}°"
    found = flux.worst_band(samples, light, values)
    return (None, "") if found is None else found
