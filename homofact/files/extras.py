"""Optional libraries: the extra that installs each, and a common message if a library is missing.

OpenEXR = extras.library("OpenEXR", "EXR images")
"""

from collections.abc import Mapping
from importlib import import_module, util
from typing import Any

from homofact.errors import MissingDependency

# By the name that is imported: the package that has it, and the extra that brings it.
LIBRARIES = {
    "matplotlib": ("matplotlib", "pictures"),
    "PIL": ("pillow", "pictures"),
    "OpenEXR": ("OpenEXR", "containers"),
    "png": ("pypng", "containers"),
    "plyfile": ("plyfile", "containers"),
    "skimage": ("scikit-image", "metrics"),
    "flip_evaluator": ("flip-evaluator", "metrics"),
    "mitsuba": ("mitsuba", "mitsuba"),
    "drjit": ("mitsuba", "mitsuba"),
    "embreex": ("embreex", "relight"),
    "trimesh": ("trimesh", "relight"),
    "distributed": ("distributed", "cluster"),
    "pyarrow": ("pyarrow", "report"),
}


def library(module: str, purpose: str) -> Any:
    """Import and return a module.

    Raises MissingDependency, with a message that begins with `purpose`, if the module is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise _missing(module, purpose) from error


def check(purpose: str, *modules: str) -> None:
    """Raise MissingDependency as `library` for the first missing module; nothing is imported."""
    for module in modules:
        if not installed(module):
            raise _missing(module, purpose)


def installed(module: str) -> bool:
    """Return whether a library seems to be installed, without importing it."""
    return util.find_spec(module.partition(".")[0]) is not None


def lacking(error: ImportError) -> MissingDependency | None:
    """Return the error for a failed import of an optional library; None for any other failed import."""
    top = (error.name or "").partition(".")[0]
    return _missing(top, top) if top in LIBRARIES and not installed(top) else None


def told(module: str, purpose: str) -> str:
    """Return the message for a missing package: its purpose, its name, and how to install it."""
    return str(_missing(module, purpose))


def left_out(modules: Mapping[str, str]) -> str:
    """Return one line on the files that are not written because of missing libraries; "" if none is missing.

    left_out({"pictures": "matplotlib", "textures as EXR": "OpenEXR"})
    """
    missing = {what: module for what, module in modules.items() if not installed(module)}
    if not missing:
        return ""
    wanted = {LIBRARIES[module] for module in missing.values()}
    packages, needed = (sorted({each[k] for each in wanted}) for k in (0, 1))
    return (
        f"no {', no '.join(missing)}: {', '.join(packages)} not installed, expected:"
        f" pip install 'homofact[{','.join(needed)}]'"
    )


def _missing(module: str, purpose: str) -> MissingDependency:
    package, extra = LIBRARIES[module.partition(".")[0]]
    hint = f"pip install 'homofact[{extra}]'"
    return MissingDependency(f"{package} is not installed", where=purpose, expected="it", hint=hint)
