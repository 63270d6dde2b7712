"""`homofact sweep --svbrdf`: the clusters of one material under shared projections, and every bad input."""

import json
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from homofact.brdf.formats import npz
from homofact.brdf.source import open_source
from homofact.cli.main import main
from homofact.containers.formats import FORMATS
from homofact.containers.png import read_png, write_png
from homofact.evaluation.metrics import measure
from homofact.evaluation.split import Split
from homofact.factor.layered import Layered
from homofact.methods.search import Search
from homofact.sweeps.sweep_file import read_sweep

ROOT = Path(__file__).parents[2]
MATERIALS = ("phong-10", "lafortune-clay")
SWEEP = """
sources = ["material:phong-10", "material:lafortune-clay"]
[source]
count = 500
[[method]]
method = "search"
effort = 3.0
size = 5
search_size = 4
projections = ["theta_h-theta_d", "isotropic-angles"]
[svbrdf]
labels = "labels.npy"
"""
ALONE = Search(textures=2, effort=3.0, size=5, search_size=4, projections=("theta_h-theta_d", "isotropic-angles"))


def written(folder: Path, text: str = SWEEP, labels: np.ndarray | None = None) -> Path:
    np.save(folder / "labels.npy", np.array([[0, 1, 1], [1, 0, 1]], np.uint16) if labels is None else labels)
    file = folder / "tiles.toml"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("tiles")
    assert main(["sweep", str(written(place)), "--svbrdf", "--out", str(place / "out"), "-q"]) == 0
    return place / "out"


def test_the_folder_holds_the_fit_its_arrays_and_the_labels(made: Path) -> None:
    layers = Layered.load(made / "svbrdf.npz").layers
    assert len(layers) == 2
    record, manifest = (json.loads((made / f"{name}.json").read_text()) for name in ("svbrdf", "manifest"))
    assert (read_png(made / "labels.png")[..., 0] == [[0, 1, 1], [1, 0, 1]]).all()
    for j, entry in enumerate(manifest["textures"]):
        stored = FORMATS["exr"].read(made / entry["file"])
        assert (entry["layers"], entry["rows"] * 2) == (2, stored.shape[0])
        tall = np.concatenate([layer.textures[j].texels for layer in layers])
        assert (stored == tall.astype(np.float32)).all()
    assert [entry["A"] for entry in manifest["layers"]] == [layer.transform.mean.tolist() for layer in layers]
    assert str(made.parent) not in (made / "manifest.json").read_text()
    assert [cluster["texels"] for cluster in record["clusters"]] == [2, 4]
    assert record["shared"]["bytes"] == sum(layer.nbytes for layer in layers)
    for cluster, entry in zip(record["clusters"], manifest["layers"], strict=True):
        assert cluster["noise"] == entry["sampling"]["measured"]
        assert cluster["noise"][3]["variance"] < cluster["noise"][3]["cosine"] / 2
    assert "homofact_density(const float wi[3], const float wo[3], int layer)" in (made / "brdf.c").read_text()
    assert {*manifest["code"]["files"], "texture_0.exr", "texture_1.exr"} < {each.name for each in made.iterdir()}


def test_the_figures_are_those_of_samples_that_no_fit_saw(made: Path) -> None:
    record = json.loads((made / "svbrdf.json").read_text())
    layers = Layered.load(made / "svbrdf.npz").layers
    for name, layer, cluster in zip(MATERIALS, layers, record["clusters"], strict=True):
        source = open_source(f"material:{name}", count=500)
        split = Split.saved_with(layer)
        assert split is not None
        assert split.matches(source)
        again = measure(layer, split.test_samples(source), layer.transform)
        assert cluster["shared"]["held_out"]["log_mse"] == pytest.approx(again.log_mse, rel=1e-9)
        own = replace(ALONE, epsilon=layer.transform.epsilon).fit(split.parts(source)[0]).factorization
        alone = measure(own, split.test_samples(source), own.transform)
        assert cluster["alone"]["held_out"]["log_mse"] == pytest.approx(alone.log_mse, rel=1e-9)
        assert cluster["alone"]["held_out"]["log_mse"] != cluster["shared"]["held_out"]["log_mse"]
    for side in ("shared", "alone"):
        own = [cluster[side]["held_out"]["log_mse"] for cluster in record["clusters"]]
        assert record[side]["log_mse"] == pytest.approx(sum(own) / 2)
    assert record["alone"]["bytes"] == record["shared"]["bytes"]


def test_the_embedded_example() -> None:
    asked = read_sweep(ROOT / "configs/svbrdf.toml")
    assert asked.svbrdf is not None
    assert np.unique(np.load(asked.svbrdf.labels)).tolist() == list(range(len(asked.sources)))


def float_labels(folder: Path) -> None:
    np.save(folder / "labels.npy", np.zeros((2, 2)))


def no_labels(folder: Path) -> None:
    (folder / "labels.npy").unlink()


def archive(folder: Path) -> None:
    with (folder / "labels.npy").open("wb") as file:
        np.savez(file, a=np.zeros(3))


def colours(folder: Path) -> None:
    write_png(folder / "labels.png", np.zeros((2, 2, 3), np.uint8))


def fewer_colours(folder: Path) -> None:
    samples = open_source(f"material:{MATERIALS[0]}", count=50).samples
    two = replace(samples, values=samples.values[:, :2], channels=("450nm", "650nm"))
    npz.write(folder / "a.npz", two, {"name": "a"}, dtype="float32")


def changed(text: str, other: str) -> str:
    assert text in SWEEP
    return SWEEP.replace(text, other)


def bomb(folder: Path) -> None:
    """A whole PNG of 30,000² texels: 10 KiB of nothing, written by its parts."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", 30_000, 30_000, 8, 0, 0, 0, 0)
    data = zlib.compress(bytes(1 << 20))
    parts = (chunk(b"IHDR", head), chunk(b"IDAT", data), chunk(b"IEND", b""))
    (folder / "labels.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))


PNG = changed("labels.npy", "labels.png")
BAD: dict[str, tuple[str, list[Any] | None, Callable[[Path], None] | None, str]] = {
    "a label beyond": (SWEEP, [[0, 1], [2, 1]], None, "found the label 2 in row 1, column 0, expected 0 to 1"),
    "a negative label": (SWEEP, [[0, 1], [1, -3]], None, "found the label -3 in row 1, column 1, expected 0 to 1"),
    "an empty cluster": (SWEEP, [[1, 1]], None, "labels.npy: found no texel of the label 0, expected each of the 2"),
    "labels that are floats": (SWEEP, None, float_labels, "found values of type float64, expected whole numbers"),
    "no label map": (SWEEP, None, no_labels, "labels.npy: no such file, expected a label map"),
    "an archive": (SWEEP, None, archive, "labels.npy: found the shape an archive, expected"),
    "a coloured PNG": (PNG, None, colours, "labels.png: found 3 channels, expected a label map"),
    "a PNG of 30,000²": (PNG, None, bomb, "labels.png: found 30000 x 30000 pixels, expected at most 268435456"),
    "no PNG": (PNG, None, None, "labels.png: no such file"),
    "three axes": (SWEEP, [[[0], [1]]], None, "found the shape (1, 2, 1), expected (rows, columns)"),
    "no section": (SWEEP[: SWEEP.index("[svbrdf]")], None, None, "found no section [svbrdf], expected one with labels"),
    "another key": (SWEEP + "layers = 3", None, None, "svbrdf.layers: unknown key"),
    "another format": (SWEEP + 'format = "tga"', None, None, "svbrdf.format: found 'tga', expected one of exr"),
    "two seeds": ("seeds = [0, 1]" + SWEEP, None, None, "svbrdf: found 2 fits of a source, expected one method"),
    "another method": (
        SWEEP[: SWEEP.index("[[method]]")] + '[[method]]\nmethod = "mccool"\n[svbrdf]\nlabels = "labels.npy"\n',
        None, None, "method[0].method: found 'mccool', expected search",
    ),
    "whole texels": (changed("size = 5", 'quantize = "png8"'), None, None, "method[0].quantize: found 'png8'"),
    "other colours": (
        changed("count = 500", 'channels = "spectral"').replace(
            '"material:phong-10", "material:lafortune-clay"', '"{root}/data_synthetic/synthetic_cornell.brdf", "a.npz"'
        ),
        None, fewer_colours, "a.npz: found the channels 2 (450nm, 650nm), expected the 31 of synthetic_cornell.brdf",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line_and_leaves_nothing(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, labels, spoil, expected = BAD[name]
    file = written(tmp_path, text.replace("{root}", str(ROOT)), None if labels is None else np.array(labels))
    if spoil is not None:
        spoil(tmp_path)
    assert main(["sweep", str(file), "--svbrdf", "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1
    assert expected in told[0]
    assert not (tmp_path / "out").exists()


def test_what_does_not_go_together_is_refused(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(made.parent / "tiles.toml")
    before = (made / "svbrdf.npz").read_bytes()
    for arguments, expected in (
        (["--svbrdf", "--out", str(made)], "found an existing spatially varying fit, expected a new folder"),
        (["--svbrdf", "--workers", "2", "--out", str(made)], "workers: found it beside svbrdf"),
        (["--out", str(made.parent / "other")], "found a section [svbrdf], expected --svbrdf beside it, or none"),
    ):
        assert main(["sweep", file, *arguments]) == 2
        assert expected in capsys.readouterr().err
    assert (made / "svbrdf.npz").read_bytes() == before
    assert not (made.parent / "other").exists()
