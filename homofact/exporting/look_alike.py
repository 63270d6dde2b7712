"""Measure how similar a look-alike is to the exported fit, and describe the result in words.

A look-alike is a material of a format's built-in model (`gltf_fit`) that replaces the fit. Its file, its README, the
terminal and the JSON report give the same figures: the results of `evaluation.appearance`, measured against the stored
fit.
"""

import math
from dataclasses import dataclass
from typing import Any

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.evaluation.appearance import Appearance, appearance
from homofact.exporting.as_source import as_source
from homofact.exporting.engines.base import Added
from homofact.factor.fitted import Fitted

# Worse than these is warned of: PSNR in dB, and by how much a directional albedo and the light of the brightest 1% of
# the directions are too large or too small.
LEAST_PSNR, MOST_ALBEDO, MOST_HIGHLIGHT = 35, 1.2, 1.5
_DRAWN = 100  # samples that a source needs and nobody here reads


@dataclass(frozen=True)
class Likeness:
    """The `appearance` of a look-alike against the fit.

    Attributes
    ----------
    appearance : Appearance
        All figures.
    under_sky_alone : bool
        Whether only a sky shows the look-alike, as in Godot, where lamps show the fit itself.
    """

    appearance: Appearance
    under_sky_alone: bool = False

    @property
    def albedo(self) -> float:
        """Directional albedo divided by the fit's, at the worst angle and channel; infinite if the fit's is 0."""
        return self.appearance.energy.albedo_worst

    @property
    def highlight(self) -> float:
        """Light of the highlight (brightest 1%) divided by the fit's."""
        return self.appearance.energy.highlight

    @property
    def phrase(self) -> str:
        """The likeness in a few plain words, as in the name of glTF's material."""
        of = "the engine's own sky lights a look-alike" if self.under_sky_alone else "look-alike only"
        highlight = f", highlight {_times(self.highlight)} times" if self._off_highlight else ""
        return f"{of}: {_picture(self.appearance.psnr_sky)} under a sky, {self._albedo_words}{highlight}"

    @property
    def poor(self) -> bool:
        """Whether the look-alike differs visibly from the fit (`LEAST_PSNR`, `MOST_ALBEDO`, `MOST_HIGHLIGHT`)."""
        seen = self.appearance
        least = seen.psnr_sky if self.under_sky_alone else min(seen.psnr_sky, seen.psnr_light)
        bounded = 1 / MOST_ALBEDO <= round(self.albedo, 2) <= MOST_ALBEDO
        return not bounded or self._off_highlight or (math.isfinite(least) and round(least) < LEAST_PSNR)

    @property
    def warning(self) -> str:
        """Warning with the differences and the exports that show the fit itself; empty unless `poor`."""
        return self.warning_of(prefiltered=False)

    def warning_of(self, prefiltered: bool) -> str:
        """Return `warning`, without the advice to prefilter a sky if the export already has a prefiltered sky."""
        if not self.poor:
            return ""
        sky = f"{_picture(self.appearance.psnr_sky)} under a sky"
        if self.under_sky_alone:
            shown = f"{self.phrase}, so it differs visibly from the fit"
            return f"{shown}; `prefilter='SKY'` shows the fit itself under that sky"
        shown = f"the look-alike differs visibly from the fit: {_picture(self.appearance.psnr_light)} under a lamp, "
        remedy = "`engine='three'` shows the fit itself"
        if not prefiltered:
            remedy += ", and `prefilter='SKY'` writes it for shaders of your own"
        highlight = f", highlight {_times(self.highlight)} times" if self._off_highlight else ""
        return f"{shown}{sky}, {self._albedo_words}{highlight}; {remedy}"

    @property
    def table(self) -> str:
        """Albedo divided by the fit's, by angle of the light and channel, as a Markdown table."""
        energy = self.appearance.energy
        channels = ("red", "green", "blue") if len(energy.energy) == 3 else ("albedo",)
        rows = [f"| angle | {' | '.join(channels)} |", "| ---: |" + " ---: |" * len(channels)]
        for degrees, ratios in zip(energy.degrees, energy.albedo_ratio, strict=True):
            rows.append(f"| {degrees:.0f}° | {' | '.join(map(_times, ratios))} |")
        rows.append(f"| mean | {' | '.join(map(_times, energy.energy))} |")
        return "\n".join(rows)

    @property
    def pictures(self) -> str:
        """PSNR under a lamp and under a sky."""
        lamp, sky = (_picture(psnr) for psnr in (self.appearance.psnr_light, self.appearance.psnr_sky))
        return f"{lamp} under a small lamp, {sky} under a sky"

    def record(self) -> dict[str, Any]:
        """A JSON-able dictionary."""
        names = ("albedo_worst", "highlight", "psnr_light", "psnr_sky")
        figures = {name: self.appearance.figures[name] for name in names}
        return figures | {"said": self.phrase, "warning": self.warning}

    @property
    def _off_highlight(self) -> bool:
        return not 1 / MOST_HIGHLIGHT <= round(self.highlight, 2) <= MOST_HIGHLIGHT

    @property
    def _albedo_words(self) -> str:
        if not math.isfinite(self.albedo):
            return "light where the fit reflects none"
        return f"albedo {'up' if self.albedo >= 1 else 'down'} to {self.albedo:.2f} × fit"


@dataclass(frozen=True)
class AddedLookAlike(Added):
    """The files that an engine adds to show a look-alike, and the look-alike's `likeness`."""

    likeness: Likeness | None = None


def likeness(look: MetallicRoughness, fitted: Fitted, under_sky_alone: bool = False) -> Likeness:
    """Measure a look-alike against the fit that is exported.

    Parameters
    ----------
    look : MetallicRoughness
        The look-alike.
    fitted : Fitted
        The fit as it is stored.
    under_sky_alone : bool, optional
        Whether only a sky shows the look-alike, and lamps show the fit itself.
    """
    found = appearance(look, as_source(fitted, "the fit", _DRAWN))
    assert found is not None, "a fit is known at all directions"
    return Likeness(found, under_sky_alone)


def _picture(psnr: float) -> str:
    return f"{psnr:.0f} dB" if math.isfinite(psnr) else "no difference"


def _times(ratio: float) -> str:
    return f"{ratio:.2f}" if math.isfinite(ratio) else "the fit reflects none"
