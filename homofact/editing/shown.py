"""Displayed pictures of a prepared scene: 8-bit sRGB of every view, all at the exposure of the curves at the start."""

import numpy as np
import torch

from homofact.editing.enlarged import enlarged
from homofact.editing.picture import Curves, radiance, starting_curves
from homofact.editing.scene import PreparedScene
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, tonemap

_WIDTH, _MOST_TIMES = 640, 8


def shown_pictures(prepared: PreparedScene, curves: Curves | None = None) -> list[np.ndarray]:
    """8-bit sRGB (H, W, 3) of every view with these curves. Default: as they start.

    The tone curve is filmic. The exposure is the automatic one of the first view as the curves start, so that pictures
    of edits can be compared with it. Small views are enlarged to about 640 pixels across, at most eight times.
    """
    start = starting_curves(prepared)
    first = _image(prepared, 0, start)
    exposure = automatic_exposure(first)
    views = range(len(prepared.scene.cameras))
    found = [first if curves is None and view == 0 else _image(prepared, view, curves or start) for view in views]
    shown = [SphereImage(each.radiance, torch.ones_like(each.coverage)) for each in found]
    return [tonemap(each, exposure, curve=DEFAULT_CURVE).pixels.numpy() for each in shown]


def _image(prepared: PreparedScene, view: int, curves: Curves) -> SphereImage:
    """Return the RGB radiance and coverage of an enlarged view; one channel is shown as grey."""
    camera = prepared.scene.cameras[view]
    times = min(max(round(_WIDTH / camera.pixels[0]), 1), _MOST_TIMES)
    found = enlarged(prepared, view, radiance(prepared, view, curves), times)
    values = found.radiance
    rgb = values.expand(*values.shape[:2], 3) if values.shape[2] == 1 else values[..., :3]
    return SphereImage(rgb, found.coverage)
