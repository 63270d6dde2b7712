"""Compile functions with numba and cache them on disk between runs, with the decorator `kernel`.

If no cache folder is writable, functions are compiled in every run. A damaged cache file, for example of a killed run
or a full disk, is rebuilt. numba's own cache fails with a traceback in these cases.
"""

import contextlib
from collections.abc import Callable
from typing import Any

import numba
from numba.core.caching import FunctionCache


def kernel(**options: Any) -> Callable[[Callable], Any]:
    """Return the decorator `numba.njit` with these options and a disk cache of the compiled code."""

    def compiled(function: Callable) -> Any:
        made = numba.njit(**options)(function)
        # No place that can be written: numba refuses.
        with contextlib.suppress(RuntimeError):
            # As numba's own enable_caching does.
            setattr(made, "_cache", _Kept(function))  # noqa: B010 (numba declares no such attribute)
        return made

    return compiled


class _Kept(FunctionCache):
    """Numba's kept code, of which nothing is missed."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what is kept for a signature; None where that cannot be read, as where there is none."""
        # Damaged pickles end in errors of any kind.
        try:
            return super().load_overload(sig, target_context)
        except Exception:
            self._forget()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled, where that can be written."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)

    def _forget(self) -> None:
        with contextlib.suppress(OSError):
            self.flush()
