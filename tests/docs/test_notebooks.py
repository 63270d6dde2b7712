"""The notebooks of the tutorials: their cells are the page's blocks, their outputs those that the page shows."""

import ast
import re
from pathlib import Path

import nbformat
import pytest

from sitemaker.notebooks import notebook_of
from sitemaker.runnable import blocks_of, commands_in

TUTORIALS = sorted(
    path for path in (Path(__file__).parents[2] / "docs" / "tutorials").glob("*.md") if path.stem != "index"
)
PAGE = """# Title

See [formats](../formats.md), [the web](https://example.org), and

![a picture](../pictures/a.png)

```toml
# run.toml
seed = 1
```

```sh
homofact info a \\
  --json  # all
homofact plan b
```

```text
printed
```

```toml
unnamed = 1
```

```python
print(1)
```

The end.
"""


def test_blocks_become_cells_in_their_order_with_their_output() -> None:
    made = nbformat.reads(notebook_of(PAGE), as_version=4)
    found = [(cell.cell_type, cell.source) for cell in made.cells]
    assert found[0] == ("markdown", "# Title\n\nSee formats, [the web](https://example.org), and\n\na picture")
    assert "pip install" in found[1][1]
    assert found[2:] == [
        ("code", "%%writefile run.toml\n# run.toml\nseed = 1"),
        ("code", "!homofact info a \\\n  --json  # all\n!homofact plan b"),
        ("markdown", "```toml\nunnamed = 1\n```"),
        ("code", "print(1)"),
        ("markdown", "The end."),
    ]
    assert [[output.text for output in cell.get("outputs", ())] for cell in made.cells[2:6]] == [
        [], ["printed\n"], [], [],
    ]  # fmt: skip
    assert notebook_of(PAGE) == notebook_of(PAGE)


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_is_a_notebook_of_all_that_it_runs(path: Path) -> None:
    page = path.read_text(encoding="utf-8")
    made = nbformat.reads(notebook_of(page), as_version=4)
    nbformat.validate(made)
    code = [cell for cell in made.cells if cell.cell_type == "code"]
    blocks = blocks_of(page)
    assert len(code) == len(blocks) > 0
    for cell, block in zip(code, blocks, strict=True):
        if block.language == "python":
            ast.parse(cell.source)
            assert cell.source.strip() == block.text.strip()
        elif block.language == "sh":
            asked = [line for line in cell.source.splitlines() if line.startswith("!homofact ")]
            assert len(asked) == len(list(commands_in(block.text)))
        assert [output.text for output in cell.outputs] == ([page[slice(*block.shown)]] if block.shown else [])
    text = "\n".join(cell.source for cell in made.cells if cell.cell_type == "markdown")
    assert not re.search(r"\]\((?!https?:)", text)
