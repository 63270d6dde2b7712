"""What cannot be used ends with exit code 2 and one line that names it, and leaves nothing behind."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from homofact import __version__
from homofact.cli.main import main

MATERIAL = "material:phong-10"
CORNELL = "# a paint\n2\n400 700\n0.1 0.0 0.2 3.0 0.5 0.5\n"

# Arguments, with {here} for an empty folder, and what the one line must say.
FIT, COMPARE, INFO = ["factorize", MATERIAL], ["compare", MATERIAL], ["info", MATERIAL]
DRAW, OUT, PNG = ["render", "{here}"], ["--out", "{here}/o"], ["--out", "{here}/a.png"]
CASES = {
    "missing file": (["info", "{here}/none.brdf"], r"none\.brdf.*expected"),
    "missing file to fit": (["factorize", "{here}/none.brdf", *OUT], r"none\.brdf.*expected"),
    "a name of two lines": (["info", "{here}/a\nb"], r"/a b.*expected"),
    "folder as a source": (["info", "{here}"], r"expected"),
    "unknown material": (
        ["info", "material:lafortune-blue-pant"],
        r"lafortune-blue-pant.*lafortune-blue-paint",
    ),
    "no source": (["factorize", *OUT], r"SOURCE: none given, expected a file or material:NAME"),
    "no folder": ([*FIT], r"out: none given, expected a folder"),
    "size 1": ([*FIT, "--size", "1", *OUT], r"size: found 1, expected .* at least 2"),
    "no textures": ([*FIT, "--textures", "0", *OUT], r"textures: found 0, expected"),
    "negative smoothing": ([*COMPARE, "--smoothing", "-1"], r"smoothing: found -1\.0, expected"),
    "zero epsilon": ([*COMPARE, "--epsilon", "0"], r"epsilon: found 0\.0, expected"),
    "an epsilon by another name": (
        [*COMPARE, "--epsilon", "noise"],
        r"epsilon: found 'noise', expected a number above 0, or fl",
    ),
    "gains of another kind": (
        [*FIT, "--calibrate", "ring", *OUT],
        r"calibrate: found 'ring', expected one of auto, none, tilt, rings, rows",
    ),
    "gains twice": ([*FIT, "--calibrate", "rows+rows", *OUT], r"calibrate: found rows, rows, expected no repeats"),
    "gains of a model": (
        [*FIT, "--calibrate", "rings", *OUT],
        r"calibrate: material:phong-10 can be evaluated anywher",
    ),
    "a model clipped": ([*INFO, "--clipped", "0.5"], r"clipped: material:phong-10 can be evaluated anywhere, expected"),
    "clipped at nothing": (
        [*INFO, "--clipped", "0"],
        r"clipped: found 0\.0, expected a number above 0",
    ),
    "clipped by no name": ([*INFO, "--clipped", "yes"], r"clipped: found 'yes', expected a number above 0, or found"),
    "gains of few samples": (
        ["info", "{paint}", "--calibrate", "rows"],
        r"calibrate: found 30 samples, expected at le",
    ),
    "nothing is clipped": (["info", "{paint}", "--clipped", "found"], r"clipped: no channel has its largest value 3 t"),
    "a level too high": (["factorize", "{paint}", "--clipped", "9e9", *OUT], r"clipped: no value is 9e\+09 or"),
    "a word for a number": ([*FIT, "--smoothing", "x", *OUT], r"'--smoothing': expected a number \(see"),
    "no restarts": ([*COMPARE, "--restarts", "0"], r"restarts: found 0, expected"),
    "no samples": ([*COMPARE, "--count", "0"], r"count: found 0, expected a whole number from 1 to 10000000"),
    "too many samples": ([*COMPARE, "--count", "1000000000"], r"count: found 1000000000, expected a whole number"),
    "a seed beyond all": ([*COMPARE, "--seed", str(2**64)], r"seed: found 18446744073709551616, expected"),
    "a pipe as a source": (["info", "{pipe}"], r"cannot be read \(a pipe or a device\), expected a BRDF file"),
    "a device as a source": (["info", "/dev/zero"], r"/dev/zero: cannot be read \(a pipe or a device\)"),
    "a full device as a configuration": ([*INFO, "-c", "/dev/full"], r"/dev/full: cannot be read \(a pipe or a d"),
    "negative subset": ([*COMPARE, "--subset", "-1"], r"subset: found -1, expected a whole number of at least 0"),
    "unknown metric": (
        [*COMPARE, "--metrics", "psrn"],
        r"metrics: found 'psrn', expected six, all, or some of log_mse",
    ),
    "too few samples": ([*COMPARE, "--count", "2"], r"too few to hold out"),
    "all held out": ([*COMPARE, "--held-out", "1"], r"held_out: found 1\.0, expected at least 0 and below 1"),
    "unknown solver": ([*COMPARE, "--solver", "magic"], r"solver: found 'magic', expected one of .*qmr"),
    "unknown coordinates": ([*COMPARE, "--coordinates", "x"], r"coordinates: found 'x', expected .*half-diff"),
    "unknown projections": ([*COMPARE, "--projections", "x"], r"projections: found 'x', expected one of wi, .*"),
    "a setting of another method": (
        [*FIT, "--method", "mccool", "--budget", "60", "--decomposition", "normalized", "--search", "powell", *OUT],
        r"search: mccool has no such setting, expected one of its own \(projections, size, .*seed\); search has it",
    ),
    "no algorithm of nlopt's": ([*FIT, "--search", "nlopt-FOO", *OUT], r"search: found 'nlopt-FOO', expected behind"),
    "no effort": ([*FIT, "--effort", "0", *OUT], r"effort: found 0\.0, expected quick, normal, thorough, or a number"),
    "an effort by no name": ([*FIT, "--effort", "some", *OUT], r"effort: found 'some', expected quick, normal"),
    "a misspelt effort": ([*FIT, "--effort", "quik", *OUT], r"effort: found 'quik', expected .* \(nearest: quick\)"),
    "unknown scheme": ([*INFO, "--scheme", "x"], r"scheme: found 'x', expected .*discs"),
    "unknown channels": ([*INFO, "--channels", "x"], r"channels: found 'x', expected rgb.*luminance"),
    "no such spectrum": ([*INFO, "--channels", "spectral"], r"spectral.*expected"),
    "negative seed": ([*COMPARE, "--seed", "-1"], r"seed: found -1, expected"),
    "unknown method": ([*COMPARE, "--methods", "mccool,col"], r"method: found 'col', expected .* \(nearest: cole\)"),
    "unknown method to fit": (
        [*FIT, "--method", "magic", *OUT],
        r"method: found 'magic', expected one of .*cole, mccool",
    ),
    "no methods": ([*COMPARE, "--methods", ","], r"methods: found none, expected at least one"),
    "unknown projection": ([*COMPARE, "--methods", "mccool:hh"], r"projections: found 'hh', expected"),
    "projections for cole": (
        [*FIT, "--method", "cole:wi+h", *OUT],
        r"method: found 'cole:wi\+h', expected projections behind mccool only",
    ),
    "searched projections for mccool": (
        [*FIT, "--method", "mccool", "--projections", "half-diff", *OUT],
        r"projections: found 'half-diff', expected one of wi, wo, .*theta_i$",
    ),
    "plot of no kind": ([*COMPARE, "--plot", "{here}/figure"], r"figure: ends in nothing, expected \.png"),
    "plot in a file": ([*COMPARE, "--plot", "/dev/null/a.png"], r"/dev/null is a file, expected a folder"),
    "result in a file": ([*FIT, "--out", "/dev/null/o"], r"/dev/null.*expected"),
    "result in a closed place": ([*FIT, "--out", "/proc/homofact/o"], r"/proc.*cannot be written"),
    "result that is a file": ([*FIT, "--out", "{file}"], r"expected a folder"),
    "no such format": (["export", "{here}", "--out", "{here}/o", "--format", "jpg"], r"format: found 'jpg', expected"),
    "a measurement to export": (
        ["export", "{paint}", "--out", "{here}/x"],
        r"paint\.csv: is a measurement, expected a saved fit \(fit it first",
    ),
    "a measurement to view": (
        ["view", "{paint}", "--out", "{here}/a.html"],
        r"paint\.csv: is a measurement, expected a saved fit \(fit it first",
    ),
    "a material to view": (
        ["view", "material:phong-10", "--out", "{here}/a.html"],
        r"material:phong-10: is a material, expected a saved fit \(fit it first: homofact factorize material:phong-10",
    ),
    "no result to draw": (["render", "{here}/none", *PNG], r"none: no such file"),
    "a folder without a result": ([*DRAW, *PNG], r"found no factorization\.npz"),
    "no picture": ([*DRAW], r"out: none given, expected a picture's file"),
    "a light of two": ([*DRAW, "--light", "1,2", *PNG], r"light: found '1,2', expected"),
    "a light of zero": ([*DRAW, "--light", "0,0,0", *PNG], r"light: .*not zero"),
    "two lights": (
        [*DRAW, "--light", "0,0,1", "--environment", "e.hdr", *PNG],
        r"light: found beside an environment",
    ),
    "a picture of a wrong kind": (
        [*DRAW, "--out", "{here}/a.gif"],
        r"a\.gif: ends in '\.gif', expected \.png",
    ),
    "missing configuration": ([*INFO, "-c", "{here}/none.toml"], r"none\.toml: no such file"),
    "unknown option": ([*INFO, "--texturs", "2"], r"No such option: --texturs.*info --help"),
    "near option": ([*FIT, "--texture", "2"], r"--textures"),
    "option of a wrong type": ([*FIT, "--size", "big"], r"--size.*expected a whole number"),
    "option without a value": ([*FIT, "--size"], r"--size.*requires an argument"),
    "unknown command": (["factorise", MATERIAL], r"factorise"),
    "argument too many": (["render", MATERIAL, "b"], r"unexpected extra argument"),
    "no result named": (["render"], r"Missing argument.*RESULT"),
}


@pytest.mark.parametrize(("arguments", "expected"), CASES.values(), ids=CASES)
def test_one_line_names_what_is_wrong(
    arguments: list[str],
    expected: str,
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = tmp_path_factory.mktemp("beside") / "file.txt"
    file.write_text("mine")
    pipe = tmp_path_factory.mktemp("pipes") / "pipe"
    os.mkfifo(pipe)
    paint = pipe.with_name("paint.csv")
    few = [f"{theta},0,{theta + 5},180,0.1,0.{theta},0.3" for theta in range(10, 70, 2)]
    paint.write_text("\n".join(["# isotropic: true", "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,R,G,B", *few]) + "\n")
    code = main([each.format(here=tmp_path, file=file, pipe=pipe, paint=paint) for each in arguments])
    out, err = capsys.readouterr()
    assert (code, out) == (2, "")
    assert re.fullmatch(r"homofact: [^\n]+\n", err), err
    assert re.search(expected, err, re.IGNORECASE), err
    assert list(tmp_path.iterdir()) == []
    assert [path.name for path in file.parent.iterdir()] == ["file.txt"]
    assert file.read_text() == "mine"


EARLY = [
    "result in a closed place", "result in a file", "result that is a file", "no folder", "size 1", "unknown method",
    "unknown method to fit", "unknown projection", "projections for cole", "plot in a file", "plot of no kind",
    "missing file", "missing file to fit", "folder as a source", "no result to draw", "a folder without a result",
    "a setting of another method", "unknown coordinates", "unknown solver",
    "unknown scheme", "unknown channels", "negative seed", "all held out", "no effort", "no such format",
    "searched projections for mccool", "no algorithm of nlopt's",
]  # fmt: skip


@pytest.fixture(scope="module")
def early(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, str, list[str]]]:
    """What every case of EARLY ends with in one fresh process: exit code, stderr, and what it has loaded by then."""
    place = tmp_path_factory.mktemp("early")
    (place / "file").touch()
    commands = {case: [each.format(here=place, file=place / "file") for each in CASES[case][0]] for case in EARLY}
    program = f"""
import contextlib, io, json, sys
from homofact.cli.main import main
found = {{}}
for case, arguments in {commands!r}.items():
    with contextlib.redirect_stderr(io.StringIO()) as said:
        code = main(arguments)
    found[case] = (code, said.getvalue(), [name for name in ("torch", "scipy", "numba") if name in sys.modules])
print(json.dumps(found))
"""
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return json.loads(ran.stdout)


@pytest.mark.parametrize("case", EARLY)
def test_what_can_be_known_before_the_work_is_said_before_torch_is_loaded(
    case: str, early: dict[str, tuple[int, str, list[str]]]
) -> None:
    code, said, loaded = early[case]
    assert (code, loaded) == (2, [])
    assert re.search(CASES[case][1], said, re.IGNORECASE), said


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("0.1 0.0 0.2 3.0 0.5", r"line 5: 5 columns, expected 6"),
        ("0.1 0.0 0.2 3.0 0.5 nan", r"line 5"),
        ("0.1 0.0 0.2 3.0 0.5 -0.5", r"line 5"),
        ("1.7 0.0 0.2 3.0 0.5 0.5", r"line 5"),
    ],
)
def test_a_bad_row_of_a_measurement_is_named(
    row: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "paint.brdf"
    path.write_text(CORNELL + row + "\n")
    assert main(["factorize", str(path), "--out", str(tmp_path / "o")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(rf"homofact: {re.escape(str(path))}[^\n]+\n", err), err
    assert re.search(expected, err), err
    assert [each.name for each in tmp_path.iterdir()] == ["paint.brdf"]


def test_a_strange_folder_is_refused_even_by_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "letters.txt").write_text("mine")
    for force in ([], ["--force"]):
        assert main(["factorize", MATERIAL, "--out", str(tmp_path), *force]) == 2
        assert "letters.txt" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["letters.txt"]


def test_an_unknown_key_of_a_configuration_names_the_nearest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.toml"
    path.write_text("[fit]\ncoordinate = 'in-out'\n")
    assert main(["factorize", MATERIAL, "-c", str(path), "--out", str(tmp_path / "o")]) == 2
    expected = f"homofact: {path}: fit.coordinate: unknown key (nearest: fit.coordinates)\n"
    assert capsys.readouterr().err == expected
    assert [each.name for each in tmp_path.iterdir()] == ["run.toml"]


def test_version_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"homofact {__version__}\n"
    for arguments in ([], ["--help"], ["-h"]):
        assert main(arguments) == 0
        assert "factorize" in capsys.readouterr().out
