"""Relight a large mesh, and compare the predicted memory with the memory that it takes.

    python scripts/relighting/relight_large.py [--vertices 1000000] [--cube 8] [--kept 16] [--out FILE.md] [--short]

A torus knot of so many vertices, of a smooth material of one term, is written as a PLY file and relit by `homofact
relight` in a process of its own, whose memory is read from the system some times a second. Memory of a process's own
(RssAnon) is what must fit; pages of mapped files (RssFile) go when they are in the way. What Python, torch and numba
take by themselves is measured by a mesh of 2,000 vertices and taken off.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from homofact.evaluation.machine import machine
from homofact.meshes.shapes import torus_knot

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of

SCENE = """
[[object]]
mesh = "knot.ply"
albedo = [0.6, 0.5, 0.4]
terms = 1
[lighting]
named = "studio"
[[camera]]
eye = [0.6, 0.9, 3.6]
pixels = [160, 120]
[transport]
cube = {cube}
kept = {kept}
"""
SMALL = 2000


def relit(folder: Path, vertices: int, cube: int, kept: int) -> dict[str, float]:
    """Vertices, the process's peaks of memory and what it had said, in bytes, and seconds of the clock and of it."""
    import trimesh

    side = round(vertices**0.5)
    mesh = torus_knot(side, max(side, 8))
    folder.mkdir()
    trimesh.Trimesh(mesh.positions, mesh.triangles, vertex_normals=mesh.normals, process=False).export(
        folder / "knot.ply"
    )
    (folder / "scene.toml").write_text(SCENE.format(cube=cube, kept=kept), encoding="utf-8")
    command = [sys.executable, "-m", "homofact.cli.main", "relight", "scene.toml", "--out", "out", "--vertices", "0"]
    found = {"own": 0.0, "mapped": 0.0}
    with (folder / "said").open("w") as said, (folder / "record").open("w") as record:
        began = time.perf_counter()
        process = subprocess.Popen([*command, "--json"], cwd=folder, stderr=said, stdout=record, env=dict(os.environ))
        while process.poll() is None:
            try:
                text = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
            except OSError:
                break
            for name, field in (("own", "RssAnon"), ("mapped", "RssFile")):
                line = re.search(rf"{field}:\s+(\d+) kB", text)
                if line:
                    found[name] = max(found[name], 1024.0 * int(line[1]))
            time.sleep(0.05)
        found["clock"] = time.perf_counter() - began
    words = (folder / "said").read_text(encoding="utf-8")
    if process.wait():
        raise SystemExit(words)
    told = re.search(r"at most (\d+) MB of transport, at most (\d+) MB of memory and (\d+) MB of disk", words)
    assert told is not None, words
    found |= {name: 1e6 * int(told[k]) for k, name in enumerate(("stored", "memory", "disk"), 1)}
    return found | {"vertices": len(mesh.positions), "written": (folder / "out" / "relight.npz").stat().st_size}


def main(arguments: list[str] | None = None) -> int:
    """Relight both meshes and print."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--vertices", type=int, default=1_000_000, help="of the large mesh, about (%(default)s)")
    parser.add_argument("--cube", type=int, default=8, help="texels along a face of the cube map (%(default)s)")
    parser.add_argument("--kept", type=int, default=16, help="coefficients per vector (%(default)s)")
    chosen = parser.parse_args(arguments)
    count = 10_000 if chosen.short else chosen.vertices
    with tempfile.TemporaryDirectory() as folder:
        base = relit(Path(folder) / "small", SMALL, chosen.cube, chosen.kept)
        found = relit(Path(folder) / "large", count, chosen.cube, chosen.kept)
    rows = [
        ("vertices", f"{found['vertices']:,}"),
        ("stored, at most, MB", figure(found["stored"] / 1e6)),
        ("predicted memory, MB", figure(found["memory"] / 1e6)),
        ("peak of its own memory, beside the program's, MB", figure((found["own"] - base["own"]) / 1e6)),
        ("the program's own, MB", figure(base["own"] / 1e6)),
        ("mapped files in memory, beside the program's, MB", figure((found["mapped"] - base["mapped"]) / 1e6)),
        ("predicted disk for blocks, MB", figure(found["disk"] / 1e6)),
        ("relight.npz, MB", figure(found["written"] / 1e6)),
        ("time, s", figure(found["clock"])),
    ]
    lines = [
        f"cube maps of 6 × {chosen.cube}², one term, {chosen.kept} coefficients per vector. {machine()}",
        "",
        markdown(("", ""), rows),
        "",
    ]
    return finish("\n".join(lines), chosen)


if __name__ == "__main__":
    sys.exit(main())
