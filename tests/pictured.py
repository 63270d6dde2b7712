"""Pictures that are quickly drawn, for tests of what else a command does."""

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
