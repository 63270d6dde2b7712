"""Notebooks of the tutorials: the blocks that run become cells with the output that the page shows.

A ```python block is a cell as it stands, lines of homofact in a ```sh block get the "!" that runs them in a shell, and
a named ```toml block is written by %%writefile. Everything else is text. Links to other pages of the documentation keep
their words alone, and pictures their captions, since neither lies beside a notebook that was downloaded.
"""

import re

import nbformat

from sitemaker.runnable import Block, blocks_of, toml_name

_LINK = re.compile(r"!?\[([^\]]*)\]\((?!https?:)[^)]*\)")
INSTALL = "To run the cells, install homofact: `pip install 'homofact[all]'`."


def notebook_of(page: str) -> str:
    """The notebook of a page, as JSON; the same page gives the same text."""
    cells, end = [], 0
    for block in blocks_of(page):
        _add_text(cells, page[end : block.begin])
        cell = nbformat.v4.new_code_cell(_source(block))
        if block.shown is not None:
            cell.outputs = [nbformat.v4.new_output("stream", name="stdout", text=page[slice(*block.shown)])]
        cells.append(cell)
        end = block.end
    _add_text(cells, page[end:])
    cells.insert(1, nbformat.v4.new_markdown_cell(INSTALL))
    for number, cell in enumerate(cells):
        cell.id = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    made = nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": kernel})
    nbformat.validate(made)
    return str(nbformat.writes(made)) + "\n"


def _add_text(cells: list[nbformat.NotebookNode], text: str) -> None:
    words = _LINK.sub(r"\1", text).strip("\n")
    if words:
        cells.append(nbformat.v4.new_markdown_cell(words))


def _source(block: Block) -> str:
    text = block.text.rstrip("\n")
    if block.language == "toml":
        return f"%%writefile {toml_name(block)}\n{text}"
    if block.language == "sh":
        return re.sub(r"^homofact ", "!homofact ", text, flags=re.MULTILINE)
    return text
