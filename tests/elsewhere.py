"""A device that is not the CPU, for machines that have none: tensors that say so and will not mix with others.

A tensor made by `moved` claims the device "meta", carries its values on the CPU, and refuses what a GPU's tensor
refuses: an operation together with a CPU tensor of one dimension or more, and `.numpy()`. Within `elsewhere()` tensors
that are constructed on that device are of this kind too. Indexing by a CPU tensor is allowed, as CUDA allows it.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_flatten, tree_map

DEVICE = torch.device("meta")
_INDEXING = ("aten.index.Tensor", "aten.index_put_.default", "aten.index_put.default", "aten._index_put_impl_.default")
_MOVING = ("aten._to_copy.default", "aten.copy_.default")


class _Elsewhere(torch.Tensor):
    """The wrapper; `held` are its values."""

    held: Tensor

    @staticmethod
    def __new__(cls, held: Tensor) -> "_Elsewhere":
        made = torch.Tensor._make_wrapper_subclass(
            cls,
            held.shape,
            strides=held.stride(),
            storage_offset=held.storage_offset(),
            dtype=held.dtype,
            device=DEVICE,
        )
        made.held = held
        return made

    def __repr__(self, *, tensor_contents: object = None) -> str:
        return f"elsewhere({self.held!r})"

    @classmethod
    def __torch_dispatch__(cls, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _run(func, args, kwargs or {})


def _run(func: Any, args: Any, kwargs: dict[str, Any]) -> Any:
    name = str(func)
    given = [each for each in tree_flatten((args, kwargs))[0] if isinstance(each, Tensor)]
    ours = [each for each in given if isinstance(each, _Elsewhere)]
    checked = [args[0]] if name in _INDEXING else given
    if ours and name not in _MOVING:
        stray = [each for each in checked if not isinstance(each, _Elsewhere) and each.dim() > 0]
        if stray:
            shapes = ", ".join(str(tuple(each.shape)) for each in stray)
            raise RuntimeError(f"{name}: a CPU tensor of shape {shapes} among tensors of another device")
    device = kwargs.get("device")
    here = device is not None and torch.device(device).type == "cpu"
    there = device is not None and torch.device(device).type == DEVICE.type
    inside = dict(kwargs, device=torch.device("cpu")) if device is not None else kwargs
    plain_args, plain_kwargs = tree_map(lambda x: x.held if isinstance(x, _Elsewhere) else x, (args, inside))
    result = func(*plain_args, **plain_kwargs)
    if here or not (ours or there) or (name == "aten.copy_.default" and not isinstance(args[0], _Elsewhere)):
        return result
    known = {id(each.held): each for each in ours}

    def wrapped(value: Any) -> Any:
        if not isinstance(value, Tensor):
            return value
        return known[id(value)] if id(value) in known else _Elsewhere(value)

    return tree_map(wrapped, result)


class _Mode(TorchDispatchMode):
    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _run(func, args, kwargs or {})


@contextmanager
def elsewhere() -> Iterator[None]:
    """While it lasts, constructors with `device=DEVICE` make tensors with values."""
    # A mode holds for one thread: other threads would make tensors of nothing.
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        with _Mode():
            yield
    finally:
        numba.set_num_threads(threads)


def moved(tensor: Tensor) -> Tensor:
    """The tensor on the device that is not the CPU."""
    return _Elsewhere(tensor.detach().clone())


def back(tensor: Tensor) -> Tensor:
    """Its values. Raises AssertionError for a tensor that stayed on the CPU."""
    assert isinstance(tensor, _Elsewhere), "a tensor of the CPU, expected one of the other device"
    return tensor.held
