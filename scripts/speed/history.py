"""Time the commands, version by version: one line per command in `history.csv`, and a chart of all lines.

Every command runs in a process of its own, `--repeats` times; the fastest counts, since other work on a machine can
only add. Its CPU seconds are divided by those of a loop that no version changes (`reference`), so that machines of
other speed can stand in one chart. Beside them: peak memory, and of fits the evaluations counted, the held-out Cole
error and the relative RMS of f cosθi cosθo, which are the same on every machine of one kind.

With `--checkouts` the versions in these folders are run in turn, command by command. `--check` ends with 1 where a
figure is more than 20% above the last one of the same command, of the same kind of machine where it depends on that.

    python scripts/speed/history.py [--checkouts FOLDER …] [--long] [--only NAMES] [--write] [--check] [--plot FILE]
"""

import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import ROOT, data_folder, figure, finish, listed, markdown, parser_of, progress, write_csv
from scripts.speed.command_time import HOMOFACT, timed

KEPT = Path(__file__).with_name("history.csv")
RISE = 1.2
LOOP_SIZE, LOOP_TURNS = 384, 60
# Which figures may not rise, and whether another machine's line says nothing of them.
WATCHED = {"work": True, "peak": True, "evaluations": False, "error": False, "rms": False}


@dataclass(frozen=True)
class Line:
    """One command of one version, measured once; `work` is CPU seconds over those of `reference`, `peak` is in MB."""

    day: str
    version: str
    machine: str
    command: str
    work: float
    cpu: float
    wall: float
    peak: float
    evaluations: float | None = None
    error: float | None = None
    rms: float | None = None

    @classmethod
    def read(cls, row: dict[str, str]) -> "Line":
        """A line of the file."""
        words = {"day", "version", "machine", "command"}
        return cls(**{name: text if name in words else (float(text) if text else None) for name, text in row.items()})  # type: ignore[arg-type]


@dataclass(frozen=True)
class Command:
    """What is run: words after `homofact`, `{out}` a new folder and `{fit}` the fit of an earlier command.

    `{scene}` is a file with the text `scene`. `older` are the words of versions that have the text `older_has` in a
    file of `homofact/cli`. `ends` are its exit codes: a plan that is missed ends with 1.
    """

    name: str
    words: tuple[str, ...]
    fits: bool = False
    older: tuple[str, ...] = ()
    older_has: tuple[str, str] = ("", "")
    scene: str = ""
    ends: tuple[int, ...] = (0,)

    def words_of(self, checkout: Path) -> tuple[str, ...]:
        """The words for the version in a folder."""
        name, text = self.older_has
        file = checkout / "homofact" / "cli" / name
        is_old = bool(self.older) and file.is_file() and text in file.read_text(encoding="utf-8")
        return self.older if is_old else self.words


def reference() -> float:
    """CPU seconds of a loop that no version changes: Cholesky factors, and sums of Python numbers."""
    # On one thread whatever the environment says: others would wait for work, and that counts too.
    with threadpool_limits(1):
        matrix = np.random.default_rng(0).normal(size=(LOOP_SIZE, LOOP_SIZE))
        matrix = matrix @ matrix.T + LOOP_SIZE * np.eye(LOOP_SIZE)
        began = time.process_time()
        for _ in range(LOOP_TURNS):
            np.linalg.cholesky(matrix)
            sum(place * place for place in range(20_000))
        return time.process_time() - began


def commands(folder: Path, short: bool, long: bool) -> Iterator[Command]:
    """The fixed set; of real measurements as far as they are at hand, the README's chart and plans if `long`."""
    measured = str(ROOT / "data_synthetic" / "synthetic_cornell.brdf")
    size = ("--textures", "1", "--size", "4") if short else ("--textures", "2", "--size", "16")
    yield Command("info", ("info", measured))
    yield Command("factorize measurement", ("factorize", measured, *size, "--out", "{out}"), fits=True)
    if short:
        return
    paint = ("factorize", "material:lafortune-blue-paint")
    yield Command("factorize blue paint", (*paint, *size, "--out", "{out}"), fits=True)
    file = folder / "rgl" / "vch_golden_yellow_rgb.bsdf"
    if file.is_file():
        yield Command("info golden yellow", ("info", str(file)))
        words = ("factorize", str(file), "--textures", "3", "--size", "32", "--out", "{out}")
        yield Command("factorize golden yellow", words, fits=True)
    older = ("export", "{fit}", "--to", "{out}")
    yield Command("export", ("export", "{fit}", "--out", "{out}"), older=older, older_has=("export.py", '"--to"'))
    yield Command("view", ("view", "{fit}", "--out", "{out}.html"))
    if long:
        paint, grid = "material:lafortune-blue-paint", ("--textures", "1,2,3", "--effort", "quick")
        charted = ("compare", paint, *grid, "--size", "8,16", "--chart", "{out}")
        older = ("chart", paint, *grid, "--sizes", "8,16", "--out", "{out}")
        yield Command("chart", charted, older=older, older_has=("chart.py", ""))
        scene = str(ROOT / "configs" / "scenes" / "example.toml")
        yield Command("plan", ("plan", scene, "--against", "sun", "--plot", "{out}.png"))
        sources = [file, folder / "cornell" / "garnet_red.brdf"]
        if all(source.is_file() for source in sources):
            yield Command("plan of two measurements", ("plan", "{scene}"), scene=scene_of(sources), ends=(0, 1))


def scene_of(sources: Sequence[Path]) -> str:
    """The text of a scene of measured materials in equal shares under an overcast sky, right to 10%."""
    materials = "".join(f'[[material]]\nsource = "{source}"\nshare = {1 / len(sources)}\n\n' for source in sources)
    return f'seed = 0\n\n{materials}[lighting]\nnamed = "overcast"\n\n[tolerance]\nreflected = 0.1\n'


def version_of(checkout: Path) -> str:
    """The version in a checkout, with its commit."""
    text = (checkout / "homofact" / "version.py").read_text(encoding="utf-8")
    number = next(line.split('"')[1] for line in text.splitlines() if line.startswith("__version__"))
    found = subprocess.run(
        ["git", "-C", str(checkout), "describe", "--always", "--dirty"], capture_output=True, text=True
    )
    return f"{number} {found.stdout.strip()}".strip()


def kind_of_machine() -> str:
    """The processor and the number of its cores that are given."""
    text = Path("/proc/cpuinfo").read_text(encoding="utf-8") if Path("/proc/cpuinfo").is_file() else ""
    names = [line.split(":")[1].strip() for line in text.splitlines() if line.startswith("model name")]
    return f"{names[0] if names else 'unknown'}, {os.cpu_count()} cores"


def measured(
    command: Command, checkouts: Sequence[Path], repeats: int, fits: dict[Path, Path], place: Path, loop: float
) -> list[Line]:
    """A line of every checkout, run in turn; `loop` is what `reference` took."""
    best: dict[Path, Line] = {}
    for turn in range(repeats):
        for number, checkout in enumerate(checkouts):
            out = place / f"{command.name.replace(' ', '-')}-{number}-{turn}"
            scene = out.with_name(f"{out.name}.toml")
            if command.scene:
                scene.write_text(command.scene, encoding="utf-8")
            said = {"out": out, "fit": fits.get(checkout, ""), "scene": scene}
            words = [word.format(**said) for word in command.words_of(checkout)]
            os.environ["PYTHONPATH"] = str(checkout)
            # -P: not the package in the working folder.
            run = timed([HOMOFACT[0], "-P", *HOMOFACT[1:], *words], command.ends)
            found: dict[str, float | None] = {}
            if command.fits:
                report = json.loads((out / "report.json").read_text(encoding="utf-8"))
                fits[checkout] = out
                seen = report["appearance"] or {}
                found = {
                    "evaluations": float(report["evaluations"]),
                    "error": report["error"]["held_out"]["log_mse"],
                    "rms": seen.get("rms_cosine"),
                }
            line = Line(
                datetime.now(UTC).date().isoformat(), version_of(checkout), kind_of_machine(), command.name,
                run.cpu / loop, run.cpu, run.wall, run.peak, **found,
            )  # fmt: skip
            if checkout not in best or line.work < best[checkout].work:
                best[checkout] = line
    return [best[checkout] for checkout in checkouts]


def risen(earlier: Sequence[Line], now: Sequence[Line]) -> list[str]:
    """What is more than `RISE` times the last figure of another version, in words."""
    found = []
    for line in now:
        for name, by_machine in WATCHED.items():
            before = [
                getattr(old, name)
                for old in earlier
                if old.command == line.command
                and old.version != line.version
                and getattr(old, name) is not None
                and (old.machine == line.machine or not by_machine)
            ]
            value = getattr(line, name)
            if before and value is not None and value > RISE * before[-1]:
                found.append(f"{line.command}: {name} {figure(value)}, {figure(before[-1])} before")
    return found


def draw(lines: Sequence[Line], file: Path) -> None:
    """Work and peak memory of every command, version by version."""
    from matplotlib.figure import Figure

    versions = list(dict.fromkeys(line.version for line in lines))
    page = Figure(figsize=(10.5, 4.2), layout="constrained")
    for axes, name, label in zip(
        page.subplots(1, 2), ("work", "peak"), ("CPU time / reference loop", "Peak memory, MB"), strict=True
    ):
        for command in dict.fromkeys(line.command for line in lines):
            latest = {line.version: getattr(line, name) for line in lines if line.command == command}
            places = [versions.index(version) for version in latest]
            axes.plot(places, list(latest.values()), marker="o", label=command)
        axes.set_xticks(range(len(versions)), versions, rotation=20, ha="right")
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
    shown, names = page.axes[0].get_legend_handles_labels()
    page.legend(shown, names, loc="outside right upper", fontsize="small")
    page.savefig(file, dpi=150)


def main(arguments: list[str] | None = None) -> int:
    """Run every command, print the table, and write, draw and check what is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument(
        "--checkouts", type=Path, nargs="+", default=[ROOT], help="folders with a homofact package each"
    )
    parser.add_argument("--repeats", type=int, default=3, help="runs of every command (%(default)s)")
    parser.add_argument("--csv", type=Path, default=KEPT, help="the file of lines (%(default)s)")
    parser.add_argument("--long", action="store_true", help="the README's chart, and plans, too")
    parser.add_argument("--only", help="these commands, by commas; those that a command needs must be among them")
    parser.add_argument("--write", action="store_true", help="append the lines to the file")
    parser.add_argument("--check", action="store_true", help="end with 1 where a figure has risen by more than 20%%")
    parser.add_argument("--plot", type=Path, help="draw all lines into this file")
    options = parser.parse_args(arguments)
    earlier: list[Line] = []
    if options.csv.is_file():
        with options.csv.open(encoding="utf-8", newline="") as file:
            earlier = [Line.read(row) for row in csv.DictReader(file)]
    now: list[Line] = []
    with tempfile.TemporaryDirectory() as folder:
        fits: dict[Path, Path] = {}
        loop = min(reference() for _ in range(3 if options.short else 12))
        known = list(commands(data_folder(options.data), options.short, options.long))
        chosen = listed(options.only, [command.name for command in known], "--only")
        names = [field.name for field in fields(Line)]
        for command in (each for each in known if each.name in chosen):
            repeats = 1 if options.short else options.repeats
            now += measured(command, options.checkouts, repeats, fits, Path(folder), loop)
            progress(*(f"{line.version} {line.command}: {line.cpu:.2f} s" for line in now[-len(options.checkouts) :]))
            # Command by command: a later one that fails takes nothing away.
            if options.write:
                kept = [
                    ["" if value is None else value for value in asdict(line).values()] for line in [*earlier, *now]
                ]
                write_csv(options.csv, names, kept)
    if options.plot is not None:
        draw([*earlier, *now], options.plot)
    header = ("command", "version", "CPU s", "wall s", "CPU / loop", "peak MB", "evaluations", "error", "rms")
    cells = [
        (
            line.command, line.version,
            *("–" if value is None else figure(value) for value in (
                line.cpu, line.wall, line.work, line.peak, line.evaluations, line.error, line.rms)),
        )
        for line in now
    ]  # fmt: skip
    words = risen(earlier, now)
    text = [f"The fastest of {options.repeats} runs, {kind_of_machine()}.", markdown(header, cells, 2)]
    ended = finish([*text, *(f"Risen: {word}" for word in words)], options)
    return 1 if options.check and words else ended


if __name__ == "__main__":
    sys.exit(main())
