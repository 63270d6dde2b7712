"""homofact: measured BRDFs as a few small textures.

    samples = homofact.read("paint.brdf")
    fitted = homofact.fit(samples, textures=2)
    fitted.evaluate(wi, wo)

    knot = homofact.transport("knot.ply", fitted, error=0.02)
    knot.relight("sky.hdr")
    knot.shade((0.6, 0.9, 3.6))

The names here are loaded when first used, so that `import homofact` stays quick; the methods do not load torch before
they fit.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.files.compiled import give_place
from homofact.version import __version__

if TYPE_CHECKING:
    from homofact.api import fit, load, read
    from homofact.methods.cole import Cole
    from homofact.methods.mccool import McCool
    from homofact.methods.models import Gaussians, Ggx, Nbrdf, Npf
    from homofact.methods.nmf import Nmf
    from homofact.methods.search import Search
    from homofact.methods.svd import Svd
    from homofact.scene.transport.front import transport

__all__ = [
    "Cole", "Gaussians", "Ggx", "McCool", "Nbrdf", "Nmf", "Npf", "Search", "Svd", "__version__", "fit", "load", "read",
    "transport",
]  # fmt: skip

_HOMES = {name: "homofact.api" for name in ("read", "fit", "load")} | {
    name: f"homofact.methods.{name.lower()}" for name in ("Search", "Cole", "McCool", "Svd", "Nmf")
}
_HOMES["transport"] = "homofact.scene.transport.front"
_HOMES |= {name: "homofact.methods.models" for name in ("Ggx", "Gaussians", "Npf", "Nbrdf")}


give_place(Path(__file__).parent)


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'homofact' has no attribute {name!r}")
