"""Run the numeric tests and the stored fits under the code paths of several processors.

    python scripts/checks/processors.py [tests …] [--processors NAME …] [--only tests|fits]

numba compiles for the processor that NUMBA_CPU_NAME names; torch and OpenBLAS choose their kernels by variables of
their own. Each choice runs in its own processes, with its own folder of compiled code. For a processor with
instructions that this machine lacks, numba tunes without them. The table shows for each processor whether the tests
pass, how many of the twelve fits of `same_fits` have the bits of this machine's own choice, and the largest relative
difference of their values. Failing tests and a difference above 1e-8 are errors.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
NUMERIC = [f"tests/{name}" for name in ("geometry", "linear", "factor", "separable", "methods", "shading", "runtime")]
MOST_DIFFERENCE = 1e-8
PROCESSORS: dict[str, dict[str, str]] = {
    "this one": {},
    "generic": {"NUMBA_CPU_NAME": "generic", "ATEN_CPU_CAPABILITY": "default", "OPENBLAS_CORETYPE": "Prescott"},
    "haswell": {"NUMBA_CPU_NAME": "haswell", "ATEN_CPU_CAPABILITY": "avx2", "OPENBLAS_CORETYPE": "Haswell"},
    "znver3": {"NUMBA_CPU_NAME": "znver3", "ATEN_CPU_CAPABILITY": "avx2", "OPENBLAS_CORETYPE": "Zen"},
    "skylake-avx512": {"NUMBA_CPU_NAME": "skylake-avx512", "OPENBLAS_CORETYPE": "Haswell"},
}


def environment(processor: str, folder: Path) -> dict[str, str]:
    """The variables of a process that computes as on `processor`, its compiled code in `folder`."""
    own = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(folder / processor)}
    return os.environ | own | PROCESSORS[processor]


def failed_tests(processor: str, tests: list[str], folder: Path) -> list[str]:
    """The tests that fail, by name; what pytest printed, where it gave up before."""
    command = [sys.executable, "-m", "pytest", "-q", "-rfE", "--tb=no", "-p", "no:cacheprovider", *tests]
    ran = subprocess.run(
        command, cwd=ROOT, env=environment(processor, folder), capture_output=True, text=True, check=False
    )
    failed = [line.split(" ")[1] for line in ran.stdout.splitlines() if line.startswith(("FAILED ", "ERROR "))]
    return failed or ([] if ran.returncode == 0 else [ran.stdout + ran.stderr])


def fits(processor: str, folder: Path) -> dict[str, Any]:
    """The fits of `same_fits`, their hashes and values by name."""
    out = folder / f"{processor}.json"
    command = [sys.executable, "scripts/checks/same_fits.py", "--write", "--out", str(out)]
    subprocess.run(command, cwd=ROOT, env=environment(processor, folder), capture_output=True, check=True)
    return json.loads(out.read_text(encoding="utf-8"))["fits"]


def apart(fit: dict[str, Any], other: dict[str, Any]) -> float:
    """The largest relative difference of two fits' values."""
    before, after = np.array(other["values"]), np.array(fit["values"])
    return float((np.abs(after - before) / np.maximum(np.abs(before), 1e-12)).max())


def main(arguments: list[str] | None = None) -> int:
    """Run all that is asked for and print a line per processor; 1 where something is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("tests", nargs="*", help="files or folders of tests; the numeric packages' unless given")
    parser.add_argument("--processors", nargs="+", choices=PROCESSORS, default=list(PROCESSORS))
    parser.add_argument("--only", choices=("tests", "fits"))
    options = parser.parse_args(arguments)
    wrong = False
    print(f"{'processor':16}  {'tests':12}  {'equal bits':10}  largest difference")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        own = {} if options.only == "tests" else fits("this one", folder)
        for processor in options.processors:
            tests, equal, largest = "", "", ""
            failed = [] if options.only == "fits" else failed_tests(processor, options.tests or NUMERIC, folder)
            if options.only != "fits":
                tests = f"{len(failed)} failed" if failed else "passed"
            if own:
                found = own if processor == "this one" else fits(processor, folder)
                equal = f"{sum(found[fit] == own[fit] for fit in own)} of {len(own)}"
                difference = max(apart(found[fit], own[fit]) for fit in own)
                largest = f"{difference:.1e}"
                wrong |= difference > MOST_DIFFERENCE
            print(f"{processor:16}  {tests:12}  {equal:10}  {largest}", flush=True)
            for test in failed:
                print(f"  {test}", flush=True)
            wrong |= bool(failed)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
