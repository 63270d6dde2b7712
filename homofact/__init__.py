"""homofact: compress measured BRDFs into a few small textures.

    source = homofact.read("paint.brdf")
    fit = homofact.fit(source, textures=2)
    fit.evaluate(wi, wo)
    homofact.export(fit, "engine", format="ktx2")

Every command but `doctor` and `research stability` is a function here, and returns an object: docs/python.md. The names
are loaded when first used, so that `import homofact` stays quick; the methods do not load torch before they fit.
"""

from importlib import import_module
from pathlib import Path as _Path
from typing import TYPE_CHECKING as _TYPE_CHECKING

from homofact.files.compiled import give_place as _give_place
from homofact.version import __version__

if _TYPE_CHECKING:
    from homofact.api.charting import chart
    from homofact.api.comparing import compare
    from homofact.api.comparing_fits import compare_fits
    from homofact.api.converting import convert
    from homofact.api.describing import info
    from homofact.api.editing import apply_curves, edit
    from homofact.api.evaluating import evaluate
    from homofact.api.exporting import export
    from homofact.api.factorizing import factorize
    from homofact.api.fitting import fit
    from homofact.api.loading import load
    from homofact.api.measuring import measure
    from homofact.api.planning import plan
    from homofact.api.progress import ProgressStep
    from homofact.api.reading import read
    from homofact.api.relighting import relight
    from homofact.api.rendering import render
    from homofact.api.reporting import report
    from homofact.api.result import Fit
    from homofact.api.sweeping import sweep
    from homofact.api.terms import terms
    from homofact.api.viewing import view
    from homofact.brdf.samples import Samples
    from homofact.errors import BadInput
    from homofact.measuring.goniometer import Goniometer
    from homofact.methods.cole import Cole
    from homofact.methods.mccool import McCool
    from homofact.methods.models import Gaussians, Ggx, Nbrdf, Npf
    from homofact.methods.nmf import Nmf
    from homofact.methods.own import OwnMethod
    from homofact.methods.search import Search
    from homofact.methods.svd import Svd

# The module of each name, below `homofact`.
_HOMES = {
    "apply_curves": "api.editing",
    "chart": "api.charting",
    "compare": "api.comparing",
    "compare_fits": "api.comparing_fits",
    "convert": "api.converting",
    "edit": "api.editing",
    "evaluate": "api.evaluating",
    "export": "api.exporting",
    "factorize": "api.factorizing",
    "fit": "api.fitting",
    "info": "api.describing",
    "load": "api.loading",
    "measure": "api.measuring",
    "plan": "api.planning",
    "read": "api.reading",
    "relight": "api.relighting",
    "render": "api.rendering",
    "report": "api.reporting",
    "sweep": "api.sweeping",
    "terms": "api.terms",
    "view": "api.viewing",
    "BadInput": "errors",
    "Cole": "methods.cole",
    "Fit": "api.result",
    "Gaussians": "methods.models",
    "Ggx": "methods.models",
    "Goniometer": "measuring.goniometer",
    "McCool": "methods.mccool",
    "Nbrdf": "methods.models",
    "Nmf": "methods.nmf",
    "Npf": "methods.models",
    "OwnMethod": "methods.own",
    "ProgressStep": "api.progress",
    "Samples": "brdf.samples",
    "Search": "methods.search",
    "Svd": "methods.svd",
}

__all__ = [
    "BadInput", "Cole", "Fit", "Gaussians", "Ggx", "Goniometer", "McCool", "Nbrdf", "Nmf", "Npf", "OwnMethod",
    "ProgressStep", "Samples", "Search", "Svd", "__version__", "apply_curves", "chart", "compare", "compare_fits",
    "convert", "edit", "evaluate", "export", "factorize", "fit", "info", "load", "measure", "plan", "read", "relight",
    "render", "report", "sweep", "terms", "view",
]  # fmt: skip


_give_place(_Path(__file__).parent)


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'homofact' has no attribute {name!r}")
    found = getattr(import_module(f"homofact.{_HOMES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return __all__
