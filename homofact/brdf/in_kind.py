"""Accept directions as tensors, arrays or lists of any leading shape, and return values of the same kind.

This module does not import torch: a caller that passes a tensor has already imported it.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from homofact.errors import BadInput

_Evaluate = TypeVar("_Evaluate", bound=Callable[..., Any])


def is_tensor(value: object) -> bool:
    """Return whether `value` is a tensor of torch."""
    torch = sys.modules.get("torch")
    return torch is not None and isinstance(value, torch.Tensor)


@dataclass(frozen=True)
class Pairs:
    """Pairs of directions (N, 3), both arrays or both tensors of one floating type; made by `Pairs.of`.

    `shape` is the leading shape that the caller's directions broadcast to, `kind` "tensor", "array" or "list",
    `dtype` that of the answer.
    """

    wi: Any
    wo: Any
    shape: tuple[int, ...]
    kind: str
    dtype: Any

    @classmethod
    def of(cls, wi: Any, wo: Any) -> "Pairs":
        """Return the pairs of directions (..., 3) that broadcast, each a tensor, an array or a nested list.

        If one of the two is a tensor, the other becomes a tensor of its type on its device. Integers are converted to
        float64; half precision is evaluated in float32. Raises BadInput for anything that is not such directions, and
        for tensors on two devices.
        """
        if is_tensor(wi) or is_tensor(wo):
            return cls._of_tensors(wi, wo)
        kind = "array" if isinstance(wi, np.ndarray) or isinstance(wo, np.ndarray) else "list"
        wi, wo = _array("wi", wi), _array("wo", wo)
        dtype = np.result_type(wi, wo)
        shape = _broadcast(wi, wo)
        inner = np.float32 if dtype.itemsize <= 4 else np.float64
        wi, wo = (np.broadcast_to(w, (*shape, 3)).reshape(-1, 3).astype(inner, copy=False) for w in (wi, wo))
        return cls(wi, wo, shape, kind, dtype)

    @classmethod
    def _of_tensors(cls, wi: Any, wo: Any) -> "Pairs":
        import torch

        lead = wi if is_tensor(wi) else wo
        given = []
        for name, w in (("wi", wi), ("wo", wo)):
            if not is_tensor(w):
                w = torch.from_numpy(np.array(_array(name, w))).to(lead)
            elif w.dtype is torch.bool or w.is_complex() or w.ndim == 0 or w.shape[-1] != 3:
                raise BadInput(
                    where=name, found=f"{w.dtype} of shape {tuple(w.shape)}", expected="real numbers of shape (..., 3)"
                )
            if w.device != lead.device:
                raise BadInput(where=name, found=f"a tensor on {w.device}", expected=f"{lead.device}, where wi is")
            given.append(w if w.is_floating_point() else w.to(torch.float64))
        dtype = torch.promote_types(given[0].dtype, given[1].dtype)
        shape = _broadcast(*given)
        inner = torch.float32 if dtype.itemsize < 4 else dtype
        wi, wo = (w.expand(*shape, 3).reshape(-1, 3).to(inner) for w in given)
        return cls(wi, wo, shape, "tensor", dtype)

    def tensors(self) -> tuple[Any, Any]:
        """Return both as tensors (N, 3)."""
        if self.kind == "tensor":
            return self.wi, self.wo
        import torch

        # A copy where the caller's array may not be written, or runs backwards.
        return tuple(torch.from_numpy(np.require(w, requirements=["C", "W", "O"])) for w in (self.wi, self.wo))  # type: ignore[return-value]

    def answer(self, values: Any) -> Any:
        """Return values (N, C), array or tensor, in the caller's shape, kind and type."""
        values = values.reshape(*self.shape, values.shape[-1])
        if self.kind == "tensor":
            return values.to(self.dtype)
        array = values.detach().numpy() if is_tensor(values) else values
        return array.tolist() if self.kind == "list" else array.astype(self.dtype, copy=False)


def answering_in_kind(evaluate: _Evaluate) -> _Evaluate:
    """Wrap `evaluate(self, wi, wo)` of tensors (N, 3) to accept what `Pairs.of` accepts and return the same kind."""

    @wraps(evaluate)
    def wrapped(self: Any, wi: Any, wo: Any) -> Any:
        if is_tensor(wi) and is_tensor(wo) and _is_plain(wi, wo):
            return evaluate(self, wi, wo)
        pairs = Pairs.of(wi, wo)
        return pairs.answer(evaluate(self, *pairs.tensors()))

    return wrapped  # type: ignore[return-value]


def _is_plain(wi: Any, wo: Any) -> bool:
    """Whether two tensors are (N, 3) of one full floating type, as the package's own code gives them."""
    return (
        wi.ndim == 2
        and wi.shape == wo.shape
        and wi.shape[1] == 3
        and wi.dtype == wo.dtype
        and wi.is_floating_point()
        and wi.dtype.itemsize >= 4
    )


def _array(name: str, directions: Any) -> np.ndarray:
    try:
        array = np.asarray(directions)
    except (TypeError, ValueError) as error:
        raise BadInput(where=name, found=f"no table of numbers ({error})", expected="(..., 3) directions") from error
    if array.dtype.kind not in "fiu" or array.ndim == 0 or array.shape[-1] != 3:
        raise BadInput(
            where=name, found=f"{array.dtype} of shape {array.shape}", expected="real numbers of shape (..., 3)"
        )
    return array if array.dtype.kind == "f" else array.astype(np.float64)


def _broadcast(wi: Any, wo: Any) -> tuple[int, ...]:
    try:
        return np.broadcast_shapes(tuple(wi.shape[:-1]), tuple(wo.shape[:-1]))
    except ValueError:
        found = f"{tuple(wi.shape)} and {tuple(wo.shape)}"
        raise BadInput(where="wi, wo", found=f"the shapes {found}", expected="shapes that broadcast") from None
