"""The tables and the picture of spectral fits in their short forms: their figures hang together."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from homofact.brdf.cielab import ciede2000
from homofact.brdf.colour_difference import lab_of

BANDS = tuple(float(w) for w in range(400, 701, 10))


def rows(text: str, title: str) -> list[list[str]]:
    """The cells of the table behind a line that begins so, without its header."""
    lines = text[text.index(title) :].splitlines()
    table = [line.strip("| ").split(" | ") for line in lines[2:]]
    return table[2 : next(k for k, cells in enumerate(table) if cells == [""])]


@pytest.mark.slow
def test_bytes_and_ranks_are_those_of_the_fits(
    script: Callable[[str], ModuleType], real_data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert script("accuracy.spectral_fits").main(["--short", "--data", str(real_data)]) == 0
    text = capsys.readouterr().out
    rgb, bands, basis = rows(text, "CIEDE2000 to the measurement")
    assert [row[1] for row in (rgb, bands, basis)] == ["RGB", "all bands", "basis"]
    assert (rgb[2], bands[2]) == ("3", "31")
    assert int(rgb[3]) * 31 == int(bands[3]) * 3
    rank = int(basis[2])
    assert int(basis[3]) == int(rgb[3]) * rank // 3 + 4 * 31 * (rank + 1)
    assert float(basis[4]) == pytest.approx(int(basis[3]) / int(rgb[3]), abs=0.005)
    left = rows(text, "CIEDE2000 of the basis")[0]
    assert left[1] == basis[2]
    by_colour, plain = rows(text, "The largest mean")
    means = [[float(value) for value in row[2:]] for row in (by_colour, plain)]
    assert means[0] == sorted(means[0], reverse=True)
    assert all(ours <= theirs + 0.1 for ours, theirs in zip(*means, strict=True))
    assert "smoke test" in text


def test_a_metamer_has_the_colour_under_daylight_alone(script: Callable[[str], ModuleType]) -> None:
    waves = np.array(BANDS)
    mean = 0.02 + 0.2 / (1 + np.exp(-(waves - 600) / 15))
    factor = script("pictures.metamerism").factor_of_metamer(mean, BANDS)
    for spectrum in (mean, np.full(len(BANDS), 0.3)):
        pair = [lab_of(each[None], BANDS, "D65") for each in (spectrum, spectrum * factor)]
        assert float(ciede2000(*pair)[0]) < 1e-3
    pair = [lab_of(each[None], BANDS, "F11") for each in (mean, mean * factor)]
    assert float(ciede2000(*pair)[0]) > 3


@pytest.mark.slow
def test_the_picture_is_written_and_its_metamer_matches(
    script: Callable[[str], ModuleType], real_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "metamerism.png"
    assert script("pictures.metamerism").main(["--short", "--data", str(real_data), "--out", str(picture)]) == 0
    found = [line.strip("| ").split(" | ") for line in capsys.readouterr().out.splitlines()][2:]
    daylight, _, tube = ([float(value) for value in row[1:]] for row in found)
    assert daylight[1] < 1 < 3 < tube[1]
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["accuracy.spectral_fits", "pictures.metamerism"])
def test_missing_paints_are_said(
    script: Callable[[str], ModuleType], name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert script(name).main(["--data", str(tmp_path)]) == 1
    assert "garnet_red" in capsys.readouterr().err
