"""An edited fit's export is not named as its original's: package, README and page title say that it is edited."""

import json
from pathlib import Path
from typing import Any

import pytest
from engine_cases import fit_no_looks, isotropic

import homofact
from homofact.api.exporting import AGAINST_UNEDITED
from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.containers.formats import format_named
from homofact.exporting.engines import gltf
from homofact.exporting.engines.table import ENGINES
from homofact.exporting.exported import exported
from homofact.factor.edited import edits_in_words
from homofact.shading.program import name_of

GOLD = {"source": {"material": "gold"}}
EDITS = [{"angle": "theta_h", "way": "texels", "rms": 0.0123}]
WORDS = "over θh, in the texels, relative RMS 1.23% against the exact edit of the fit"


@pytest.fixture(autouse=True)
def look(monkeypatch: pytest.MonkeyPatch) -> None:
    fit_no_looks(monkeypatch)
    monkeypatch.setattr(
        gltf, "fit_metallic_roughness", lambda *args, **kwargs: MetallicRoughness((0.5, 0.4, 0.3), 0.0, 0.5)
    )


def texts(engine: str, provenance: dict[str, Any]) -> dict[str, str]:
    fit = isotropic()
    fit.provenance.update(provenance)
    added = ENGINES[engine].add(exported(fit, format_named(ENGINES[engine].formats[0])))
    return {name: text for name, text in added.files.items() if isinstance(text, str)}


@pytest.mark.parametrize(
    ("provenance", "name"),
    [
        (GOLD, "gold"),
        (GOLD | {"edited_name": "ball"}, "gold"),
        (GOLD | {"edits": EDITS}, "edited gold"),
        (GOLD | {"edits": EDITS, "edited_name": "ball"}, "edited gold (ball)"),
        (GOLD | {"edits": EDITS, "edited_name": "gold"}, "edited gold"),
        ({"source": {"material": "gold", "edited": [], "edited_name": "ball"}}, "edited gold (ball)"),
        ({"source": 3, "edits": "by hand"}, "edited samples"),
    ],
)
def test_the_name_tells_that_a_fit_is_edited(provenance: dict[str, Any], name: str) -> None:
    assert name_of(provenance) == name


def test_a_package_of_an_edited_fit_lies_beside_that_of_its_original() -> None:
    edited = texts("three", GOLD | {"edits": EDITS, "edited_name": "ball"})
    package = json.loads(edited["package.json"])["name"]
    assert package == "homofact-edited-gold-ball"
    assert json.loads(texts("three", GOLD)["package.json"])["name"] == "homofact-gold"
    assert "<title>edited gold (ball)</title>" in edited["index.html"]
    # However long the name is that npm's limit cuts.
    long = {"source": {"material": "gold" * 60}}
    assert (
        json.loads(texts("three", long | {"edits": EDITS})["package.json"])["name"]
        != json.loads(texts("three", long)["package.json"])["name"]
    )


@pytest.mark.parametrize("engine", ["three", "blender", "gltf", "godot", "materialx"])
def test_the_readme_names_the_edits_as_info_does(engine: str) -> None:
    edited, before = texts(engine, GOLD | {"edits": EDITS})["README.md"], texts(engine, GOLD)["README.md"]
    assert f"\n\nThe fit was edited: {WORDS}. The errors that it had before the edit come on top.\n\n" in edited
    assert "edited gold" in edited or "homofact-edited-gold" in edited
    assert "edited" not in before


def test_errors_on_samples_of_the_unedited_material_are_named_so(tmp_path: Path) -> None:
    cautions = []
    for name, more in (("before", {}), ("after", {"edits": EDITS})):
        fit = isotropic()
        fit.provenance.update(GOLD | more)
        cautions.append(homofact.export(fit, tmp_path / name, source="material:phong-30").caution)
    assert AGAINST_UNEDITED not in cautions[0]
    assert cautions[1] == AGAINST_UNEDITED


def test_edits_of_damaged_provenance_are_words_still() -> None:
    assert edits_in_words({"edits": [3, {"angle": "x", "way": "y", "rms": "z"}]}) == "edited; over x, y"
    assert edits_in_words({"source": {"edited": []}}) == "fitted to a material that was edited before"
