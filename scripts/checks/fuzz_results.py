"""Open damaged results: each must raise a BadInput of one line, or work.

    python scripts/checks/fuzz_results.py [--count 20000] [--seed 0] [--kind npz manifest toml scene ledger]

From whole files of each kind it makes `count` damaged ones that know the format: an entry of a header, a manifest or a
table replaced by what nobody means, lost, or put elsewhere; an array of another type, shape or size, with numbers that
are none; archives whose directory lies; textures cut, exchanged for pipes or gone; and damage to any byte. What opens
is used: a fit evaluates to finite values, describes itself, and every 64th is exported and shown in a page.
Wrong is any other exception, a message of several lines or without the file's name, values that are not finite, over
5 s of the process's time, and memory above four times the file plus 300 MB.
"""

import io
import json
import math
import os
import random
import shutil
import sys
import tempfile
import time
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

import homofact
from homofact.brdf.source import open_source
from homofact.config import load_config
from homofact.containers.formats import format_named
from homofact.errors import BadInput
from homofact.evaluation.chart import plan, run_chart
from homofact.evaluation.chart_ledger import ChartLedger
from homofact.evaluation.reopening import NotReopened, reopen, settings_of
from homofact.exporting.exported import exported, write_exported
from homofact.exporting.result import open_result
from homofact.factor.fitted import Fitted
from homofact.geometry.directions import draw_cosine_weighted
from homofact.planning.scene import read_scene
from homofact.web.page import write_view

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.checks.fuzzing import DAMAGES, Bounds, Tally, attempt, give_back_freed_memory, options, tell

SECONDS = 5.0
SLACK = 300 * 2**20
ROOT = Path(__file__).resolve().parents[2]
PAIRS = draw_cosine_weighted(40, torch.Generator().manual_seed(0))


@dataclass(frozen=True)
class Kind:
    """A kind of file: how a damaged one is put at a path, and what is done with it (`use`, with its number)."""

    name: str
    put: Callable[[random.Random, Path], None]
    use: Callable[[Path, int], None]


def small_fits() -> list[Fitted]:
    """Fits that between them have everything that is saved."""
    paint = homofact.read("material:lafortune-blue-paint", count=300)
    brushed = homofact.read("material:ward-brushed", count=300)
    methods = (
        (paint, homofact.McCool(size=4, quantize="png8")),
        (paint, homofact.Search(size=4, textures=2, effort=2, search_samples=100, confidence=True)),
        (paint, homofact.Search(size=4, textures=2, effort=2, search_samples=100, projections=("in-out", "half-diff"))),
        (brushed, homofact.Search(size=4, textures=1, effort=2, search_samples=100, projections=("theta_h-phi_h",))),
        (paint, homofact.Svd(size=4, textures=2)),
        (paint, homofact.Nmf(size=4, textures=2, coordinates="half-diff")),
    )
    return [homofact.fit(source, method).factorization for source, method in methods]


ABSURD: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, -5, 2, 3, 7, 255, 65535, 2**31, 2**63, 10**18, 10**400, 0.0, -0.0, 0.5, 1e-320, 1e-9,
    1e30, 1e300, math.nan, math.inf, -math.inf, "", "a", "R", "h", "searched", "in-out", "half-diff", "theta_h-phi_h",
    "parabolic", "mccool", "../../etc/passwd", "/etc/passwd", "/dev/zero", "a\0b", "\ud800", "\u202e", "x" * 5000, "٣",
    [], [[]], {}, [0], [1, 2, 3], [None], ["R", "R"], ["R"], {"a": 1}, [1e308] * 4, ["clamped", "clamped"],
    "homofact factorization", "homofact export",
)  # fmt: skip


WORDS = (
    "{x=1}", "[]", "[1]", "1e400", "nan", "inf", "-0", "9" * 400, "'a\\u0000'", '"\\u0000"', "''", "true",
    "0x7fffffffffffffff", "1979-05-27", "[[[[]]]]", "99999999999999999",
)  # fmt: skip


def places_of(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths to all entries of a JSON value."""
    found = [path] if path else []
    if isinstance(value, dict | list):
        for key, each in value.items() if isinstance(value, dict) else enumerate(value):
            found += places_of(each, (*path, key))
    return found


def json_damaged(value: Any, dice: random.Random) -> Any:
    """The value with one to three entries replaced, lost, doubled, exchanged or nested deeply."""
    value = json.loads(json.dumps(value))
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        places = places_of(value)
        if not places:
            return value
        # Entries near the top decide more than the numbers of a matrix.
        place = min(dice.sample(places, min(len(places), 3)), key=len)
        inner = value
        for key in place[:-1]:
            inner = inner[key]
        last, how = place[-1], dice.random()
        if how < 0.7:
            inner[last] = dice.choice(ABSURD)
        elif how < 0.8:
            del inner[last]
        elif how < 0.9:
            other = dice.choice(places)
            found = value
            try:
                for key in other:
                    found = found[key]
            except (KeyError, IndexError, TypeError):
                continue
            inner[last] = json.loads(json.dumps(found))
        elif how < 0.95 and isinstance(inner[last], list):
            inner[last] = inner[last] * dice.choice((2, 50))
        else:
            for _ in range(dice.choice((20, 120, 2000))):
                inner[last] = [inner[last]]
                if dice.random() < 0.01:
                    break
            try:
                json.dumps(value)
            except RecursionError:
                inner[last] = "deep"
    return value


def array_damaged(array: np.ndarray, dice: random.Random) -> np.ndarray:
    """The array of another type, shape or order, or with numbers that are none."""
    how = dice.randrange(8)
    if how == 0 and array.dtype.kind == "U":
        return np.array(3)
    if how == 0:
        return array.astype(dice.choice(("f4", "f2", ">f8", "i8", "u1", "bool")), copy=True)
    if how == 1:
        return array.reshape(-1)
    if how == 2:
        return array[..., None] if dice.random() < 0.5 else array.T.copy()
    if how == 3:
        return array[:0] if array.ndim else np.zeros(3)
    if how == 4:
        return np.concatenate([array] * 2) if array.ndim else array.reshape(1, 1)
    if how == 5:
        return np.array(dice.choice(("text", 3, math.nan, True)))
    changed = array.copy()
    if changed.dtype.kind == "f" and changed.size:
        flat = changed.reshape(-1)
        for _ in range(dice.choice((1, 3))):
            flat[dice.randrange(flat.size)] = dice.choice(
                (math.nan, math.inf, -math.inf, 1e308, -1e308, 1e40, 1e-320, 0.0, -1.0, 1e20, -1e20, 1000.0)
            )
        if dice.random() < 0.2:
            flat[:] = dice.choice((0.0, math.nan, 1e308, -1.0))
    return changed


def member(array: np.ndarray, dice: random.Random) -> bytes:
    """An .npy member, its header rarely a lie."""
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array, version=(1, 0), allow_pickle=False)
    data = buffer.getvalue()
    if dice.random() < 0.1:
        lie = dice.choice((b"(10000000000000,)", b"(-1,)", b"(99, 99999999999)", b"()", b"(2, 2, 2, 2, 2)", b"(True,)"))
        begin, end = data.index(b"'shape': ") + 9, data.index(b"), }") + 1
        return data[:begin] + lie.ljust(end - begin) + data[end:] if len(lie) <= end - begin else data[:begin] + lie
    return data


def npz_damaged(arrays: dict[str, np.ndarray], dice: random.Random) -> bytes:
    """An archive of a fit with damage to its header, its arrays, its directory or any byte."""
    arrays = dict(arrays)
    how = dice.random()
    if how < 0.45:
        header = json.loads(str(arrays["header"]))
        text = json.dumps(json_damaged(header, dice))
        arrays["header"] = np.array(text if dice.random() < 0.97 else "[" * 100_000)
    elif how < 0.85:
        for _ in range(dice.choice((1, 1, 2))):
            name = dice.choice(list(arrays))
            what = dice.random()
            if what < 0.75:
                arrays[name] = array_damaged(arrays[name], dice)
            elif what < 0.87 and len(arrays) > 1:
                del arrays[name]
            else:
                arrays[dice.choice(("texture_0", "texture_9", "mask_0", "second_0", "grid_0", "rotation_0", "x"))] = (
                    arrays[name]
                )
    buffer = io.BytesIO()
    packing = (
        zipfile.ZIP_STORED if how < 0.85 else dice.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2))
    )
    with zipfile.ZipFile(buffer, "w", packing) as archive:
        for name, array in arrays.items():
            archive.writestr(f"{name}.npy", member(array, dice) if how < 0.95 else member(array, random.Random(1)))
        if how > 0.99:
            archive.writestr("unused.npy", bytes(dice.choice((10, 80 * 2**20))), compress_type=zipfile.ZIP_DEFLATED)
    raw = bytearray(buffer.getvalue())
    if 0.85 <= how < 0.9:
        # The directory's flags, methods and sizes.
        place = bytes(raw).find(b"PK\x01\x02", dice.randrange(len(raw)))
        if place >= 0:
            offset, size = dice.choice(((8, 2), (10, 2), (16, 4), (20, 4), (24, 4), (42, 4)))
            raw[place + offset : place + offset + size] = dice.choice((1, 8, 2**16 - 1, 2 ** (8 * size) - 1)).to_bytes(
                8, "little"
            )[:size]
    if how >= 0.9:
        return dice.choice(DAMAGES)(raw, dice)
    return bytes(raw)


def use_fit(fitted: Fitted, folder: Path, number: int) -> None:
    """Everything that is done with a result, the dear things to every 64th."""
    # Where every texel is as it was read, what comes out is finite.
    values = fitted.evaluate(*PAIRS)
    if not bool(torch.isfinite(values).all()) or bool((values < 0).any()):
        raise ArithmeticError("values that are not finite")
    fitted.describe()
    settings_of(fitted)
    if number % 64:
        return
    try:
        reopen(fitted, None, (folder,))
    except NotReopened as error:
        if any(ord(letter) < 32 for letter in str(error)):
            raise ArithmeticError("a reason of several lines") from error
    for act in (
        lambda: write_exported(folder / "out", exported(fitted, format_named("png8")), {}, force=True),
        lambda: write_view(fitted, folder / "page.html", near=(folder,)),
    ):
        # What a format or a page cannot show may be refused, by the file's name or not.
        try:
            act()
        except BadInput as error:
            if "\n" in str(error):
                raise ArithmeticError("a message of several lines") from error


def texts(wholes: list[bytes]) -> Callable[[random.Random, Path], None]:
    """What puts a damaged one of some text files at a path: values that nobody means, deep keys, damage to any byte."""

    def put(dice: random.Random, path: Path) -> None:
        raw = dice.choice(wholes)
        lines = raw.split(b"\n")
        for _ in range(dice.choice((1, 1, 2))):
            if dice.random() < 0.6:
                place = dice.randrange(len(lines))
                key, mark, _ = lines[place].partition(b"=")
                value = dice.choice(WORDS)
                lines[place] = key + b"= " + value.encode() if mark else lines[place]
            elif dice.random() < 0.5:
                lines.insert(dice.randrange(len(lines)), b".".join([b"a"] * dice.choice((2, 100))) + b" = 1")
        path.write_bytes(b"\n".join(lines))
        if dice.random() < 0.3:
            path.write_bytes(dice.choice(DAMAGES)(bytearray(raw), dice))

    return put


def kinds(folder: Path) -> list[Kind]:
    """All kinds with their whole files."""
    fits = small_fits()
    archives = []
    for fitted in fits:
        fitted.save(folder / "whole.npz")
        with np.load(folder / "whole.npz") as found:
            archives.append({name: found[name] for name in found.files})
    whole = []
    for k, (fitted, form) in enumerate(zip(fits, ("exr", "png8", "ktx2", "dds", "exr16", "png16"), strict=True)):
        write_exported(folder / f"export_{k}", exported(fitted, format_named(form)), {"errors": {}})
        whole.append(folder / f"export_{k}")
    tomls = [path.read_bytes() for path in sorted((ROOT / "configs").glob("*.toml"))]
    scenes = [path.read_bytes() for path in sorted((ROOT / "configs" / "scenes").glob("*.toml"))]
    source = open_source("material:phong-10", count=300)
    run_chart(source, plan({"mccool": homofact.McCool()}, (1,), (3, 4), ("gradient",)), ChartLedger(folder / "a.csv"))
    ledger = (folder / "a.csv").read_bytes()

    def put_npz(dice: random.Random, path: Path) -> None:
        path.write_bytes(npz_damaged(dice.choice(archives), dice))

    def put_manifest(dice: random.Random, path: Path) -> None:
        shutil.rmtree(path, ignore_errors=True)
        shutil.copytree(dice.choice(whole), path, copy_function=os.link)
        manifest = path / "manifest.json"
        raw = manifest.read_bytes()
        manifest.unlink()
        if dice.random() < 0.8:
            text = json.dumps(json_damaged(json.loads(raw), dice), ensure_ascii=dice.random() < 0.5)
            manifest.write_bytes(text.encode(errors="surrogatepass"))
            return
        manifest.write_bytes(raw if dice.random() < 0.8 else dice.choice(DAMAGES)(bytearray(raw), dice))
        texture = dice.choice([each for each in path.iterdir() if each.name.startswith("texture")])
        data = texture.read_bytes()
        texture.unlink()
        how = dice.randrange(8)
        if how == 0:
            os.mkfifo(texture)
        elif how == 1:
            texture.mkdir()
        elif how == 2:
            texture.symlink_to("/dev/zero")
        elif how > 3:
            texture.write_bytes(dice.choice(DAMAGES)(bytearray(data), dice))

    return [
        Kind("npz", put_npz, lambda path, number: use_fit(open_result(path), folder / "used", number)),
        Kind("manifest", put_manifest, lambda path, number: use_fit(open_result(path), folder / "used", number)),
        Kind("toml", texts(tomls), lambda path, _: use_config(path)),
        Kind("scene", texts(scenes), lambda path, _: use_scene(path)),
        Kind("ledger", texts([ledger]), lambda path, _: use_ledger(path)),
    ]


def use_config(path: Path) -> None:
    """What every command does with a configuration."""
    load_config(path)


def use_scene(path: Path) -> None:
    """What `homofact plan` does with a scene before anything is sampled."""
    read_scene(path)


def use_ledger(path: Path) -> None:
    """What `homofact compare --chart` does with the CSV that is there."""
    len(ChartLedger(path))


def size_of(path: Path) -> int:
    """Bytes of a file, or of all files in a folder."""
    files = [path] if path.is_file() else [each for each in path.rglob("*") if each.is_file()]
    return sum(each.stat().st_size for each in files)


def fuzz(kind: Kind, count: int, seed: int, folder: Path) -> Tally:
    """`count` damaged files of a kind, every eighth with its memory traced."""
    dice = random.Random(f"{seed} {kind.name}")
    tally = Tally()
    (folder / "used").mkdir(exist_ok=True)
    path = folder / "damaged" / ("fit.npz" if kind.name == "npz" else kind.name)
    path.parent.mkdir(exist_ok=True)
    for number in range(count):
        with np.errstate(all="ignore"):
            kind.put(dice, path)
        bounds = Bounds(SECONDS, SLACK)
        wrong = attempt(
            lambda own=number: kind.use(path, own) or "", path, size_of(path), bounds, tally, traced=number % 8 == 1
        )
        if wrong:
            tally.wrong.append((wrong, (path if path.is_file() else path / "manifest.json").read_bytes()))
    return tally


def run(arguments: list[str] | None, doc: str | None, names: str, made: Callable[[Path], list[Kind]]) -> int:
    """Fuzz the kinds that are asked for of those `made` in a folder, a line each. Returns 1 where any went wrong."""
    asked = options(doc, names, "kind").parse_args(arguments)
    give_back_freed_memory()
    failed = 0
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        folder = Path(name)
        found = [each for each in made(folder) if not asked.kind or each.name in asked.kind]
        warnings.simplefilter("error")
        for kind in found:
            begun = time.perf_counter()
            tally = fuzz(kind, asked.count, asked.seed, folder)
            failed += tell(kind.name, tally, time.perf_counter() - begun, asked.keep)
    return 1 if failed else 0


def main(arguments: list[str] | None = None) -> int:
    """Run the fuzzing and print a line a kind. Returns 1 where anything was wrong."""
    return run(arguments, __doc__, "npz, manifest, toml, scene, ledger", kinds)


if __name__ == "__main__":
    sys.exit(main())
