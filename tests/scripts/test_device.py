"""The comparison of a GPU with the CPU: the CPU against itself, and devices that torch does not have."""

from collections.abc import Callable
from types import ModuleType

import pytest
import torch

from homofact.errors import BadInput


@pytest.mark.slow
def test_the_cpu_gives_its_own_answers(script: Callable[[str], ModuleType], capsys: pytest.CaptureFixture[str]) -> None:
    assert script("speed.device").main(["--device", "cpu", "--short", "--only", "normal"]) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| normal equations")]
    assert row.split(" | ")[-1] == "0.0e+00 |"


def test_a_difference_is_a_share_of_the_largest_value(script: Callable[[str], ModuleType]) -> None:
    apart = script("speed.device").apart
    assert apart(torch.tensor([1.0, -4.0]), torch.tensor([1.5, -4.0])) == 0.125
    assert apart(1.0, 1.0 + 1e-12) == pytest.approx(1e-12, rel=1e-3)


def test_a_device_that_torch_does_not_have_is_refused(script: Callable[[str], ModuleType]) -> None:
    for name in ("nonsense", "mps" if torch.cuda.is_available() else "cuda"):
        with pytest.raises(BadInput) as caught:
            script("speed.device").main(["--device", name])
        assert name in str(caught.value.found)
