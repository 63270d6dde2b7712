"""Marks of pixels beyond the measurement: regions stay, a single pixel and the sphere's edge make none."""

from types import SimpleNamespace
from typing import Any

import pytest
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.figures import measured_range
from homofact.rendering.light import DEFAULT_LIGHT


def marks_of(known: torch.Tensor, whole: torch.Tensor, monkeypatch: pytest.MonkeyPatch) -> torch.Tensor:
    """What is hatched where the sphere has the light `whole` (N, N), and `known` of it from measured directions."""

    def rendered(part: Any, light: object, size: int) -> Any:
        return SimpleNamespace(radiance=(known if part == "known" else whole)[..., None])

    parts = iter(("known", "whole"))
    monkeypatch.setattr(measured_range, "interpolated_samples", lambda source: "samples")
    monkeypatch.setattr(measured_range, "_Part", lambda samples: next(parts))
    monkeypatch.setattr(measured_range.FilteredMaterial, "of", lambda part, fineness: part)
    monkeypatch.setattr(measured_range, "render_sphere", rendered)
    source: Reflectance = None  # pyright: ignore[reportAssignmentType]
    ((marked, hatched),) = measured_range.beyond_the_measurement(source, [DEFAULT_LIGHT], len(whole)) or []
    # Every pixel that shows more than was measured is counted, hatched or not.
    assert torch.equal(marked, (whole > 1e-8) & (known < 0.5 * whole))
    return hatched


def test_a_region_is_marked_and_a_single_pixel_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = torch.ones((12, 12))
    known = whole.clone()
    known[2, 2] = 0  # the mirror direction
    known[6:10, 5:9] = 0.4
    marks = marks_of(known, whole, monkeypatch)
    expected = torch.zeros((12, 12), dtype=torch.bool)
    expected[6:10, 5:9] = True
    assert torch.equal(marks, expected)


def test_a_thin_mark_is_left_out_beside_the_unlit_side_too(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = torch.ones((80, 80))
    whole[:, :20] = 0
    for width, marked in ((3, 0), (4, 4 * 80)):
        known = whole.clone()
        known[:, 20 : 20 + width] = 0
        assert int(marks_of(known, whole, monkeypatch).sum()) == marked


def test_thin_parts_are_hatched_near_a_wide_one_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = torch.ones((80, 80))
    known = whole.clone()
    known[8:20, 8:20] = 0
    known[12:15, 20:60] = 0
    known[60:63, 10:60] = 0
    marks = marks_of(known, whole, monkeypatch)
    # A wide part is whole, with four pixels of its tail.
    assert marks[8:20, 8:20].all()
    assert marks[12:15, 20:24].all()
    assert not marks[:, 25:].any()
    assert int(marks.sum()) < 1.05 * (144 + 12)


def test_light_that_is_left_by_rounding_is_no_light(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = torch.full((80, 80), 1e-9)
    whole[:, :40] = 1
    known = whole.clone()
    known[:, 20:] = 0
    assert int(marks_of(known, whole, monkeypatch).sum()) == 20 * 80
