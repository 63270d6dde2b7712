"""Calibrate the error bars, and report how often they hold.

    python scripts/verdict/calibrate.py --cases 200 --store FITS.jsonl
    python scripts/verdict/calibrate.py --report 210 --seed 2 --store REPORT.jsonl --out docs/verdict.md
    python scripts/verdict/calibrate.py --report 105 --seed 2 --held-out 0 --store ALL.jsonl

Cases are drawn (`drawn_cases.py`), fitted and measured (`simulating.py`) into a store, so that an interrupted run goes
on where it stopped; of fits of its first two parts the table is made (`calibrating.py`) and written to
`homofact/evaluation/bar/table.json`. With --report the table stays as it is, and its bars and its warning are counted
on the third part, which no weight and no threshold has seen (`coverage.py`). A case has three fits and takes
some seconds on a core of its own.
"""

import hashlib
import json
import re
import sys
from pathlib import Path
from typing import Any

from homofact.brdf.source_names import HELD_OUT
from homofact.evaluation.bar.table import Table, table
from homofact.evaluation.machine import machine
from homofact.linear.normal import warm_up
from homofact.stability.fault import CasePart
from homofact.version import __version__

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, data_folder, finish, parser_of, write
from scripts.verdict.calibrating import calibrated, fits_of
from scripts.verdict.coverage import report
from scripts.verdict.drawn_cases import in_turn
from scripts.verdict.simulating import simulate

TABLE = ROOT / "homofact" / "evaluation" / "bar" / "table.json"
_SHORT = 2


def main(arguments: list[str] | None = None) -> int:
    """Simulate what is lacking, then write the table, or the report on it."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--cases", type=int, default=100, help="cases of each of the two parts (%(default)s)")
    parser.add_argument("--report", type=int, default=0, help="cases to report on, instead of making the table")
    parser.add_argument("--store", type=Path, required=True, help="the simulated fits, a JSON line each")
    parser.add_argument("--table", type=Path, default=TABLE, help="where the table is written (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw of cases")
    parser.add_argument("--held-out", type=float, default=HELD_OUT, help="part held out of reported fits (%(default)s)")
    options = parser.parse_args(arguments)
    warm_up()
    folder = data_folder(options.data)
    if options.report:
        asked = {CasePart.REPORT: _SHORT if options.short else options.report}
        fits = fits_of(simulate(in_turn(asked), folder, options.store, options.seed, options.held_out))
        used = Table.of(json.loads(options.table.read_text(encoding="utf-8"))) if options.table != TABLE else table()
        return finish([*report(fits, used), machine()], options)
    count = _SHORT if options.short else options.cases
    wanted: dict[CasePart, int] = {CasePart.FIRST: count, CasePart.SECOND: count}
    records = simulate(in_turn(wanted), folder, options.store, options.seed)
    made = made_of(records, wanted, options.seed)
    constants = calibrated(fits_of(records), made)
    write(options.table, written(constants))
    return finish([f"{made['fits']} fits of {made['cases']} cases; the table is {options.table}."], options)


def written(constants: dict[str, Any]) -> str:
    """A table as JSON, each column of a model on a line."""
    text = json.dumps(constants, indent=1, ensure_ascii=False)
    return re.sub(r"\[\s+([^\[\]{}]+?)\s+\]", lambda found: f"[{' '.join(found[1].split())}]", text) + "\n"


def made_of(records: list[dict[str, Any]], wanted: dict[CasePart, int], seed: int) -> dict[str, Any]:
    """By what a table is made: the script, how much of what, and a hash of the fits' records."""
    text = "\n".join(json.dumps(record, sort_keys=True) for record in records)
    return {
        "script": "scripts/verdict/calibrate.py",
        "seed": seed,
        "cases": sum(wanted.values()),
        "fits": len(fits_of(records)),
        "searched": sum(fit.searched for fit in fits_of(records)),
        "hash": hashlib.sha256(text.encode()).hexdigest()[:16],
        "version": __version__,
    }


if __name__ == "__main__":
    sys.exit(main())
