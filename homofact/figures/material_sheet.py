"""Draw a sheet of materials: one sphere per material under the fixed sky, with its name below."""

import os
from collections.abc import Sequence

from homofact.brdf.reflectance import Reflectance
from homofact.figures.page import PicturePage
from homofact.files.atomic import replace_file
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.fixed_lights import sky_map
from homofact.rendering.lobe_patches import DRAFT
from homofact.rendering.tonemap import DEFAULT_CURVE, automatic_exposure, tonemap

_SIZE, _GAP, _COLUMNS = 176, 14, 5


def material_sheet(path: str | os.PathLike[str], materials: Sequence[tuple[str, Reflectance]]) -> None:
    """Draw a PNG with a sphere of each (name, reflectance), one or three channels, each at its own exposure.

    Raises BadInput for materials that `FilteredMaterial` rejects and for a path that cannot be written.
    """
    columns = min(_COLUMNS, max(len(materials), 1))
    page = PicturePage(columns * (_SIZE + _GAP) + _GAP, _GAP)
    top, sky = _GAP, Surroundings.of(sky_map(), _SIZE, fineness=DRAFT)
    for row in range(0, len(materials), columns):
        bottom = top
        for column, (name, reflectance) in enumerate(materials[row : row + columns]):
            left = _GAP + column * (_SIZE + _GAP)
            image = FilteredMaterial.of(reflectance, fineness=DRAFT).under(sky)
            shown = tonemap(image, automatic_exposure(image), curve=DEFAULT_CURVE)
            below = page.picture(shown.pixels.numpy(), left, top)
            bottom = max(bottom, page.text(name, left, below + 4, _SIZE))
        top = bottom + _GAP
    replace_file(path, page.save)
