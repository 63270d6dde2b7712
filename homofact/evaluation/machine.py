"""Describe the machine of a time measurement in one line, which every published time needs."""

import os
import platform
from importlib.metadata import version
from pathlib import Path

from homofact.version import __version__

_LIBRARIES = ("torch", "numba", "numpy", "scipy")


def machine() -> str:
    """Return the processor, its cores, the requested threads, the system, and library versions.

    This function does not import the libraries, so it needs no extra memory.
    """
    processor = " ".join(part for part in (platform.machine(), _model_name()) if part)
    threads = [f"{name}={os.environ[name]}" for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS") if name in os.environ]
    system = f"{platform.system()}, Python {platform.python_version()}"
    libraries = [f"homofact {__version__}", *(f"{name} {version(name)}" for name in _LIBRARIES)]
    return ", ".join((processor, f"{os.cpu_count()} cores", *(threads or ["default threads"]), system, *libraries))


def _model_name() -> str:
    """The processor's name where the system tells it, which platform.processor often does not."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")
