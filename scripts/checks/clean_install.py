"""Install the wheel and the sdist in a clean environment: seconds, sizes, and a first fit.

The sdist is made of a copy of the sources, the wheel of the unpacked sdist. The environment has pip alone; torch is
installed first, then the wheel with what a fit needs, then its extras. Nothing is uploaded.

    python scripts/checks/clean_install.py [--torch torch==2.13.0] [--extras pictures,containers all] [--out FILE.md]
    python scripts/checks/clean_install.py --build dist
"""

import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import venv
from pathlib import Path

from homofact.evaluation.machine import machine
from homofact.version import __version__

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, finish, markdown, parser_of

# What goes into an sdist, by MANIFEST.in; pictures stay where the documents are read.
FOLDERS = ("homofact", "data_synthetic", "configs", "docs", "scripts", "tests", ".ci")
FILES = (
    "pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE", "CHANGELOG.md", "CONTRIBUTING.md",
    "CITATION.cff", "Makefile", "constraints.txt",
)  # fmt: skip
_CALL = "from setuptools import build_meta; build_meta.build_{}({!r})"
_TRIED = ("factorize", "data_synthetic/blue_paint.npz", "--textures", "2", "--size", "16", "--out", "out")


def built(out: Path) -> tuple[Path, Path]:
    """(the sdist, the wheel) in `out`, by setuptools alone. Raises RuntimeError where one cannot be made."""
    out.mkdir(parents=True, exist_ok=True)
    sdist, wheel = out / f"homofact-{__version__}.tar.gz", out / f"homofact-{__version__}-py3-none-any.whl"
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "sources"
        copy.mkdir()
        ignored = ("__pycache__", "*.nbi", "*.nbc", "node_modules", "*.so")
        for name in FOLDERS:
            # The scripts that draw the pictures are in a folder of the same name.
            pictures = ("pictures",) if name == "docs" else ()
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns(*ignored, *pictures))
        for name in FILES:
            shutil.copy(ROOT / name, copy / name)
        run([sys.executable, "-c", _CALL.format("sdist", str(out.resolve()))], copy)
        with tarfile.open(sdist) as archive:
            archive.extractall(folder, filter="data")
        run([sys.executable, "-c", _CALL.format("wheel", str(out.resolve()))], Path(folder) / f"homofact-{__version__}")
    return sdist, wheel


def run(command: list[str], folder: Path) -> str:
    """A command's stdout, run without this checkout on the path. Raises RuntimeError where it fails."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: ended with {done.returncode}: {done.stderr.strip()[-2000:]}")
    return done.stdout


def megabytes(place: Path) -> float:
    """The size of a file, or of all files in a folder, links not followed, in MB (10⁶ bytes)."""
    files = (
        [place] if place.is_file() else [each for each in place.rglob("*") if each.is_file() and not each.is_symlink()]
    )
    return sum(each.stat().st_size for each in files) / 1e6


def installed(wheel: Path, torch: str, extras: list[str], place: Path) -> list[tuple[str, ...]]:
    """A line a step: what was installed, packages and MB of site-packages then, seconds of pip, of a fit, its notes."""
    venv.create(place, with_pip=True)
    python = str(place / "bin" / "python")
    (packages,) = place.glob("lib/python*/site-packages")
    pip = [python, "-m", "pip", "install", "-q", "--disable-pip-version-check"]
    steps = [(torch, [torch]), ("the wheel", [str(wheel)])]
    steps += [(f"the wheel[{each}]", [f"{wheel}[{each}]"]) for each in extras]
    rows = []
    for name, wanted in steps:
        began = time.perf_counter()
        run([*pip, "-c", str(ROOT / "constraints.txt"), *wanted], place)
        seconds = time.perf_counter() - began
        fit = "–"
        if name != torch:
            began = time.perf_counter()
            with tempfile.TemporaryDirectory() as empty:
                run([str(place / "bin" / "homofact"), *_TRIED, "-q"], Path(empty))
            fit = f"{time.perf_counter() - began:.0f}"
        count = sum(1 for _ in packages.glob("*.dist-info"))
        rows.append((name, str(count), f"{megabytes(packages):.0f}", f"{seconds:.0f}", fit))
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Build, install, print the table and write it."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--build", type=Path, default=None, help="build into this folder, install nothing")
    parser.add_argument("--torch", default="torch==2.13.0")
    parser.add_argument("--extras", nargs="*", default=["pictures,containers", "all"])
    given = parser.parse_args(arguments)
    if given.build is not None:
        for each in built(given.build):
            sys.stdout.write(f"{each}\n")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        sdist, wheel = built(Path(folder) / "built")
        rows = installed(wheel, given.torch, given.extras, Path(folder) / "environment")
        sizes = f"wheel {megabytes(wheel):.1f} MB, sdist {megabytes(sdist):.1f} MB"
    header = ("installed", "packages", "MB of site-packages", "seconds of pip", "seconds of a first fit")
    return finish((machine(), sizes, markdown(header, rows)), given)


if __name__ == "__main__":
    sys.exit(main())
