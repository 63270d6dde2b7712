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
Read this page to see how close a few kilobytes come to real measurements, and how other representations compare. It
fits ten isotropic files of the RGL database (Dupuy and Jakob 2018), the red car paint of NVIDIA's MDL SDK, three
paints of Cornell University, and a retroreflective tape. [Published compressions](compression.md) compares the same
methods on proxies of 100 MERL materials. To compare methods on your own file, run

    homofact compare SOURCE --methods mccool,search,ggx,npf --plot out/methods.png

The methods are:

- **ours**: `homofact factorize FILE --bytes N` with all other settings at their defaults, at four budgets.
- **{NBRDF}**: the networks of Sztrajman et al. 2021, as their authors trained them on the raw files.
- **{HYBRID}**: a GGX lobe with a small network, as De Oliveira et al. 2026 trained and published it. Its 6472 bytes
  are 48 of the material and 6424 of the network, which all RGL materials share. The published shaders give the
  weights with three decimals.
- **NBRDF, trained here**, **NPF, fitted here** (Bagher et al. 2016), **GGX** with one and two lobes over a diffuse
  base, **McCool**'s projections, and **SVD**, a sum of products. homofact fits them to the same training samples as
  ours. SVD is the better of the in-out and the half-difference matrix at its bytes. It gets the measurement's own
  values where the measurement can be evaluated anywhere.
- **{BOUND}**, ½ (f(ωi, ωo) + f(ωo, ωi)), is not a method but a bound. It is the measurement made reciprocal, with no
  other error. No reciprocal fit has a smaller RMS. Its other figures show what reciprocity alone costs.

Bytes are those of float32 numbers: RGB texels, weights, parameters."""
READING = """\
- **Raw and straightened.** homofact undoes the tilt of the measured sample by default ([Straighten a
  measurement](straightening.md)). Published methods were fitted to the raw files, so the first set of tables
  compares all methods on these. The second set fits and judges the straightened measurements. Where homofact finds
  no tilt, the two are the same.
- **MALE**: mean |log(1 + f cosθi) − log(1 + f̂ cosθi)| over 20,000 pairs of directions, uniform on both hemispheres,
  both angles under 80°.
- **RMS**: relative RMS of f cosθi cosθo over both hemispheres. "Over floor" divides it by the RMS of the
  measurement's own reciprocal mean; no reciprocal fit is below 1.
- **albedo**: total reflected light of the fit over that of the measurement, for the worst channel and angle of
  incidence (0, 10 … 80°). **energy**: the same for all angles together, worst channel. **highlight**: light of the
  fit over that of the measurement, in the measurement's brightest 1%. The tables show how far the ratios are from 1:
  median (worst).
- **PSNR** in dB, **SSIM** and **FLIP** compare spheres of 128² pixels under three skies (studio, St Peter's, Grace)
  and under a small lamp. Each sphere is shown in sRGB at one exposure, which is chosen from the measurement.
- **operations** counts the operators of one evaluation, an operator on a vector once; **scalar** counts each
  component. **fetches** are texture lookups. **fit, s** is one fit on one thread while other work ran; if budgets
  share a search, its time counts for each."""
SAMPLED = """\
The paints and the tape are scattered samples, and nothing is known between them. The table therefore has no pictures
and no integrals. Each cell shows MALE and relative RMS of f cosθi cosθo at samples that the fit has not seen, turned
to random azimuths. "Left-out samples" are a random 20%; they have neighbours on their own ring of the goniometer.
"Left-out rings" are every third inner ring of θi, all left out at once; they show how the fit behaves at unmeasured
angles. The tape has one channel and no rings of θi. There, all methods except ours need a third of the bytes in the
table, and ours spends the same budget on one channel."""
LIMITS = """\
- Ten RGL files do not represent all materials, and all ten are isotropic.
- Ours is judged against the file that it was fitted to, and so are the published networks. The pairs of MALE are
  new: no fit has them among its samples.
- The measurements have errors of their own. An error in a raw file's reciprocity counts against every reciprocal
  method: ours where it keeps reciprocity, NBRDF, NPF, McCool, GGX and in-out SVD.
- The car paint's table is extrapolated beyond about 67° of incidence and 81° of view, and its negative values are
  set to 0. homofact undoes no tilt there, since no angle makes it reciprocal.
- Pictures clip values brighter than white. Under the lamp a sharp highlight is a few white pixels, so the PSNR there
  measures its flanks more than its peak."""


def page(rows: Sequence[Row]) -> list[str]:
    """The page, paragraph by paragraph."""
    table = Table(rows)
    names, car = groups(table)
    sampled = table.materials(PAINTS, TAPE)
    parts = [MADE, "# Real measurements", INTRODUCTION, "## How to read the tables", READING]
    parts.append(
        "All methods are fitted to 45,000 pairs drawn around the lobe, or to all samples of a file that has samples,"
        " with 20% held out and seed 0. Made by `python scripts/compression/real_measurements.py`. Machine:"
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
            "## MALE at equal bytes",
            "All methods, fitted to the raw measurement and compared with it:",
            equal_bytes(table, names, RAW),
            "Ours, fitted to the straightened measurement and compared with it. The other methods are still compared"
            " with the raw measurement, to which they were fitted:",
            equal_bytes(table, names, STRAIGHT),
            "## Worst albedo",
            "How far the worst albedo of the fit is off, with the angle of incidence and the channel. Ours is fitted to"
            " the straightened measurement:",
            albedo(table, names, STRAIGHT),
            "## Targets and results",
            "Our targets, and the results of each size on straightened measurements unless the row names others:",
            targets(table, names),
        ]
    if car:
        parts += ["## The car paint", summary(table, car, RAW), looks(table, car, RAW)]
    if sampled:
        parts += ["## Cornell's paints and the tape", SAMPLED, at_samples(table, sampled)]
    without = missing(table)
    if without:
        parts += ["## Missing figures", "\n".join(without)]
    return [*parts, "## Limits", LIMITS]
