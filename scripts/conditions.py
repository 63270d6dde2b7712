"""What every script of figures shares: tables, where files are, what it is told on the command line."""

import argparse
import csv
import io
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from homofact.config import fit_options
from homofact.errors import BadInput
from homofact.files.atomic import write_text

ROOT = Path(__file__).resolve().parent.parent
CORNELL = ("garnet_red", "krylon_blue", "cayman")


def data_folder(given: Path | None) -> Path:
    """The folder of real measurements: `given`, or $HOMOFACT_DATA, or ../shared/data beside the project."""
    if given is not None:
        return given
    return Path(os.environ.get("HOMOFACT_DATA", ROOT.parent / "shared" / "data"))


def cornell_files(folder: Path) -> tuple[list[Path], list[str]]:
    """(the Cornell paints that are there, a message for each that is not)."""
    files = [folder / "cornell" / f"{name}.brdf" for name in CORNELL]
    missing = [
        f"skipped {file.stem}: no {file} (--data FOLDER or HOMOFACT_DATA names the real measurements)"
        for file in files
        if not file.is_file()
    ]
    return [file for file in files if file.is_file()], missing


def markdown(header: Sequence[str], rows: Iterable[Sequence[object]], text_columns: int = 1) -> str:
    """A Markdown table; the columns after the first `text_columns` are flush right."""
    rules = ["---" if column < text_columns else "---:" for column in range(len(header))]
    lines = [header, rules, *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def figure(value: float) -> str:
    """Three digits, without an exponent where that is readable."""
    return f"{value:.3g}" if value == 0 or 1e-4 <= abs(value) < 1e4 else f"{value:.2e}"


def spread(values: Sequence[float]) -> str:
    """Mean and sample standard deviation: "0.0681 ± 0.0012"; the mean alone of one value."""
    mean = sum(values) / len(values)
    if len(values) == 1:
        return figure(mean)
    deviation = (sum((value - mean) ** 2 for value in values) / (len(values) - 1)) ** 0.5
    return f"{figure(mean)} ± {deviation:.2g}"


def write(path: Path, text: str) -> None:
    """Write a file whole or not at all, its folder made where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Write a table as CSV, whole or not at all; its text."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    write(path, text.getvalue())
    return text.getvalue()


def effort_of(text: str) -> str | float:
    """An effort of `Search` as it is said on a command line: a level's name or a number of inner evaluations."""
    declared = fit_options()["effort"]["search"]
    return declared.checked(declared.from_text(text))


def add_effort(parser: argparse.ArgumentParser, usual: str = "normal") -> None:
    """Give a parser the option --effort."""
    words = "how much is searched: quick, normal, thorough, or a number of inner evaluations (%(default)s)"
    parser.add_argument("--effort", type=effort_of, default=usual, help=words)


def parser_of(description: str | None) -> argparse.ArgumentParser:
    """A parser with what every script takes: its first line as description, and --short."""
    parser = argparse.ArgumentParser(description=(description or "").split("\n")[0])
    parser.add_argument("--short", action="store_true", help="a smoke test of seconds; its figures mean nothing")
    return parser


def print_measured(
    parser: argparse.ArgumentParser, arguments: Sequence[str] | None, measured: Callable[[argparse.Namespace], str]
) -> int:
    """Print the text that `measured` makes of the arguments, and write it to --out, which every such program takes.

    Returns 0, or 2 with the message on stderr where something is missing or wrong (`BadInput`).
    """
    parser.add_argument("--out", type=Path, help="write the text too")
    chosen = parser.parse_args(arguments)
    try:
        text = measured(chosen)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    print(text)
    if chosen.out is not None:
        write(chosen.out, text)
    return 0
