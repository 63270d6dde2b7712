"""The picture of one material drawn by several engines."""

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest
import torch

from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, displayed


def test_panels_share_the_exposure_and_the_curve_of_the_source(script: Callable[[str], ModuleType]) -> None:
    """Engines deliver their rows from below: arrays with negative strides."""
    module, size = script("engines.engine_pictures"), 48
    source = np.full((size, size, 3), (0.2, 0.1, 0.05)) * np.linspace(0.5, 2, size)[:, None, None]
    spheres = [source, (3 * source)[::-1]]
    found = np.asarray(module.sheet([("paint", spheres)]))
    whole = torch.ones(size, size, dtype=torch.float64)
    exposure = automatic_exposure(SphereImage(torch.from_numpy(source.copy()), whole))
    for k, sphere in enumerate(spheres):
        left = module.MARGIN + k * (size + module.MARGIN)
        image = SphereImage(torch.from_numpy(sphere.copy()), whole)
        expected = displayed(image, exposure, curve=DEFAULT_CURVE).numpy() * 255
        for row in (12, 24, 36):
            shown = found[module.CAPTION + row, left + size // 2]
            # The silhouette has no say in `expected`, and a little in the exposure of the sheet.
            assert shown == pytest.approx(expected[row, size // 2], abs=6)
    assert found[module.CAPTION + 24, module.MARGIN + size // 2, 0] > 60
    assert len({tuple(found[0, 0]), tuple(found[-1, -1])}) == 1
