"""Pictures of relit scenes have the exposure and tone curve of all pictures for people."""

import numpy as np
import pytest
import torch

from homofact.relighting.errors import _psnr
from homofact.relighting.picture import displayed_picture
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, tonemap


def shown(radiance: torch.Tensor, exposure: float) -> np.ndarray:
    """A picture without a background, as `render` draws it."""
    whole = SphereImage(radiance, torch.ones(radiance.shape[:2], dtype=torch.float64))
    return tonemap(whole, exposure, curve=DEFAULT_CURVE).pixels.numpy()


def drawn() -> tuple[torch.Tensor, torch.Tensor]:
    """Radiance (8, 12, 3) over ten stops, and a coverage (8, 12) of its left half."""
    made = torch.randn(8, 12, 3, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    coverage = torch.zeros(8, 12, dtype=torch.float64)
    coverage[:, :6] = 1
    return torch.exp(2 * made), coverage


def test_relit_pictures() -> None:
    """The exposure is that of the objects, whatever stands behind them."""
    light, coverage = drawn()
    light[:, 6:] *= 30
    found = displayed_picture(light.numpy(), coverage.numpy())
    assert np.array_equal(found, shown(light, automatic_exposure(SphereImage(light, coverage))))
    assert np.array_equal(displayed_picture(light.numpy(), coverage.numpy(), 0.3), shown(light, 0.3))


def test_the_psnr_of_pixels_is_of_these_pictures() -> None:
    light = drawn()[0].reshape(-1, 3)
    other = light * 1.1
    exposure = automatic_exposure(SphereImage(light[:, None], torch.ones(len(light), 1)))
    apart = (shown(other[:, None], exposure).astype(float) - shown(light[:, None], exposure)) / 255
    assert _psnr(other.numpy(), light.numpy()) == pytest.approx(-10 * np.log10((apart**2).mean()), abs=1e-6)
