"""What is noted of a prepared scene whose low rank errs by more than its tolerance."""

import pytest

from homofact.api.editing import _above_tolerance
from homofact.editing.errors import PartError


def part(error: float, bounced: bool = False, material: str = "paint") -> PartError:
    return PartError("front", material, "diffuse", 900, (64,), 12, error, bounced)


@pytest.mark.parametrize("parts", [(), (part(0.002), part(0.003)), (part(0.002), part(0.2, bounced=True))])
def test_within_the_tolerance_nothing_is_noted(parts: tuple[PartError, ...]) -> None:
    assert _above_tolerance(parts, 0.003) == []


def test_the_worst_of_the_parts_above_it_is_named() -> None:
    parts = (part(0.001), part(0.004), part(0.02, material="glaze"), part(0.5, bounced=True))
    (line,) = _above_tolerance(parts, 0.003)
    assert "2 parts" in line
    assert "0.30%" in line
    assert "2.00% (glaze, diffuse" in line
    assert "12 numbers per pixel" in line
