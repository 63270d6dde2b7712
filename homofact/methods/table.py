"""The methods by name, for the command line, configurations and saved fits: from labels and settings to objects.

This module loads neither torch nor numpy, so errors in settings are reported before these libraries load.
"""

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import fields, replace
from typing import Any

from homofact.errors import BadInput
from homofact.methods.cole import Cole
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.models import MODELS, Ggx
from homofact.methods.nmf import Nmf
from homofact.methods.search import Search
from homofact.methods.svd import Svd
from homofact.separable.decomposition_names import SIDES
from homofact.settings.options import nearest

MCCOOL = McCool().projections
METHODS: dict[str, type[Method]] = {method.name: method for method in (Search, Cole, McCool, Svd, Nmf)}
# They have no textures and are there to be compared.
MODELS_BY_NAME: dict[str, type[Method]] = {method.name: method for method in MODELS}
ALL_METHODS = METHODS | MODELS_BY_NAME
# Those whose fits become shaders: what `factorize` takes.
SHIPPED = METHODS | {Ggx.name: Ggx}
_RGB_TEXEL, _LEAST_SIZE = 12, 2


def method_class(name: str) -> type[Method]:
    """Return the class of the method called `name`. Raises BadInput that lists the names."""
    if name not in ALL_METHODS:
        expected = f"one of {', '.join(ALL_METHODS)}"
        raise BadInput(where="method", found=repr(name), expected=expected, hint=nearest(name, ALL_METHODS))
    return ALL_METHODS[name]


# Given bytes, these take the largest size within them.
_SIZED_BY_BYTES = (McCool.name, Cole.name, Svd.name, Nmf.name)


def settings_of_class(method: type[Method]) -> tuple[str, ...]:
    """Return the names of a method's settings."""
    return tuple(field.name for field in fields(method))


def methods_with(setting: str) -> tuple[str, ...]:
    """Return the names of the methods with a setting; for "bytes", also those that convert it to a size."""
    return tuple(
        name
        for name, method in ALL_METHODS.items()
        if setting in settings_of_class(method) or (setting == "bytes" and name in _SIZED_BY_BYTES)
    )


def parsed_label(label: str) -> tuple[str, dict[str, Any]]:
    """A label's method and the setting after its colon: `mccool:wi+h`, `ggx:2` lobes, `svd:half-diff` coordinates.

    Raises BadInput for an unknown method, and if the text after the colon is empty or does not suit the method.
    """
    name, colon, listed = label.partition(":")
    own = settings_of_class(method_class(name))
    projections = tuple(part.strip() for part in listed.split("+") if part.strip())
    if not colon:
        return name, {}
    if name == McCool.name and projections:
        return name, {"projections": projections}
    if "lobes" in own and listed.strip().isdecimal():
        return name, {"lobes": int(listed)}
    if "coordinates" in own and listed.strip() in SIDES:
        return name, {"coordinates": listed.strip()}
    raise BadInput(
        where="method",
        found=repr(label),
        expected="projections behind mccool only, as in mccool:wi+h, a number of lobes behind ggx or gaussians, as in"
        f" ggx:2, and coordinates behind {', '.join(methods_with('coordinates'))} ({' or '.join(SIDES)}), as in"
        " svd:half-diff",
    )


def made(label: str, settings: Mapping[str, Any]) -> Method:
    """Return the method of a label with these settings. Raises BadInput for a setting that it does not have."""
    name, _ = parsed_label(label)
    _refuse_strangers(settings, [name])
    return _built(label, settings)


def made_each(labels: Iterable[str], settings: Mapping[str, Any]) -> dict[str, Method]:
    """Return the methods of several labels, each with those of the settings that it has.

    If `bytes` are given, every method gets them as `with_bytes` says, so that methods are compared at equal bytes.
    Raises BadInput for a setting that none of them has, and for too few bytes.
    """
    names = {label: parsed_label(label)[0] for label in labels}
    _refuse_strangers(settings, list(names.values()))
    found = {label: _built(label, _own(name, settings)) for label, name in names.items()}
    count = settings.get("bytes")
    return found if count is None else {label: with_bytes(one, count) or one for label, one in found.items()}


def with_bytes(method: Method, count: int) -> Method | None:
    """Return the method with `count` bytes for its textures, or None for a method without such a limit.

    A search distributes the bytes itself. McCool's and Cole's methods and the decompositions get the largest texture
    size within the bytes. Raises BadInput for too few bytes.
    """
    if isinstance(method, Search):
        return replace(method, bytes=count)
    if method.name not in _SIZED_BY_BYTES:
        return None
    size = _size_within(count, method)
    if size < _LEAST_SIZE:
        wanted = f"enough for {method.stored_textures} textures of {_LEAST_SIZE} x {_LEAST_SIZE} texels"
        raise BadInput(where="bytes", found=count, expected=wanted)
    return replace(method, size=size)


def bytes_to_fill(method: Method) -> int | None:
    """Return the bytes that a method's textures may use: the given bytes, or those of their number and size.

    McCool's and Cole's methods choose the shape within their size that fits the source best, so their fits differ by
    some texels. A search keeps only the textures that lower the validation error. Returns None for any other method
    without bytes.
    """
    if isinstance(method, McCool | Cole) or (isinstance(method, Search) and method.bytes is None):
        return _RGB_TEXEL * method.most_textures * method.size**2
    return method.bytes


def _size_within(count: int, method: Method) -> int:
    """Return the largest texture size at which all textures of a method fit into `count` bytes."""
    return math.isqrt(count // (_RGB_TEXEL * method.stored_textures))


def mccool_like(method: Method) -> McCool:
    """Return McCool's own factorization with the settings that it shares with `method`, for comparison.

    If `method` has a limit of bytes, McCool's factorization gets the same limit, but at least textures of 2 x 2 texels.
    """
    shared: dict[str, Any] = {
        name: value for name, value in _own(McCool.name, vars(method)).items() if value is not None
    }
    shared["projections"] = MCCOOL
    baseline = McCool(**shared)
    if method.bytes is None:
        return baseline
    return replace(baseline, size=max(_size_within(method.bytes, baseline), _LEAST_SIZE))


def _built(label: str, settings: Mapping[str, Any]) -> Method:
    name, named = parsed_label(label)
    own = dict(settings) | named
    count = own.pop("bytes", None) if name in _SIZED_BY_BYTES else None
    method = ALL_METHODS[name](**own)
    return method if count is None else with_bytes(method, count) or method


def _own(name: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    known = settings_of_class(ALL_METHODS[name])
    return {setting: value for setting, value in settings.items() if setting in known}


def unused_settings(labels: Iterable[str], settings: Iterable[str]) -> dict[str, str]:
    """Return the settings that none of the methods of these labels has, each with a sentence about it.

    Examples
    --------
    >>> unused_settings(["mccool", "ggx"], ["size", "effort"])
    {'effort': 'effort has no effect: neither mccool nor ggx has such a setting; search has it'}
    """
    names = list(dict.fromkeys(parsed_label(label)[0] for label in labels))
    if len(names) == 1:
        none = f"{names[0]} has no such setting"
    elif len(names) == 2:
        none = f"neither {names[0]} nor {names[1]} has such a setting"
    else:
        none = f"none of {', '.join(names)} has such a setting"
    return {
        setting: f"{setting} has no effect: {none}{_others(methods_with(setting))}"
        for setting in _strangers(settings, names)
    }


def _strangers(settings: Iterable[str], names: Collection[str]) -> list[str]:
    """Return the settings that none of the methods `names` has."""
    return [setting for setting in settings if set(methods_with(setting)).isdisjoint(names)]


def _others(having: tuple[str, ...]) -> str:
    return f"; {_and(having)} {'has' if len(having) == 1 else 'have'} it" if having else ""


def _refuse_strangers(settings: Collection[str], names: list[str]) -> None:
    """Raise BadInput for the first setting that none of the methods `names` has, naming those that do."""
    names = list(dict.fromkeys(names))
    for setting in _strangers(settings, names):
        who = f"{names[0]} has no such setting" if len(names) == 1 else f"none of {', '.join(names)} has such a setting"
        own = ", ".join(dict.fromkeys(known for name in names for known in settings_of_class(ALL_METHODS[name])))
        of_own = "its own" if len(names) == 1 else "theirs"
        raise BadInput(who, where=setting, expected=f"one of {of_own} ({own}){_others(methods_with(setting))}")


def _and(names: tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
