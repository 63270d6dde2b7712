"""The page of Python with every function of the front: docs/python.md, which tests/test_docs.py runs from its top."""

import ast
import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest

import homofact
from homofact.errors import BadInput

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"
# Shown in docs/relighting.md and docs/editing.md.
OF_SCENES = {"apply_curves", "edit", "relight"}
FITTED = homofact.McCool(size=4)


def test_the_page_uses_every_function() -> None:
    blocks = re.findall(
        r"<!-- every front function -->\n```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL
    )
    tree = ast.parse("\n".join(blocks))
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "homofact"
    }
    functions = {name for name in homofact.__all__ if inspect.isfunction(getattr(homofact, name))}
    assert functions - used == OF_SCENES & functions


WRONG: dict[str, tuple[Callable[[Any], Any], str]] = {
    "a number as a fit": (lambda _: homofact.export(3, "engine"), "fit"),
    "a class as a fit": (lambda _: homofact.view(homofact.Fit, "a.html"), "fit"),
    "no source": (lambda _: homofact.info(None), "source"),
    "a class for a method": (lambda source: homofact.compare(source, cast(Any, [homofact.McCool])), "methods"),
    "two of one label": (lambda source: homofact.compare(source, [FITTED, FITTED]), "methods"),
    "no methods": (lambda source: homofact.compare(source, []), "methods"),
    "a method's class alone": (lambda source: homofact.factorize(source, "out", cast(Any, homofact.McCool)), "method"),
    "settings beside a method": (lambda source: homofact.factorize(source, "out", FITTED, size=3), "method"),
    "an unknown format": (lambda source: homofact.export(homofact.fit(source, FITTED), "out", format="jpg"), "format"),
    "an unknown ending": (lambda source: homofact.convert(source, "a.jpg"), "a.jpg"),
    "a share of all": (lambda source: homofact.terms(source, share=1.0), "share"),
    "no worker": (lambda _: homofact.sweep("sweep.toml", "swept", workers=0), "workers"),
    "a number for a sweep": (lambda _: homofact.sweep(3, "swept", workers=1), "sweep"),  # type: ignore[arg-type]
    "a page without a folder": (lambda _: homofact.relight("scene.toml", page=True), "page"),
    "an edit's page without a folder": (lambda _: homofact.edit("scene.toml", page=True), "page"),
    "too few pairs": (lambda _: homofact.plan("scene.toml", count=1), "count"),
    "an unknown finding": (lambda source: homofact.compare(source, [FITTED], refuse=["lihgt"]), "refuse"),
}


@pytest.mark.parametrize("case", WRONG)
def test_the_wrong_kind_is_named(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    call, where = WRONG[case]
    with pytest.raises(BadInput) as caught:
        call(homofact.read("material:phong-10", count=200))
    assert caught.value.where == where
    assert caught.value.found
    assert caught.value.expected
    assert list(tmp_path.iterdir()) == []
