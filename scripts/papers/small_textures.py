"""Make every table, figure and number of the study in docs/papers/small_textures from kept results.

    python scripts/papers/small_textures.py [--paper FOLDER] [--results FOLDER]
    python scripts/papers/small_textures.py --anew [straightening slices search time relighting] [--data FOLDER]

The results are JSON lines in docs/papers/small_textures/results, and for the comparison at equal bytes those of
docs/real.md. Tables and numbers are LaTeX, figures PDF; the same results and libraries give the same bytes. --anew
measures experiments again, all of them unless some are named: hours on one thread, most of it the comparison at equal
bytes. A run that was ended goes on. The program prints the sentences of the text that the results do not bear out, and
then returns 1. --png FOLDER draws the figures as pictures too.
"""

import sys
from pathlib import Path

from homofact.errors import BadInput

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.papers.small_figures import FIGURES, save
from scripts.papers.small_numbers import claims, numbers
from scripts.papers.small_results import EXPERIMENTS, KEPT, Results, measure, read
from scripts.papers.small_tables import TABLES
from scripts.shared.harness import parser_of, progress, write

MADE = "% Made by `python scripts/papers/small_textures.py` from kept results: change those, not this file.\n"


def make(results: Results, paper: Path) -> list[Path]:
    """Write tables/*.tex and figures/*.pdf of the paper; what was written."""
    texts = {name: table(results) for name, table in TABLES.items()}
    texts["numbers"] = numbers(results).text()
    made = []
    for name, text in texts.items():
        made.append(paper / "tables" / f"{name}.tex")
        write(made[-1], MADE + text)
    for name in FIGURES:
        made.append(paper / "figures" / f"{name}.pdf")
        made[-1].parent.mkdir(parents=True, exist_ok=True)
        save(name, results, made[-1])
    return made


def main(arguments: list[str] | None = None) -> int:
    """Measure what is asked for, make the files, and check the text's comparisons."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--paper", type=Path, default=KEPT.parent, help="the paper's folder")
    parser.add_argument("--results", type=Path, default=KEPT, help="the folder of kept results")
    parser.add_argument("--anew", nargs="*", choices=EXPERIMENTS, metavar="NAME", help="measure again, all or these")
    parser.add_argument("--png", type=Path, help="a folder for the figures as pictures")
    chosen = parser.parse_args(arguments)
    try:
        if chosen.anew is not None:
            measure(chosen.anew or list(EXPERIMENTS), chosen.results, chosen.data)
        results = read(chosen.results)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    made = make(results, chosen.paper)
    for name in FIGURES if chosen.png else ():
        chosen.png.mkdir(parents=True, exist_ok=True)
        save(name, results, chosen.png / f"{name}.png")
    progress(f"{len(made)} files in {chosen.paper}")
    failed = [words for words, holds in claims(results) if not holds]
    for words in failed:
        print(f"The results do not bear out: {words}. Rewrite its sentence in paper.tex.", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
