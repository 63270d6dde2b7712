"""Code that the scripts share: arguments, paths, tables, progress, resuming, and the end of a run."""

import argparse
import csv
import io
import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from homofact.config import fit_options
from homofact.errors import BadInput
from homofact.files.atomic import write_text

ROOT = Path(__file__).resolve().parents[2]
CORNELL = ("garnet_red", "krylon_blue", "cayman")
SMOKE = "This is a smoke test: the figures mean nothing."


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


def listed(text: str | None, known: Sequence[str], where: str) -> list[str]:
    """The names of a list with commas, all known ones where there is none. Raises BadInput for another name.

    A comma with a space after it is part of a name.
    """
    if text is None:
        return list(known)
    chosen = [name.strip() for name in re.split(r",(?! )", text) if name.strip()]
    unknown = [name for name in chosen if name not in known]
    if unknown:
        raise BadInput(where=where, found=repr(unknown[0]), expected=f"some of {', '.join(known)}")
    return chosen


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


def parser_of(description: str | None, *takes: str) -> argparse.ArgumentParser:
    """Make a parser that takes --short, and of "data", "effort" and "out" the options that a script names.

    The first line of `description` describes the script.
    """
    parser = argparse.ArgumentParser(description=(description or "").split("\n")[0])
    parser.add_argument("--short", action="store_true", help="a smoke test of seconds; its figures mean nothing")
    if "data" in takes:
        parser.add_argument("--data", type=Path, help="the folder of real measurements (default: HOMOFACT_DATA)")
    if "effort" in takes:
        add_effort(parser)
    if "out" in takes:
        parser.add_argument("--out", type=Path, help="a Markdown file to write as well")
    return parser


def finish(text: str | Sequence[str], chosen: argparse.Namespace, place: Path | None = None) -> int:
    """Print a text, or paragraphs of one, and write it to `place` or --out where there is one.

    Returns 0, the exit code.
    """
    whole = text if isinstance(text, str) else "\n\n".join(text)
    whole = whole.rstrip("\n") + "\n" + (f"\n{SMOKE}\n" if chosen.short else "")
    print(whole, end="")
    place = chosen.out if place is None else place
    if place is not None:
        write(place, whole)
    return 0


def print_measured(
    parser: argparse.ArgumentParser, arguments: Sequence[str] | None, measured: Callable[[argparse.Namespace], str]
) -> int:
    """Finish with the text that `measured` makes of the arguments; every such program takes --out.

    Returns 0, or 2 with the message on stderr where something is missing or wrong (`BadInput`).
    """
    parser.add_argument("--out", type=Path, help="a Markdown file to write as well")
    chosen = parser.parse_args(arguments)
    try:
        text = measured(chosen)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    return finish(text, chosen)


def progress(*words: object) -> None:
    """Tell a line of what is done so far, on stderr."""
    print(*words, file=sys.stderr, flush=True)


class Finished:
    """Results by key, kept in a file as JSON lines if one is named, so that a run that was ended can go on."""

    def __init__(self, path: Path | None = None) -> None:
        """Read what `path` has; a last line that a kill cut off does not count."""
        self._path, self._found = path, {}
        if path is not None and path.is_file():
            whole = [line for line in path.read_text(encoding="utf-8").splitlines(True) if line.endswith("\n")]
            self._found = dict(json.loads(line) for line in whole)

    def __contains__(self, key: str) -> bool:
        """Whether there is a result of this key."""
        return key in self._found

    def items(self) -> Iterable[tuple[str, Any]]:
        """All keys with their results."""
        return self._found.items()

    def __getitem__(self, key: str) -> Any:
        """The result of a key."""
        return self._found[key]

    def keep(self, key: str, result: Any) -> Any:
        """Keep and return a result, which JSON can hold."""
        self._found[key] = result
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps([key, result]) + "\n")
        return result

    def get(self, key: str, make: Callable[[], Any]) -> Any:
        """The result of a key; made and kept where there is none yet."""
        return self[key] if key in self else self.keep(key, make())
