"""Compute the figures of a fit and of its samples from which the verdict is made.

The inputs are the fit, its training samples and the held-out samples. If the source can be evaluated everywhere, the
fit's appearance is another input.
"""

import math
from dataclasses import replace

import torch
from torch import Tensor

from homofact.brdf.pair_density import over_discs, scheme_of
from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.quality.scatter import local_scatter
from homofact.brdf.samples import Samples
from homofact.errors import Report
from homofact.evaluation.appearance import Appearance
from homofact.evaluation.bar.reading import reading_of
from homofact.evaluation.metrics import SixErrors, explained_variance
from homofact.evaluation.peak import texels_per_radian
from homofact.evaluation.verdict import flux
from homofact.evaluation.verdict.figures import (
    CoverageFigures,
    DataFigures,
    Figures,
    HeldOutFigures,
    LightFigures,
    SystemFigures,
)
from homofact.factor.fitted import Fitted
from homofact.geometry.directions import to_spherical

_MOST_SAMPLES = 40_000
_LEFT_OUT = 1e-3


def measured_figures(
    fitted: Fitted,
    report: Report,
    train: Samples,
    test: Samples,
    errors: tuple[SixErrors, SixErrors],
    seed: int,
    seen: Appearance | None = None,
) -> Figures:
    """Return the figures of a fit of `train`, given its `errors` on training samples and on `test`.

    `seen` is the appearance of the fit compared with its source, None if the source cannot be evaluated everywhere.
    `train` are the training samples without azimuth copies, since copies agree perfectly and would hide scatter in the
    data.
    """
    drawn = train.subset(_MOST_SAMPLES, seed)
    values = fitted.evaluate(drawn.wi, drawn.wo).to(torch.float64)
    extrapolation = Extrapolation(train)
    light, unmeasured = _light(fitted, drawn, values, extrapolation, seed, seen)
    peak, peak_fit, peak_where = _peak(fitted, (train, test))
    light = replace(light, peak=peak, peak_fit=peak_fit, peak_where=peak_where)
    coverage = CoverageFigures(
        unmeasured,
        flux.between_samples(drawn, flux.flux_of(drawn)) if seen is None else 0.0,
        flux.rising(drawn, flux.flux_of(drawn)) if seen is None and scheme_of(train) is None else 0.0,
        *(_range(train) if seen is None else (0.0, 90.0)),
        len(train),
        *(flux.towards_the_mirror(drawn) if seen is None else (0.0, 1.0)),
    )
    return Figures(
        SystemFigures(report.details.get("condition"), report.details.get("determined")),
        _held_out(fitted, report, test, errors, seen),
        light,
        _data(fitted, train, drawn, values, seed),
        coverage,
        reading_of(fitted, train, extrapolation, seed) if seen is None else None,
    )


def _peak(fitted: Fitted, parts: tuple[Samples, ...]) -> tuple[float, float, str]:
    """(value of the brightest sample of all parts, the fit's there, its angles), means of the channels."""
    samples = max(parts, key=lambda part: float(part.values.mean(1).max()))
    brightest = samples.select(samples.values.mean(1).argmax()[None])
    (theta_i, phi_i), (theta_o, phi_o) = (to_spherical(w) for w in (brightest.wi, brightest.wo))
    apart = (phi_o - phi_i).rad2deg().remainder(360)
    angles = [float(each) for each in (theta_i.rad2deg(), theta_o.rad2deg(), torch.minimum(apart, 360 - apart))]
    where = "θi {:.0f}°, θo {:.0f}°, Δφ {:.0f}°".format(*angles)
    value = fitted.evaluate(brightest.wi, brightest.wo).to(torch.float64)
    return float(brightest.values.mean()), float(value.mean()), where


def _range(samples: Samples) -> tuple[float, float]:
    """(lowest, highest) of `CoverageFigures`."""
    theta = torch.cat([to_spherical(w)[0] for w in (samples.wi, samples.wo)]).rad2deg().sort().values
    out = int(_LEFT_OUT * len(theta))
    return float(theta[out]), float(theta[len(theta) - 1 - out])


def _held_out(
    fitted: Fitted, report: Report, test: Samples, errors: tuple[SixErrors, SixErrors], seen: Appearance | None
) -> HeldOutFigures:
    """How well the fit meets `test`; `errors` are of the training samples and of these, and equal if they are the same.

    A search has held samples out of its own trials. Where nothing else was held out, the gap is that of this error.
    """
    is_held_out = errors[0] != errors[1]
    other = errors[1].log_mse if is_held_out else max(report.details.get("validation_error", 0.0), errors[0].log_mse)
    transform = fitted.transform
    values, light = fitted.evaluate(test.wi, test.wo).to(torch.float64), flux.flux_of(test)
    expected, fit_logs = (transform.forward(both) for both in (test.values, values))
    zero = transform.forward(torch.zeros(1, len(test.channels), dtype=torch.float64))
    is_cut = (fit_logs <= zero + 1e-9) & (expected > zero + math.log(2))
    explained = None if seen is None else seen.explained
    return HeldOutFigures(
        gap=other / max(errors[0].log_mse, 1e-300),
        explained=explained_variance(expected, fit_logs, over_discs(test)) if explained is None else explained,
        misplaced=flux.misplaced(light, test.values, values),
        cut=flux.cut_light(light, test.values, is_cut),
        is_held_out=is_held_out,
    )


def _light(
    fitted: Fitted,
    drawn: Samples,
    values: Tensor,
    extrapolation: Extrapolation,
    seed: int,
    seen: Appearance | None,
) -> tuple[LightFigures, float]:
    """The light of the fit, and how much of it was not measured; `values` are the fit's at the samples `drawn`."""
    light = flux.flux_of(drawn)
    albedos = flux.albedos(fitted, drawn.isotropic)
    step, step_where = flux.largest_step(albedos)
    asymmetry, unmeasured = flux.light_of(fitted, drawn.isotropic, extrapolation)
    off, off_where = _off(seen, drawn, light, values)
    width = None if seen is None else seen.energy.half_width
    figures = LightFigures(
        off=off,
        off_where=off_where,
        highlight=flux.brightest(drawn, light, values) if seen is None else seen.energy.highlight,
        texels_across=None if width is None or not fitted.textures else width * texels_per_radian(fitted),
        albedo=float(albedos.max()),
        albedo_at=flux.ALBEDO_DEGREES[int(albedos.amax((1, 2)).argmax())],
        step=step,
        step_where=step_where,
        source_albedo=None if seen is None else max(max(row) for row in seen.energy.source_albedo),
        reciprocity=asymmetry,
        data_reciprocity=flux.asymmetry_of_samples(drawn, light, seed) if seen is None else seen.energy.asymmetry,
        floor=None if seen is None else seen.energy.floor_cosine,
        by_incidence=flux.by_incidence(drawn, light, values) if seen is None else (),
    )
    return figures, unmeasured


def _data(fitted: Fitted, train: Samples, drawn: Samples, values: Tensor, seed: int) -> DataFigures:
    """What the samples themselves show; `values` are the fit's at the samples `drawn` of `train`."""
    transform, light = fitted.transform, flux.flux_of(drawn)
    misses = (transform.forward(values) - transform.forward(drawn.values)).square().mean(1).sqrt()
    scatter = local_scatter(drawn, seed)
    zeros, dark, black = flux.dark_light(drawn, light)
    ring, share, ring_where = flux.worst_ring(drawn, light, values)
    return DataFigures(
        scatter=None if scatter is None else scatter.relative,
        noise=None if scatter is None else scatter.floor,
        outliers=flux.standing_out(drawn, light, values, misses),
        zeros=zeros,
        dark=dark,
        black=black,
        gamut=_cut_by_the_gamut(train),
        clipped=flux.clipped_light(train, flux.flux_of(train)),
        rounded=flux.rounded_light(train, flux.flux_of(train)),
        repeated=flux.differing_light(drawn, light),
        ring=ring,
        ring_where=ring_where if share > flux.LEAST_OF_THE_LIGHT else "",
    )


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
    worst = flux.worst_band(samples, light, values)
    return (None, "") if worst is None else worst
