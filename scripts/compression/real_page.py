"""Write the page of the real measurements: the text around the tables of `real_tables`."""

import sys
from collections.abc import Sequence
from pathlib import Path

from homofact.evaluation.machine import machine

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.real_fits import BOUND, HYBRID, NBRDF, PAINTS, RAW, STRAIGHT, TAPE
from scripts.compression.real_tables import (
    Row,
    Table,
    albedo,
    at_samples,
    equal_bytes,
    groups,
    looks,
    missing,
    summary,
    targets,
)

MADE = "<!-- Made by `python scripts/compression/real_measurements.py`: change the words there, not here. -->"
INTRODUCTION = f"""\
Read this page to see how well a few kilobytes represent real measurements, and how other representations compare. We
fitted ten isotropic files of the RGL database (Dupuy and Jakob 2018), the red car paint of NVIDIA's MDL SDK, three
paints of Cornell University, and a retroreflective tape. [Published compressions](compression.md) compares the same
methods on proxies of 100 MERL materials. To compare methods on your own file, run

    homofact compare SOURCE --methods mccool,search,ggx,npf --plot out/methods.png

The methods are:

- **ours**: `homofact factorize FILE --bytes N` with all other settings at their defaults, at four budgets.
- **{NBRDF}**: the networks of Sztrajman et al. 2021, as their authors trained them on the raw files.
- **{HYBRID}**: a GGX lobe with a small network, as De Oliveira et al. 2026 trained and published it. Its 6472 bytes are
  48 of the material and 6424 of the network, which all RGL materials share. We took the weights from the published
  shaders, which round them to three decimals.
- **NBRDF, trained here**, **NPF, fitted here** (Bagher et al. 2016), **GGX** with one and two lobes over a diffuse
  base, **McCool**'s projections, and **SVD**, a sum of products. homofact fits them to the same training samples as
  ours, except for SVD: where the measurement can be evaluated anywhere, SVD uses the measurement's own values. SVD uses
  the better of two matrices for each size: in-out for 3 KiB, half-difference for 12 KiB.
- **{BOUND}**, ½ (f(ωi, ωo) + f(ωo, ωi)), is not a method but a lower bound on the RMS of reciprocal fits. It is the
  measurement itself, made reciprocal, without any other error. Only fits that are not reciprocal can have a smaller
  RMS. Its other figures show the error that reciprocity alone causes.

Bytes are those of float32 numbers: RGB texels, weights, parameters."""
READING = """\
- **Raw and straightened.** homofact undoes the tilt of the measured specimen by default ([Straighten a
measurement](straightening.md)). The published methods were fitted to the raw files, so the first two tables compare
all methods on the raw files. The next two tables leave out the published methods: we fitted the other methods to
the straightened measurements, and compared the fits with the straightened measurements. If homofact undoes no tilt,
the straightened measurement is the raw one.
- **MALE**: mean |log(1 + f cosθi) − log(1 + f̂ cosθi)| over 20,000 pairs of directions, uniform on both hemispheres,
  both angles under 80°.
- **RMS**: relative RMS of f cosθi cosθo over both hemispheres. "Over floor" is this error divided by the RMS of the
  measurement's own reciprocal mean. A reciprocal fit cannot have a value below 1. Ours can, because homofact drops
  reciprocity if the data are clearly fitted better without it.
- **albedo**: total reflected light of the fit over that of the measurement, for the worst channel and angle of
  incidence (0, 10 … 80°). **energy**: the same for all angles together, worst channel. **highlight**: light of the fit
  over that of the measurement, in the brightest 1% of the measurement. The cells give the distance of each ratio from 1
  in percent: the median over the materials, and in brackets the worst material.
- **PSNR** in dB, **SSIM** and **FLIP** compare spheres of 128² pixels under three skies (studio, St Peter's, Grace) and
  under a small lamp. Each sphere is shown in sRGB at one exposure, which is chosen from the measurement.
- **operations** is the number of arithmetic operators in one evaluation, where an operator on a vector counts once;
  **scalar** counts it once per component. **fetches** are texture lookups. **fit, s** is the time of one fit in
  seconds, on one thread of a machine that was also doing other work. If several budgets share one search, its time is
  included in each of them."""
CAR_PAINT_ALBEDO = """\
The largest error of the albedo is in green at normal incidence for GGX and for ours at 3.2 KiB. There the measured
green albedo is only 0.008, against 0.043 at 10°, and these fits follow the neighbouring angles."""
SAMPLED = """\
The files of the paints and the tape are lists of samples, so the values between the samples are unknown. The table
therefore has no picture errors and no albedo, energy or highlight. Each cell gives MALE and the relative RMS of f cosθi
cosθo at samples that the fit has not seen. Before this comparison, homofact rotates each pair of directions about the
normal by a random angle. Otherwise the comparison would favour fits that depend on the azimuth and are right only at
the measured azimuths. "Left-out samples" are a random 20%; they have neighbours on their own ring of the goniometer.
"Left-out rings" are every third inner ring of θi, all left out at once; they show how the fit behaves at unmeasured
angles. The tape has one channel and no rings of θi. For the tape, the other methods need only a third of the bytes in
the table, while ours uses the full budget for its one channel. Among cayman's left-out samples, one of 288 makes up 99%
of the squared values. The RMS of this column therefore shows how well a fit predicts this one sample: ours at 3.2 KiB
predicts it, ours at 12 KiB misses it (RMS 1)."""
LIMITS = """\
- Ten RGL files do not represent all materials, and all ten are isotropic.
- We compare our fits and the published networks with the file that each was fitted to. MALE uses new pairs of
  directions, which are not among the samples of any fit.
- The measurements have errors of their own. If a measurement error makes a raw file non-reciprocal, this error is
part of the figures of every reciprocal method: NBRDF, NPF, McCool, GGX, in-out SVD, and our fits if they are
reciprocal.
- The file of the car paint contains extrapolated values beyond about 67° of incidence and 81° of view, and homofact
  sets its negative values to 0. homofact undoes no tilt in this file, since no tilt angle makes it reciprocal.
- Pictures clip values brighter than white. Under the lamp, a sharp highlight covers only a few pixels, and these are
  clipped to white. The PSNR under the lamp therefore measures the flanks of the highlight more than its peak."""


def page(rows: Sequence[Row]) -> list[str]:
    """The page, paragraph by paragraph."""
    table = Table(rows)
    names, car = groups(table)
    sampled = table.materials(PAINTS, TAPE)
    parts = [MADE, "# Real measurements", INTRODUCTION, "## How to read the tables", READING]
    parts.append(
        "All methods that homofact fits use 45,000 pairs drawn around the highlight or, if the file is a list of"
        " samples, all its samples. 20% of them are held out, with seed 0. `python"
        " scripts/compression/real_measurements.py` makes this page. Machine:"
        f" {machine()}."
    )
    if names:
        parts += [
            f"## RGL: medians over {len(names)} raw files",
            "![Error against bytes](pictures/real.png)",
            summary(table, names, RAW),
            looks(table, names, RAW),
            "## RGL: the same files straightened",
            summary(table, names, STRAIGHT),
            looks(table, names, STRAIGHT),
            "## MALE of each material",
            "In this table, all methods are fitted to the raw measurement and compared with it. The last column is the"
            " ratio of ours at 3.2 KiB to the published NBRDF (2700 bytes):",
            equal_bytes(table, names, RAW),
            "In the next table, our fits and the reciprocal mean are made from the straightened measurement and"
            " compared with it. The other methods are still fitted to the raw measurement and compared with the raw"
            " measurement:",
            equal_bytes(table, names, STRAIGHT),
            "## Worst albedo",
            "Each cell gives the largest relative error of the fit's albedo, with its incidence angle and channel."
            " Ours is fitted to"
            " the straightened measurement, the published NBRDF to the raw one:",
            albedo(table, names, STRAIGHT),
            "## Targets and results",
            "The first column lists our targets, the others the results at each size. Results are for straightened"
            " measurements unless the row says otherwise:",
            targets(table, names),
        ]
    if car:
        parts += ["## The car paint", CAR_PAINT_ALBEDO, summary(table, car, RAW), looks(table, car, RAW)]
    if sampled:
        parts += ["## Cornell's paints and the tape", SAMPLED, at_samples(table, sampled)]
    without = missing(table)
    if without:
        parts += ["## Missing figures", "\n".join(without)]
    return [*parts, "## Limits", LIMITS]
