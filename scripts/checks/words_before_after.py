"""Count the phrases that break each rule of docs/words.toml at a commit and now.

    python scripts/checks/words_before_after.py [--before REVISION] [--after REVISION]

README, CONTRIBUTING and the pages of docs are one column each time, the strings of homofact/ (docstrings, help and
messages) the other. The default of --before is the last commit before the pages were rewritten in plain English;
without --after the files of the working tree are counted.
"""

import argparse
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))
from sitemaker.prose import DOCSTRING_CODE, RULES, broken, strings  # noqa: E402

BEFORE = "e5aa132^"  # "Rewrite the README, the site's first page and Start in plain English"


def texts_at(revision: str) -> Iterator[tuple[str, str]]:
    """Yield (path, text) of the pages and sources of a commit, or of the working tree for ""."""
    listed = ["ls-tree", "-r", "--name-only", revision] if revision else ["ls-files"]
    for path in _git(*listed).splitlines():
        page = path in ("README.md", "CONTRIBUTING.md") or (path.startswith("docs/") and path.endswith(".md"))
        if page or (path.startswith("homofact/") and path.endswith(".py")):
            if not revision and not (ROOT / path).is_file():
                continue
            yield path, _git("show", f"{revision}:{path}") if revision else (ROOT / path).read_text(encoding="utf-8")


def count(revision: str) -> tuple[Counter[int], Counter[int]]:
    """Return how many phrases of the pages, and of the package's strings, break each rule, by the rule's number."""
    pages: Counter[int] = Counter()
    messages: Counter[int] = Counter()
    for path, text in texts_at(revision):
        if path.endswith(".md"):
            pages.update(rule for rule, _, _ in broken(text))
        else:
            for _, words in strings(text):
                messages.update(rule for rule, _, _ in broken(words, DOCSTRING_CODE))
    return pages, messages


def table(before: tuple[Counter[int], Counter[int]], after: tuple[Counter[int], Counter[int]]) -> str:
    """Return the counts as a table in Markdown, a row per rule and the sums last."""
    lines = ["| rule, by an example of what it finds | pages before | pages now | strings before | strings now |",
             "| --- | ---: | ---: | ---: | ---: |"]  # fmt: skip
    for number, rule in enumerate(RULES):
        counts = [each[part][number] for part in (0, 1) for each in (before, after)]
        lines.append(f"| `{' '.join(rule['bad'].replace('`', '').split())}` | {' | '.join(map(str, counts))} |")
    sums = [each[part].total() for part in (0, 1) for each in (before, after)]
    return "\n".join([*lines, f"| all {len(RULES)} rules | {' | '.join(map(str, sums))} |"])


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, encoding="utf-8").stdout


def main() -> None:
    """Count both and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--before", default=BEFORE, metavar="REVISION", help="a commit (default: %(default)s)")
    parser.add_argument("--after", default="", metavar="REVISION", help="a commit (default: the working tree)")
    asked = parser.parse_args()
    print(table(count(asked.before), count(asked.after)))


if __name__ == "__main__":
    main()
