"""The page of the real measurements: words around the tables of `real_tables`."""

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
Read this page to see how near a few kilobytes come to real measurements, and how other representations compare. It fits
ten isotropic files of the RGL database (Dupuy and Jakob 2018), the red car paint of NVIDIA's MDL SDK, three paints of
Cornell University, and a retroreflective tape. [The field in one table](compression.md) is the same kind of comparison
on surrogates of 100 MERL materials.

The methods:

- **{BOUND}**, ½ (f(ωi, ωo) + f(ωo, ωi)), is no method: it is the measurement with nothing undone but its lack of
  reciprocity. No reciprocal fit has a smaller RMS; its other figures show what that lack alone costs.
- **ours**: `homofact factorize FILE --bytes N` with all other settings at their defaults, at four budgets.
- **{NBRDF}**: the networks of Sztrajman et al. 2021, as their authors trained them on the raw files.
- **{HYBRID}**: a GGX lobe with a small network, as De Oliveira et al. 2026 trained and published it. Its 6472
  bytes are 48 of the material and 6424 of the network, which all RGL materials share. The published shaders state the
  weights with three decimals.
- **NBRDF, trained here**, **NPF, fitted here** (Bagher et al. 2016), **GGX** with one and two lobes over a diffuse
  base, **McCool**'s projections, and **SVD**, a sum of products: fitted here to the same training samples as ours. SVD
  is the better one, at its bytes, of in-out and half-difference matrices, and is given the measurement's own values
  where it can be evaluated anywhere.

Bytes are those of float32 numbers: RGB texels, weights, parameters."""
READING = """\
- **Raw and straightened.** homofact undoes the tilt of the measured sample by default
  ([Straighten a measurement](straightening.md)). What others published was fitted to the raw files, so all methods are
  first compared on these. The second set of tables fits and judges the straightened measurements. Where homofact finds
  no tilt, the two are the same.
- **MALE**: mean |log(1 + f cosθi) − log(1 + f̂ cosθi)| over 20,000 pairs of directions, uniform on both hemispheres,
  both angles under 80°.
- **RMS**: relative RMS of f cosθi cosθo over both hemispheres. "Over floor" divides it by the RMS of the measurement's
  own reciprocal mean; no reciprocal fit is below 1.
- **albedo**: total reflected light of the fit over that of the measurement, of the worst channel and angle of
  incidence (0, 10 … 80°). **energy**: the same of all angles together, worst channel. **highlight**: light of the fit
  over that of the measurement where the measurement's brightest 1% is. The tables show how far the ratios are from 1:
  median (worst).
- **PSNR** in dB, **SSIM** and **FLIP** compare spheres of 128² pixels under three skies (studio, St Peter's, Grace) and
  under a small lamp, each at one exposure chosen from the measurement, sRGB.
- **operations** of one evaluation count an operator on a vector once; **scalar** counts its components; **fetches** are
  texture lookups. **fit, s** is one fit on one thread, beside other work; budgets that share a search count it each."""
SAMPLED = """\
The paints and the tape are scattered samples, and nothing says what lies between them. So there are no pictures and no
integrals here. Each cell has MALE and RMS (relative, of f cosθi cosθo) at samples that the fit has not seen, turned to
random azimuths. "Left-out samples" are 20% drawn at random; they have neighbours on their own ring of the goniometer.
"Left-out rings" are every third inner ring of θi, all left out at once; they show what a fit makes of angles that were
not measured. The tape has one channel and no rings of θi. There all but ours need a third of the bytes in the table,
while ours spends the same budget on one channel."""
LIMITS = """\
- Ten RGL files are not the field, and all ten are isotropic.
- Ours is judged against the file that it was fitted to, and so are the published networks. The pairs of MALE are drawn
  anew; they are not the samples of any fit.
- The measurements themselves err. What a raw file gets wrong about reciprocity counts against every reciprocal method:
  ours where it keeps reciprocity, NBRDF, NPF, McCool, GGX and in-out SVD.
- The car paint's table is extrapolated beyond about 67° of incidence and 81° of view, and its negative values are set
  to 0. homofact undoes no tilt there, since no angle makes it reciprocal.
- Pictures clip what is brighter than white. Under the lamp a sharp highlight is a few pixels of white, so a PSNR there
  says more of its skirt than of its peak."""


def page(rows: Sequence[Row]) -> list[str]:
    """The page, paragraph by paragraph."""
    table = Table(rows)
    names, car = groups(table)
    sampled = table.materials(PAINTS, TAPE)
    parts = [MADE, "# Real measurements", INTRODUCTION, "## How to read the tables", READING]
    parts.append(
        "Fits of 45,000 pairs by lobe (all samples where the file has samples) less 20% held out, seed 0. Made by"
        f" `python scripts/compression/real_measurements.py`; {machine()}."
    )
    if names:
        parts += [
            f"## RGL: medians of {len(names)} raw files",
            "![Error against bytes](pictures/real.png)",
            summary(table, names, RAW),
            looks(table, names, RAW),
            "## The same, straightened",
            summary(table, names, STRAIGHT),
            looks(table, names, STRAIGHT),
            "## MALE at equal bytes",
            "Raw fits against the raw measurement, all methods:",
            equal_bytes(table, names, RAW),
            "Ours as the straightened measurement has it; the others stay against the raw one, which they were fitted"
            " to:",
            equal_bytes(table, names, STRAIGHT),
            "## Worst albedo",
            "Straightened for ours; fit over measurement, with the angle of incidence and the channel:",
            albedo(table, names, STRAIGHT),
            "## What was asked, and what was found",
            "Ours by size. Straightened measurements where nothing else is said:",
            targets(table, names),
        ]
    if car:
        parts += ["## The car paint", summary(table, car, RAW), looks(table, car, RAW)]
    if sampled:
        parts += ["## Cornell's paints and the tape", SAMPLED, at_samples(table, sampled)]
    without = missing(table)
    if without:
        parts += ["## What has no figures", "\n".join(without)]
    return [*parts, "## Limits", LIMITS]
