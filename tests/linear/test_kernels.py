"""Compiled kernels: kept on the disk where that can be, made anew where what is kept is damaged, and never a must."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import homofact
from homofact.files import compiled

ROOT = Path(__file__).resolve().parents[2]
SOURCE = """
import numba
from homofact.linear.kernels import kernel

@kernel(nogil=True)
def twice(x):
    return 2 * x
"""


def twice(folder: Path) -> Any:
    """The kernel of a module file, loaded anew and called."""
    place = folder / "module.py"
    if not place.exists():
        place.write_text(SOURCE)
    spec = importlib.util.spec_from_file_location("module", place)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.twice(1.5) == 3.0
    return module.twice


def kept(folder: Path, ending: str) -> list[Path]:
    return list((folder / "__pycache__").glob(f"*.{ending}"))


def hits(kernel: Any) -> int:
    return sum(kernel.stats.cache_hits.values())


def test_what_is_kept_is_used_and_what_is_damaged_is_made_anew(tmp_path: Path) -> None:
    assert hits(twice(tmp_path)) == 0
    assert hits(twice(tmp_path)) == 1
    for ending in ("nbi", "nbc"):
        for damage in (b"", b"\x80\x04garbage", None):
            for path in kept(tmp_path, ending):
                path.write_bytes(path.read_bytes()[: path.stat().st_size // 2] if damage is None else damage)
            assert hits(twice(tmp_path)) == 0
            assert hits(twice(tmp_path)) == 1


def test_a_full_disk_only_costs_the_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", full)
    assert hits(twice(tmp_path)) == 0
    assert kept(tmp_path, "nbi") == []


def test_no_place_to_keep_anything_only_costs_the_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> None:
        raise RuntimeError("cannot cache function 'twice': no locator available for file")

    monkeypatch.setattr("numba.core.caching.FunctionCache.__init__", none)
    twice(tmp_path)
    assert not (tmp_path / "__pycache__").exists() or kept(tmp_path, "nbi") == []


def run(program: str, **more: Any) -> str:
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), "HOME": "/nonexistent"}
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment, **more)
    assert (ran.returncode, ran.stderr) == (0, "")
    return ran.stdout.strip()


def test_a_private_folder_stands_in_where_none_can_be_written_and_goes_at_the_end() -> None:
    program = """
import os, sys
from pathlib import Path
from homofact.files import compiled
compiled._writable = lambda folder: False
compiled.give_place(Path("x"))
folder = Path(os.environ["NUMBA_CACHE_DIR"])
assert folder.stat().st_mode & 0o777 == 0o700
compiled.give_place(Path("x"))
assert "numba" not in sys.modules
print(folder)
if os.fork() == 0:
    sys.exit(0)
assert os.wait()[1] == 0
assert folder.is_dir() and Path(os.environ["NUMBA_CACHE_DIR"]) == folder
"""
    folder = Path(run(program))
    assert folder.name.startswith("homofact-compiled-")
    assert not folder.exists()


def test_where_something_can_be_written_numba_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(compiled.VARIABLE, raising=False)
    compiled.give_place(tmp_path)
    assert compiled.VARIABLE not in os.environ
    monkeypatch.setattr(compiled, "_writable", lambda folder: "__pycache__" not in str(folder))
    compiled.give_place(tmp_path)
    assert compiled.VARIABLE not in os.environ


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs to become another user")
def test_a_user_without_a_home_compiles_from_a_folder_that_is_not_theirs() -> None:
    program = "import os, homofact, homofact.linear.definite; print(os.environ['NUMBA_CACHE_DIR'])"
    try:
        subprocess.run([sys.executable, "-c", "import homofact"], user=65534, cwd="/", capture_output=True, check=True)
    except (PermissionError, subprocess.CalledProcessError):
        pytest.skip("interpreter or package cannot be read by another user")
    folder = Path(run(program, user=65534, cwd="/"))
    assert not folder.exists()


def test_everything_that_is_kept_is_kept_this_way() -> None:
    """Numba's own cache ends in a traceback where a kept file is damaged."""
    root = Path(homofact.__file__).parent
    own = [path.name for path in root.rglob("*.py") if "cache=True" in path.read_text(encoding="utf-8")]
    assert own == []
