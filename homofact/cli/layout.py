"""How every table of the commands looks: read in 80 columns, figures whole, names broken only where they must be."""

from rich import box
from rich.table import Table
from rich.text import Text

from homofact.cli.flags import with_options

# Names of up to so many characters stay whole.
LEAST_NAME = 24


def plain_table(title: str | None = None) -> Table:
    """Return an empty table with a rule under its header, its title at the left."""
    return Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))


def add_names(table: Table, header: str = "", longest: int = 0) -> None:
    """A column of names, broken where the terminal is too narrow.

    Where the longest is known to have at most `LEAST_NAME` characters they stay whole, and other words are broken.
    """
    table.add_column(header, overflow="fold", no_wrap=0 < longest <= LEAST_NAME)


def add_figures(table: Table, *headers: str) -> None:
    """Columns of figures, flush right and never broken."""
    for header in headers:
        table.add_column(header, justify="right", no_wrap=True)


def hanging(line: str, indent: int) -> Table:
    """Return a line that wraps under its text: what comes after the first `indent` characters.

    Settings that the library advises become options, as in every line of the screen.
    """
    line = with_options(line)
    grid = Table.grid()
    grid.add_column(no_wrap=True, width=indent)
    grid.add_column(overflow="fold")
    grid.add_row(Text(line[:indent].ljust(indent)), Text(line[indent:]))
    return grid
