"""Pictures that are quickly drawn, or not at all, for tests of what else a command or a fit does."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def small_spheres() -> Iterator[None]:
    """Within it compare.png beside a fit has spheres 32 pixels wide; without matplotlib there is none anyway."""
    try:
        from homofact.figures.compare_picture import compare_picture
    except ImportError:
        yield
        return
    assert compare_picture.__kwdefaults__ is not None
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(compare_picture.__kwdefaults__, "size", 32)
        yield


@contextmanager
def no_looks() -> Iterator[None]:
    """Within it fits are judged by light at few angles and small pictures, and without a search for artefacts."""
    from homofact.api import fitting
    from homofact.brdf.kept import Kept
    from homofact.evaluation import appearance, compare, energy
    from homofact.planning import material_fits

    with pytest.MonkeyPatch.context() as patch:
        for module in (fitting, compare, material_fits):
            patch.setattr(module, "look_for_artefacts", lambda fit, source: None)
        patch.setattr(energy, "_ISOTROPIC", (28, 14))
        patch.setattr(energy, "_ANISOTROPIC", (24, 40))
        patch.setattr(appearance, "PIXELS", 32)
        # What is kept of a source has another size outside.
        patch.setattr(appearance, "_KEPT", Kept(appearance._SourceAppearance))
        yield
