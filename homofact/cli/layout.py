"""The layout of all tables: made for 80 columns, with unbroken figures, and names broken only if necessary."""

import re

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.table import Column, Table
from rich.text import Text

from homofact.cli.flags import with_options

# Names of up to so many characters stay whole.
LEAST_NAME = 24


# A piece of a name ends with one of these, or where a space begins.
_JOINTS = re.compile(r"(?<=[-_.+:/#,])|(?= )")


class WholeWords(Table):
    """A table that breaks no words as long as the terminal has room for the longest words.

    Rich distributes the room by the widths of the columns, so a name beside a long text would break inside a word. If
    there is no room for whole words, names break after punctuation, for example into "blue-" and "paint".
    """

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Render as rich does, with each column that may wrap as wide as its longest word or piece at least."""
        widths = self._with_room(options.max_width)
        kept = [list(column.cells) for column in self.columns]
        for column, width in zip(self.columns, widths, strict=True):
            if width is not None:
                column.width = width
                vars(column)["_cells"] = [_at_joints(cell, width) for cell in column.cells]
        try:
            yield from super().__rich_console__(console, options)
        finally:
            for column, cells in zip(self.columns, kept, strict=True):
                column.width, vars(column)["_cells"] = None, cells

    def _with_room(self, most: int) -> list[int | None]:
        """The width of each column; None where rich decides: all fits, or not even the pieces do."""
        whole = [_longest(column, "\n") for column in self.columns]
        # Two edges, a rule's place between columns, and one space after each but the last.
        room = most - 2 - 2 * (len(whole) - 1)
        if sum(whole) <= room:
            return [None] * len(whole)
        for separator in (" ", ""):
            least = [
                width if column.no_wrap else _longest(column, separator)
                for column, width in zip(self.columns, whole, strict=True)
            ]
            if sum(least) <= room:
                return [*_shared(least, whole, room)]
        return [None] * len(whole)


def _shared(least: list[int], whole: list[int], room: int) -> list[int]:
    """Widths between those of columns' words and of their texts, which fill the room."""
    found, left = list(least), room - sum(least)
    # The columns that lack least get theirs first: those with texts share the rest.
    lacking = sorted(range(len(whole)), key=lambda k: whole[k] - least[k])
    for place, k in enumerate(lacking):
        more = min(whole[k] - least[k], left // (len(lacking) - place))
        found[k], left = found[k] + more, left - more
    return found


def _longest(column: Column, separator: str) -> int:
    """Cells of the longest line ("\\n"), word (" ") or piece of a name ("") in the header and the cells of a column."""
    texts = [_plain(each) for each in (column.header, *column.cells)]
    if separator == "\n":
        pieces = [piece for text in texts for piece in text.split("\n")]
    else:
        words = [word for text in texts for word in text.split()]
        pieces = words if separator else [piece for word in words for piece in _JOINTS.split(word)]
    return max(map(cell_len, pieces), default=0)


def _plain(cell: RenderableType) -> str:
    return cell.plain if isinstance(cell, Text) else str(cell)


def _at_joints(cell: RenderableType, width: int) -> RenderableType:
    """Return a cell whose words that are wider than its column are broken at joints."""
    text = _plain(cell)
    if all(cell_len(word) <= width for word in text.split()):
        return cell
    lines, line = [], ""
    for piece in _JOINTS.split(text):
        if line and cell_len(line + piece) > width:
            lines, line = [*lines, line], piece.lstrip()
        else:
            line += piece
    broken = "\n".join([*lines, line])
    return Text(broken, cell.style) if isinstance(cell, Text) else broken


def plain_table(title: str | None = None) -> Table:
    """Return an empty table with a rule under its header, its title at the left."""
    return WholeWords(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))


def add_names(table: Table, header: str = "", longest: int = 0) -> None:
    """Add a column of names, which break if the terminal is too narrow.

    If `longest`, the length of the longest name, is given and at most `LEAST_NAME`, these names never break.
    """
    table.add_column(header, overflow="fold", no_wrap=0 < longest <= LEAST_NAME)


def add_figures(table: Table, *headers: str) -> None:
    """Add columns of figures, right-aligned and never broken."""
    for header in headers:
        table.add_column(header, justify="right", no_wrap=True)


def hanging(line: str, indent: int) -> Table:
    """Return a line with a hanging indent: it wraps below the text that follows the first `indent` characters.

    Settings that the library advises become command-line options, as in all printed lines.
    """
    line = with_options(line)
    grid = Table.grid()
    grid.add_column(no_wrap=True, width=indent)
    grid.add_column(overflow="fold")
    grid.add_row(Text(line[:indent].ljust(indent)), Text(line[indent:]))
    return grid
