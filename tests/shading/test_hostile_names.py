"""Generated code whose names are hostile is the code of harmless names, in other comments."""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from hostile import FORBIDDEN, NAMES
from shading_cases import CASES, SEPARABLE

from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted
from homofact.separable.separable import Separable
from homofact.shading.c_code import c_source
from homofact.shading.encoding import as_floats
from homofact.shading.languages import GLSL, HLSL, WGSL, shader
from homofact.shading.program import program_of

KINDS = {"a product": CASES["McCool, one channel"], "a sum": next(iter(SEPARABLE.values()))}


def renamed(fitted: Factorization | Separable, name: str) -> Fitted:
    channels = tuple(f"{name}{k}" if k else name for k in range(len(fitted.channels)))
    facts = {"source": {"material": name}, "homofact_version": name}
    if isinstance(fitted, Factorization):
        first = fitted.terms[0]
        terms = (replace(first, projection=replace(first.projection, name=name)), *fitted.terms[1:])
        return replace(fitted, terms=terms, channels=channels, provenance=facts)
    return replace(fitted, channels=channels, provenance=facts)


def texts(fitted: Fitted) -> dict[str, str]:
    plain = [as_floats(texture.texels) for texture in fitted.textures]
    program = program_of(fitted, plain)
    found = {language.suffix: shader(program, language) for language in (GLSL, HLSL, WGSL)}
    return found | {".c": c_source(program, [texture.stored for texture in plain])}


def code(text: str) -> str:
    """As a compiler sees it: continued lines joined, then without comments."""
    joined = re.sub(r"\\[ \t]*\r?\n", "", text)
    return re.sub(r"/\*.*?\*/|//[^\n]*", "", joined, flags=re.DOTALL)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_only_comments_differ(kind: str, name: str) -> None:
    plain, hostile = texts(KINDS[kind]), texts(renamed(KINDS[kind], name))
    for suffix, text in hostile.items():
        assert code(text) == code(plain[suffix]), suffix
        assert not set(text) & set(FORBIDDEN), suffix
        text.encode("utf-8")


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_a_compiler_finds_no_name_in_the_code(tmp_path: Path) -> None:
    for k, name in enumerate(NAMES):
        file = tmp_path / f"{k}.c"
        file.write_text(texts(renamed(KINDS["a product"], name))[".c"])
        flags = ["-std=c99", "-pedantic", "-Wall", "-Werror", "-fsyntax-only"]
        made = subprocess.run(["cc", *flags, file], capture_output=True, text=True)
        assert made.returncode == 0, made.stderr
