"""Wheel and sdist: what is in them, and a fit of embedded data in an empty folder by what the wheel installs.

Built and installed without a network: the libraries are those of this environment.
"""

import os
import re
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from importlib import import_module
from pathlib import Path

import pytest

from homofact.version import __version__

ROOT = Path(__file__).resolve().parents[2]


def files_under(*folders: str) -> set[str]:
    """What is the project's own under some of its folders."""
    return {
        str(each.relative_to(ROOT))
        for folder in folders
        for each in (ROOT / folder).rglob("*")
        if each.is_file() and "__pycache__" not in each.parts and each.suffix not in (".nbi", ".nbc")
    }


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist, made of a copy of the sources, and the wheel, made of the sdist."""
    made = tmp_path_factory.mktemp("built")
    sdist, _ = import_module("scripts.checks.clean_install").built(made)
    with tarfile.open(sdist) as archive:
        archive.extractall(made / "apart", filter="data")
    return made


@pytest.fixture(scope="module")
def installed(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command of an environment of its own, in which the libraries of this one are found."""
    place = tmp_path_factory.mktemp("environment")
    venv.create(place, with_pip=False, symlinks=True)
    python = place / "bin" / "python"
    wheel = str(built / f"homofact-{__version__}-py3-none-any.whl")
    run(
        [sys.executable, "-m", "pip", "--python", str(python), "install", "-q", "--no-deps", "--no-index", wheel], place
    )
    (own,) = place.glob("lib/python*/site-packages")
    # Without its .pth files, by which a checkout would be found.
    (own / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return place / "bin" / "homofact"


def run(command: list[str], folder: Path) -> str:
    """A command's stdout, run without this checkout on the path."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_has_every_file_of_the_package_and_the_embedded_ones(built: Path) -> None:
    with zipfile.ZipFile(built / f"homofact-{__version__}-py3-none-any.whl") as wheel:
        names = set(wheel.namelist())
        metadata = wheel.read(f"homofact-{__version__}.dist-info/METADATA").decode()
    embedded = {f"homofact/embedded/{each}" for each in files_under("data_synthetic", "configs")}
    told = {name for name in names if not name.startswith(f"homofact-{__version__}.dist-info/")}
    assert told == files_under("homofact") | embedded
    needed = re.findall(r"^Requires-Dist: ([\w-]+)[^;\n]*$", metadata, re.MULTILINE)
    assert sorted(needed) == [
        "colour-science", "nlopt", "numba", "numpy", "rich", "scipy", "threadpoolctl", "torch", "typer",
    ]  # fmt: skip
    assert "Requires-Python: >=3.11" in metadata


def test_the_sdist_has_what_tests_and_builds(built: Path) -> None:
    own = built / "apart" / f"homofact-{__version__}"
    there = {str(each.relative_to(own)) for each in own.rglob("*") if each.is_file()}
    wanted = files_under("homofact", "data_synthetic", "configs", "scripts", ".ci")
    wanted |= {"setup.py", "MANIFEST.in", "CHANGELOG.md", "CITATION.cff", "tests/conftest.py", "docs/export.md"}
    assert wanted - there == set()
    assert not any(each.startswith("docs/pictures") or "node_modules" in each for each in there)
    assert not any(each.endswith(".so") for each in there)


@pytest.mark.slow
def test_what_is_installed_fits_embedded_data_in_an_empty_folder(installed: Path, tmp_path: Path) -> None:
    assert run([str(installed), "--version"], tmp_path) == f"homofact {__version__}\n"
    place = "import homofact; print(homofact.__file__)"
    assert str(installed.parents[1]) in run([str(installed.parent / "python"), "-c", place], tmp_path)
    fit = ["factorize", "data_synthetic/synthetic_cornell.brdf", "--method", "mccool", "--size", "6", "--out", "out"]
    assert "compare.png" in run([str(installed), *fit], tmp_path)
    run([str(installed), "factorize", "-c", "configs/blue_paint.toml", "--textures", "1", "--effort", "5"], tmp_path)
    assert (tmp_path / "out" / "blue_paint" / "report.json").is_file()
    lines = "import homofact; print(len(homofact.read('data_synthetic/plastic.npz').samples.wi))"
    assert int(run([str(installed.parent / "python"), "-c", lines], tmp_path)) > 100


@pytest.mark.slow
def test_what_is_installed_finds_what_embedded_scenes_name(installed: Path, tmp_path: Path) -> None:
    lines = (
        "from homofact.files.embedded import located;"
        "from homofact.relighting.scene_file import read_relight_scene as read;"
        "print(*(each.mesh for each in read(located('configs/scenes/relight.toml')).objects))"
    )
    assert "embedded" in run([str(installed.parent / "python"), "-c", lines], tmp_path)
