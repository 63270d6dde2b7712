"""Marks of pixels beyond the measurement: regions stay, a single pixel and the sphere's edge make none."""

from types import SimpleNamespace
from typing import Any

import pytest
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.figures import measured_range
from homofact.rendering.light import DEFAULT_LIGHT


def marks_of(known: torch.Tensor, whole: torch.Tensor, monkeypatch: pytest.MonkeyPatch) -> torch.Tensor:
    """The marks where the sphere has the light `whole` (N, N), and `known` of it from measured directions."""

    def rendered(part: Any, light: object, size: int) -> Any:
        return SimpleNamespace(radiance=(known if part == "known" else whole)[..., None])

    parts = iter(("known", "whole"))
    monkeypatch.setattr(measured_range, "interpolated_samples", lambda source: "samples")
    monkeypatch.setattr(measured_range, "_Part", lambda samples: next(parts))
    monkeypatch.setattr(measured_range.FilteredMaterial, "of", lambda part, fineness: part)
    monkeypatch.setattr(measured_range, "render_sphere", rendered)
    source: Reflectance = None  # pyright: ignore[reportAssignmentType]
    (marks,) = measured_range.beyond_the_measurement(source, [DEFAULT_LIGHT], len(whole)) or []
    return marks


def test_a_region_is_marked_and_a_single_pixel_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = torch.ones((12, 12))
    known = whole.clone()
    known[2, 2] = 0  # the mirror direction
    known[6:10, 5:9] = 0.4
    marks = marks_of(known, whole, monkeypatch)
    expected = torch.zeros((12, 12), dtype=torch.bool)
    expected[6:10, 5:9] = True
    assert torch.equal(marks, expected)


def test_a_mark_that_ends_at_the_unlit_side_is_as_wide_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = torch.ones((12, 12))
    whole[:, :4] = 0
    known = whole.clone()
    known[:, 4] = 0
    marks = marks_of(known, whole, monkeypatch)
    # One pixel wide, but beside nothing that could show it.
    assert marks[:, 4].all()
    assert int(marks.sum()) == 12
