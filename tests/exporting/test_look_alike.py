"""How near a look-alike comes: the figures, the phrase that all use, and when it is warned of."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from engine_cases import LOOK, isotropic

import homofact
from homofact.brdf.analytic.common import AnalyticModel
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.evaluation.appearance import appearance
from homofact.exporting.as_source import as_source
from homofact.exporting.look_alike import Likeness, likeness


def case(albedo: float = 1.0, lamp: float = 50.0, sky: float = 50.0, highlight: float = 1.0) -> Likeness:
    """A likeness of these figures."""
    energy = SimpleNamespace(albedo_worst=albedo, highlight=highlight)
    made: Any = SimpleNamespace(energy=energy, psnr_light=lamp, psnr_sky=sky)
    return Likeness(made)


@pytest.mark.parametrize(
    ("found", "phrase"),
    [
        (case(1.416, 28.0, 31.4), "look-alike only: 31 dB under a sky, albedo up to 1.42 × fit"),
        (case(0.783, 28.0, 33.5), "look-alike only: 34 dB under a sky, albedo down to 0.78 × fit"),
        (case(1.0, sky=math.inf), "look-alike only: no difference under a sky, albedo up to 1.00 × fit"),
        (case(math.inf), "look-alike only: 50 dB under a sky, light where the fit reflects none"),
        (
            case(0.94, sky=39, highlight=0.37),
            "look-alike only: 39 dB under a sky, albedo down to 0.94 × fit, highlight 0.37 times",
        ),
    ],
)
def test_the_phrase(found: Likeness, phrase: str) -> None:
    assert found.phrase == phrase


@pytest.mark.parametrize(
    ("found", "poor"),
    [
        (case(), False),
        (case(1.2, 35.0, 34.6), False),
        (case(1.21), True),
        (case(1 / 1.19), False),
        (case(0.82), True),
        (case(sky=34.4), True),
        (case(lamp=34.4), True),
        (case(math.inf), True),
        (case(lamp=math.inf, sky=math.inf), False),
        (case(highlight=0.68), False),
        (case(highlight=0.66), True),
        (case(highlight=1.51), True),
    ],
)
def test_it_is_warned_of_what_a_picture_shows(found: Likeness, poor: bool) -> None:
    assert found.poor is poor
    assert bool(found.warning) is poor


def test_the_warning_says_what_shows_the_fit() -> None:
    found = case(1.416, 28.0, 31.4).warning
    assert found.startswith(
        "the look-alike differs visibly from the fit: 28 dB under a lamp, 31 dB under a sky, albedo up"
    )
    assert "`engine='three'` shows the fit itself" in found
    assert "`prefilter='SKY'`" in found
    given = case(1.416, 28.0, 31.4).warning_of(prefiltered=True)
    assert given.endswith("`engine='three'` shows the fit itself")


def test_it_is_measured_against_the_fit() -> None:
    fit = isotropic()
    found = likeness(LOOK, fit)
    expected = appearance(LOOK, as_source(fit, "the fit", 50))
    assert expected is not None
    assert found.appearance == expected
    record = found.record()
    assert record["albedo_worst"] == expected.energy.albedo_worst
    assert (record["psnr_light"], record["psnr_sky"]) == (expected.psnr_light, expected.psnr_sky)
    assert (record["said"], record["warning"]) == (found.phrase, found.warning)
    assert found.poor
    rows = found.table.splitlines()
    assert rows[0] == "| angle | red | green | blue |"
    assert len(rows) == 2 + 5 + 1
    first = " | ".join(f"{ratio:.2f}" for ratio in expected.energy.albedo_ratio[0])
    assert rows[2] == f"| 5° | {first} |"


class Dark(AnalyticModel):
    """A fit that reflects no blue."""

    def formula(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        """f of three channels, the last of them 0."""
        return torch.ones(len(wi), 1, dtype=wi.dtype) * self.colour((0.1, 0.1, 0.0), wi)


def test_a_channel_that_the_fit_does_not_reflect() -> None:
    dark = Dark()
    source = Source("dark", "drawn", sample_model(dark, 50, "cosine", 0, noise_free=False), dark, 1e-5, 0.0)
    found = appearance(LOOK, source)
    assert found is not None
    shown = Likeness(found)
    assert "light where the fit reflects none" in shown.phrase
    assert shown.poor
    assert shown.record()["albedo_worst"] is None
    assert shown.table.count("the fit reflects none") == 6


def test_a_look_alike_under_a_sky_alone_is_judged_by_skies() -> None:
    def godot(albedo: float, lamp: float, sky: float) -> Likeness:
        return replace(case(albedo, lamp, sky), under_sky_alone=True)

    # Lamps show the fit itself, so that how far the look-alike is off under one is no fault.
    assert not godot(1.0, 10.0, 50.0).poor
    assert godot(1.0, 50.0, 20.0).poor
    assert godot(1.5, 50.0, 50.0).poor
    words = godot(1.0, 50.0, 20.0).warning
    assert "20 dB under a sky" in words
    assert "prefilter='SKY'" in words
    assert "lamp" not in words


def test_an_export_for_godot_says_how_near_its_sky_comes(tmp_path: Path) -> None:
    fit = homofact.fit("material:car-paint-red", homofact.McCool(size=6))
    found = homofact.export(fit, tmp_path / "godot", engine="godot")
    assert found.likeness is not None
    assert found.likeness.under_sky_alone
    assert found.record()["likeness"]["psnr_sky"] < 60
