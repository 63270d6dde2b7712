"""The tutorials run as they stand, from the top of the page to its end; those of many seconds with `-m slow`."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import homofact
from homofact.containers.exr import read_exr
from sitemaker.navigation import DOCS, ROOT
from sitemaker.runnable import Block, blocks_of, commands_in, run, with_output

Names = dict[str, Any]


def paint(names: Names) -> None:
    assert float(names["off"]) < 0.05
    shader = Path("out/engine/brdf.glsl").read_text(encoding="utf-8")
    assert "vec3 homofact_evaluate(vec3 wi, vec3 wo)" in shader
    assert "texture_0.png" in {path.name for path in Path("out/engine").iterdir()}


def own_data(names: Names) -> None:
    before, after = (homofact.read(name).samples for name in ("gonio.csv", "paint.csv"))
    assert np.allclose(after.values * after.wo[:, 2:], before.values)
    report = json.loads(Path("out/gonio/report.json").read_text(encoding="utf-8"))
    assert report["error"]["held_out"]["log_mse"] < 0.1 * report["mccool"]["error"]["held_out"]["log_mse"]


def trust(names: Names) -> None:
    mccool, search = names["rows"]
    assert search.held_out.log_mse < 0.1 * mccool.held_out.log_mse
    assert not mccool.verdict.trusted
    assert names["error"].low <= names["error"].mean <= names["error"].high


def plan(names: Names) -> None:
    chosen = {each["name"]: each for each in names["plan"]["materials"]}
    assert len(chosen) == 2
    assert Path("out/plan.png").stat().st_size > 10_000


def relight(names: Names) -> None:
    assert names["colours"].shape == names["knot"].mesh.positions.shape
    assert names["colours"].max() > 0.1


def edit(names: Names) -> None:
    assert 1.1 < float(names["after"].max() / names["before"].max()) <= 2
    assert float((names["after"] / names["before"].clamp_min(1e-9)).max()) <= 2 + 1e-6
    changed = []
    for number in (0, 1):
        kept = [read_exr(f"out/{folder}/texture_{number}.exr") for folder in ("paint", "edited")]
        changed += [not np.array_equal(kept[0][name], kept[1][name]) for name in kept[0]]
    assert any(changed)


def sweep(names: Names) -> None:
    assert len(list(Path("out/sweep/results").iterdir())) == 4
    assert Path("out/site/index.html").is_file()


def inverse_rendering(names: Names) -> None:
    assert float(names["loss"].detach().sqrt()) < 1e-4
    assert np.median(abs(names["off"])) < 1e-2
    assert homofact.load("found.npz").provenance["trained"] is True


# Above about four seconds of a processor: scripts/pictures/tutorials.py.
SLOW = (paint, own_data, trust, plan, relight, edit, sweep)
LEFT: dict[str, Callable[[Names], None]] = {
    each.__name__: each for each in (paint, own_data, trust, plan, relight, edit, sweep, inverse_rendering)
}


def test_every_tutorial_runs_in_some_test() -> None:
    assert sorted(LEFT) == sorted(path.stem for path in (DOCS / "tutorials").glob("*.md") if path.stem != "index")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if each in SLOW else ()) for name, each in LEFT.items()]
)
def test_a_tutorial_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if name in ("relight", "edit"):
        pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")
    for folder in ("data_synthetic", "configs"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    monkeypatch.chdir(tmp_path)
    page = DOCS / "tutorials" / f"{name}.md"
    names, _ = run(page, blocks_of(page.read_text(encoding="utf-8")))
    LEFT[name](names)


def test_every_command_that_a_tutorial_shows_is_one() -> None:
    """The indented ones too, which are too slow to run here."""
    from typer.main import get_command

    from homofact.cli.main import app

    commands = get_command(app).commands  # type: ignore[attr-defined]
    for path in (DOCS / "tutorials").glob("*.md"):
        for name, rest in re.findall(
            r"^(?: {4})?homofact ([a-z]+)(.*)$", path.read_text(encoding="utf-8"), re.MULTILINE
        ):
            words = {word for each in commands[name].params for word in [*each.opts, *each.secondary_opts]}
            assert {word for word in rest.split() if word.startswith("--")} <= words, (path.name, name)


PAGE = """# T

```toml
# a.toml
x = 1
```

```toml
y = 2
```

```python
import pathlib
print(pathlib.Path("a.toml").read_text().splitlines()[1])
```

```text
old
```

```sh
homofact --version
```

    homofact not run
"""


def test_blocks_run_in_their_order_and_their_output_is_put_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = blocks_of(PAGE)
    assert [block.language for block in blocks] == ["toml", "python", "sh"]
    _, printed = run(Path("t.md"), blocks)
    assert printed[:2] == ["", "x = 1\n"]
    assert printed[2].startswith("homofact ")
    assert with_output(PAGE, blocks, printed) == PAGE.replace("old", "x = 1")
    assert blocks_of(PAGE, "python") == [blocks[1]]


def test_what_does_not_run_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(AssertionError, match=r"ended with 2: homofact: absent\.brdf"):
        run(Path("t.md"), [Block("sh", "homofact info absent.brdf", None)])
    with pytest.raises(AssertionError, match="expected a line of homofact's"):
        list(commands_in("rm -r x"))
    with pytest.raises(NameError):
        run(Path("t.md"), [Block("python", "absent", None)])
    assert list(commands_in("homofact view \\\n  a  # b\n\n")) == [["view", "a"]]
