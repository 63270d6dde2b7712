"""What a material of a scene may be, and the fits that stand for files of measurements."""

import json
from pathlib import Path

import pytest
import torch

import homofact
from homofact.brdf.formats.csv import write as write_csv
from homofact.brdf.source import open_source
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import BadInput
from homofact.factor.factorization import Factorization
from homofact.methods.search import Search
from homofact.scene import file_fits
from homofact.scene.file_fits import FileFits
from homofact.scene.materials import FIT, SOURCE, open_material

UP = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
SCENE = """
lighting = {named = "studio"}
[[object]]
mesh = "shape:sphere"
material = "paint.npz"
[[camera]]
eye = [0, 0.5, 4]
pixels = [16, 12]
"""


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    quick = Search(textures=1, size=6, effort=1.0)
    monkeypatch.setattr(file_fits, "METHOD", quick)
    monkeypatch.setattr(file_fits, "OF_SAMPLES", quick)


@pytest.fixture
def paint(tmp_path: Path) -> Path:
    """A file of samples."""
    file = tmp_path / "paint.npz"
    homofact.convert("material:lafortune-blue-paint", file, count=400)
    return file


@pytest.fixture
def no_fits(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Call it and no fit is made from then on."""

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("fitted again")

    monkeypatch.setattr(file_fits, "fit_and_measure", refused)
    return monkeypatch


@pytest.mark.slow
def test_a_saved_fit_is_known_by_what_it_holds_whatever_its_name(tmp_path: Path, no_fits: object) -> None:
    fit = homofact.fit("material:phong-10", homofact.McCool(size=4))
    fit.save(tmp_path / "paint.npz")
    found = open_material(str(tmp_path / "paint.npz"), FileFits())
    assert (found.kind, found.fit) == (FIT, None)
    assert torch.equal(found.reflectance.evaluate(UP, UP), fit.evaluate(UP, UP))


def test_a_named_material_is_asked_itself(no_fits: object) -> None:
    found = open_material("material:phong-10", FileFits())
    assert (found.kind, found.fit) == (SOURCE, None)
    assert torch.equal(
        found.reflectance.evaluate(UP, UP), open_source("material:phong-10", count=10).reflectance.evaluate(UP, UP)
    )


def test_a_list_of_samples_is_fitted_with_fewer_texels_than_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Asked(Exception):
        pass

    def fitted(source: object, method: Search, progress: object = None) -> None:
        raise Asked(method)

    def method_for(place: Path) -> Search:
        with pytest.raises(Asked) as found:
            FileFits().of(str(place))
        return found.value.args[0]

    monkeypatch.setattr(file_fits, "fit_and_measure", fitted)
    few = homofact.read("material:phong-10", count=300).samples
    write_csv(str(tmp_path / "list.csv"), few)
    homofact.convert("material:phong-10", tmp_path / "table.binary")
    monkeypatch.setattr(file_fits, "OF_SAMPLES", Search(textures=1, bytes=900, effort=1.0))
    assert method_for(tmp_path / "list.csv") == file_fits.OF_SAMPLES
    assert method_for(tmp_path / "table.binary") == file_fits.METHOD


@pytest.mark.slow
def test_a_fit_stands_for_a_file_and_is_kept(tmp_path: Path, paint: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []
    kept = tmp_path / "kept"
    fits = FileFits(kept, True, told.append)
    found = open_material(str(paint), fits)
    assert isinstance(found.reflectance, Factorization)
    assert found.fit is not None
    assert fits.made == {str(paint): found.fit}
    assert told
    # What is stated is of this fit: its errors, measured anew.
    source = open_source(str(paint))
    test = source.samples.split(HELD_OUT, 0)[1].rotated_at_random(0)
    transform = found.reflectance.transform
    off = transform.forward(found.reflectance.evaluate(test.wi, test.wo)) - transform.forward(test.values)
    assert found.fit.errors["held_out"] == pytest.approx(float(off.abs().mean()), rel=1e-6)
    assert found.fit.verdict is not None
    assert found.fit.verdict in found.fit.sentence(str(paint))
    assert [each.name for each in kept.iterdir()] == [found.fit.name]
    assert homofact.load(str(kept / found.fit.name)).channels == ("R", "G", "B")

    monkeypatch.setattr(file_fits, "fit_and_measure", None)
    again = FileFits(kept).of(str(paint))
    assert again.record() == found.fit.record()
    assert torch.equal(again.fit.evaluate(UP, UP), found.reflectance.evaluate(UP, UP))


@pytest.mark.slow
def test_a_file_that_has_changed_or_another_method_is_fitted_anew(
    tmp_path: Path, paint: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = FileFits(tmp_path / "kept", True).of(str(paint))
    paint.unlink()
    homofact.convert("material:phong-30", paint, count=400)
    second = FileFits(tmp_path / "kept", True).of(str(paint))
    own = Search(textures=1, size=5, effort=1.0)
    monkeypatch.setattr(file_fits, "METHOD", own)
    monkeypatch.setattr(file_fits, "OF_SAMPLES", own)
    third = FileFits(tmp_path / "kept", True).of(str(paint))
    assert len({each.name for each in (first, second, third)}) == 3
    assert third.fit.textures[0].size == (5, 5)


@pytest.mark.slow
def test_nothing_is_written_unless_asked_for(tmp_path: Path, paint: Path) -> None:
    FileFits(tmp_path / "kept").of(str(paint))
    FileFits().of(str(paint))
    assert sorted(tmp_path.iterdir()) == [paint]


@pytest.mark.slow
def test_a_fit_of_that_name_without_errors_is_refused(tmp_path: Path, paint: Path) -> None:
    fits = FileFits(tmp_path / "kept", True)
    place = tmp_path / "kept" / fits.of(str(paint)).name
    homofact.fit("material:phong-10", homofact.McCool(size=4)).save(place)
    with pytest.raises(BadInput) as caught:
        FileFits(tmp_path / "kept").of(str(paint))
    assert str(place) in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["relight", "edit"])
def test_a_scene_keeps_the_fit_of_its_file(
    tmp_path: Path, paint: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")
    more = "terms = 2\n" if command == "relight" else "bands = [32, 32]\n"
    settings = "[transport]\ncube = 8\nkept = 16\n" if command == "relight" else "[edit]\ntriangles = 40\n"
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.replace("[[camera]]", f"{more}[[camera]]") + settings)
    out = tmp_path / "out"
    found = getattr(homofact, command)(scene, to=out)
    fit = FileFits().of(str(paint))
    report = json.loads((out / f"{command}.json").read_text())
    if command == "relight":
        assert report["objects"][0]["fit"] == fit.record()
    else:
        assert list(report["report"]["fits"].values()) == [fit.record()]
    assert any("paint.npz" in note for note in found.notes)
    assert torch.equal(homofact.load(str(out / fit.name)).evaluate(UP, UP), fit.fit.evaluate(UP, UP))
    # Replaced, the folder has no other file; opened, it needs no fit.
    getattr(homofact, command)(scene, to=out, force=True)
    assert [each.name for each in out.glob("fit_*")] == [fit.name]
    if command == "edit":
        monkeypatch.setattr(file_fits, "fit_and_measure", None)
        assert homofact.edit(out).fits[0].name == fit.name
