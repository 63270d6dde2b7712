"""Every method declares how it fits, loads no torch before it does, and says what it does about optional settings."""

import inspect
import subprocess
import sys
from dataclasses import dataclass, fields
from importlib import import_module
from typing import ClassVar

import pytest

from homofact.errors import BadInput
from homofact.methods.method import Method
from homofact.methods.table import ALL_METHODS


@pytest.mark.parametrize("method", ALL_METHODS.values(), ids=ALL_METHODS)
def test_the_function_that_a_method_names_fits_by_it(method: type[Method]) -> None:
    module, _, function = method.implementation.partition(":")
    parameters = inspect.signature(getattr(import_module(module), function)).parameters
    assert list(parameters) == ["samples", "settings", "progress"]


@pytest.mark.parametrize("method", ALL_METHODS.values(), ids=ALL_METHODS)
def test_a_method_answers_for_every_optional_setting(method: type[Method]) -> None:
    made = method()
    own = {field.name for field in fields(made)}
    lacking = {"copies": 1, "mirrored": False, "robust": False, "confidence": False, "quantize": "none", "bytes": None}
    lacking["spectral_tolerance"] = None
    for name, value in lacking.items():
        if name not in own:
            assert getattr(made, name) == value
    assert made.most_textures >= 0


def test_settings_are_made_without_torch() -> None:
    code = "import sys; from homofact.methods import table; [method() for method in table.ALL_METHODS.values()]"
    code += "; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_a_method_without_a_number_of_textures_cannot_be_made() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Unfinished(Method):
        name: ClassVar[str] = "unfinished"

    with pytest.raises(TypeError):
        Unfinished()  # type: ignore[abstract]


@pytest.mark.parametrize("method", ALL_METHODS.values(), ids=ALL_METHODS)
def test_every_method_checks_its_settings(method: type[Method]) -> None:
    with pytest.raises(BadInput, match="seed"):
        method(seed=-1)  # type: ignore[call-arg]
