"""A result may name any file as its source: what that file holds stays where it is."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import homofact
from homofact.evaluation.reopening import NotReopened, reopen, settings_of
from homofact.web.page import write_view

SECRET = "theta_i,phi_i,theta_o,phi_o,R,G,B\n0.1,0,0.2,3,hunter2,1,1\n"


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fit") / "fit.npz"
    source = homofact.read("material:phong-10", count=300)
    homofact.fit(source, homofact.McCool(size=4, grid="plain")).save(str(path))
    return path


def edited(saved: Path, place: Path, change: Any) -> Path:
    with np.load(saved) as found:
        arrays: dict[str, Any] = {name: found[name] for name in found.files}
    header = json.loads(str(arrays["header"]))
    change(header["provenance"])
    arrays["header"] = np.array(json.dumps(header))
    np.savez(place / "fit.npz", **arrays)
    return place / "fit.npz"


def test_no_words_of_a_named_file_come_into_a_page(saved: Path, tmp_path: Path) -> None:
    (tmp_path / "others").mkdir()
    secret = tmp_path / "others" / "secret.csv"
    secret.write_text(SECRET)

    def name_it(facts: dict[str, Any]) -> None:
        facts["source"]["split"]["opening"] |= {"path": str(secret), "folder": ""}

    fitted = homofact.load(str(edited(saved, tmp_path, name_it)))
    with pytest.raises(NotReopened, match=r"its source, secret\.csv, cannot be read as what it was$"):
        reopen(fitted)
    write_view(fitted, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text("utf-8")
    assert "hunter2" not in page
    assert str(tmp_path) not in page


def test_a_fit_without_a_split_names_no_place(saved: Path, tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "secret.csv").write_text(SECRET)

    def name_it(facts: dict[str, Any]) -> None:
        del facts["source"]["split"]
        facts["source"] |= {"format": "csv", "file": "../secret.csv"}

    # A folder below, where the name alone finds nothing.
    fitted = homofact.load(str(edited(saved, tmp_path / "here", name_it)))
    with pytest.raises(NotReopened, match=r"secret\.csv, is neither in the working folder nor beside") as caught:
        reopen(fitted, None, (tmp_path / "here" / "below",))
    assert "hunter2" not in str(caught.value)


def test_sizes_and_counts_that_nobody_meant_ask_for_no_memory(saved: Path, tmp_path: Path) -> None:
    def grow(facts: dict[str, Any]) -> None:
        facts["settings"]["size"] = 400_000

    assert settings_of(homofact.load(str(edited(saved, tmp_path, grow)))).size == 4

    def count(facts: dict[str, Any]) -> None:
        facts["source"]["split"]["opening"]["count"] = 10**12

    with pytest.raises(NotReopened, match="count: found 1000000000000, expected a whole number from 1 to 10000000"):
        reopen(homofact.load(str(edited(saved, tmp_path, count))))


def test_a_pipe_among_the_textures_is_refused(tmp_path: Path) -> None:
    from homofact.containers.formats import format_named
    from homofact.errors import BadInput
    from homofact.exporting.exported import exported, write_exported
    from homofact.exporting.result import open_result

    source = homofact.read("material:phong-10", count=300)
    fitted = homofact.fit(source, homofact.McCool(size=4, grid="plain")).factorization
    write_exported(tmp_path / "out", exported(fitted, format_named("png8")), {})
    (tmp_path / "out" / "texture_0.png").unlink()
    os.mkfifo(tmp_path / "out" / "texture_0.png")
    with pytest.raises(BadInput, match=r"texture_0\.png: cannot be read \(a pipe or a device\)"):
        open_result(tmp_path / "out")
