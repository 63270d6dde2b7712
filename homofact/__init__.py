"""homofact: measured BRDFs as a few small textures.

    samples = homofact.read("paint.brdf")
    fitted = homofact.fit(samples, textures=2)
    fitted.evaluate(wi, wo)

The names here are loaded when first used, so that `import homofact` stays quick.
"""

from typing import TYPE_CHECKING, Any

from homofact.version import __version__

if TYPE_CHECKING:
    from homofact.api import fit, load, read

__all__ = ["__version__", "fit", "load", "read"]


def __getattr__(name: str) -> Any:
    if name in ("read", "fit", "load"):
        from homofact import api

        return getattr(api, name)
    raise AttributeError(f"module 'homofact' has no attribute {name!r}")
