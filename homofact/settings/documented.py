"""List the settings of a class in its docstring, from the declarations of its fields."""

from dataclasses import fields
from typing import TypeVar

from homofact.settings.options import Option

_T = TypeVar("_T")


def documented(settings: type[_T]) -> type[_T]:
    """Add the section Parameters to the docstring of a dataclass of options, before its examples."""
    text, heading, examples = (settings.__doc__ or "").rstrip().partition("\n\n    Examples\n")
    lines = ["", "", "    Parameters", "    ----------"]
    for field in fields(settings):  # type: ignore[arg-type]
        option: Option = field.metadata["option"]
        kind = getattr(field.type, "__name__", field.type) if isinstance(field.type, type) else field.type
        lines.append(f"    {field.name} : {kind}, default {field.default!r}")
        choices = f" One of {', '.join(option.choices)}." if option.choices else ""
        none = f" None: {option.none}." if option.none else ""
        lines.append(f"        {option.help}.{choices}{none}")
    settings.__doc__ = f"{text}{chr(10).join(lines)}{heading}{examples}\n    "
    return settings
