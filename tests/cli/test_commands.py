"""The four commands on small problems: what they print, what they leave, and how they end."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from ran import Ran
from rgl_files import rough, write_tensors

import homofact
from homofact.cli.main import main
from homofact.containers.exr import write_exr

ROOT = Path(__file__).resolve().parents[2]
METRICS = {"log_mse", "log_mae", "log_max", "mse", "mae", "max"}
RECORD = {
    "source", "method", "textures", "size", "bytes", "fetches", "samples", "status", "evaluations", "seed",
    "seconds", "error",
}  # fmt: skip
# A source and a fit of well under a second.
SMALL = ["material:blinn-phong-50", "--count", "600"]
SIZE = ["--size", "6"]
FAST = [
    "--size", "6", "--textures", "1", "--restarts", "1", "--search-size", "4", "--search-samples", "200",
]  # fmt: skip


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results") / "deep" / "blinn"
    assert main(["factorize", *SMALL, *FAST, "--method", "cole", "--out", str(folder), "--seed", "3", "-q"]) == 0
    return folder


def check_record(record: dict[str, Any]) -> None:
    assert set(record) >= RECORD
    assert set(record["seconds"]) == {"read", "fit", "total"}
    assert set(record["error"]) == {"train", "held_out"}
    for errors in record["error"].values():
        assert set(errors) == METRICS
        assert all(value >= 0 for value in errors.values())


@pytest.mark.slow
def test_factorize_leaves_the_whole_result(result: Path) -> None:
    found = {path.name for path in result.iterdir()}
    assert found >= {
        "factorization.npz", "manifest.json", "report.json", "compare.png", "texture_0.exr", "texture_0.png",
    }  # fmt: skip
    assert [path.name for path in result.parent.iterdir()] == ["blinn"]
    record = json.loads((result / "report.json").read_text())
    check_record(record)
    check_record(record["mccool"])
    assert (record["method"], record["mccool"]["method"]) == ("cole", "mccool")
    assert (record["size"], record["textures"], record["seed"], record["samples"]) == (6, 1, 3, 600)
    loaded = homofact.load(str(result / "factorization.npz"))
    up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    assert bool((loaded.evaluate(up, up) > 0).all())


def test_factorize_prints_a_summary_of_80_columns(
    run: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    ran = run("factorize", *SMALL, *FAST, "--method", "cole", "--out", tmp_path / "o")
    assert (ran.code, ran.err) == (0, "")
    assert "cole" in ran.out
    assert "McCool" in ran.out
    assert "held out" in ran.out
    assert "log mse" in ran.out
    assert "converged" in ran.out
    assert str(tmp_path / "o" / "compare.png") in ran.out
    # What was made and the verdict come first, then the evidence, and last what to do.
    parts = ("1 texture of 6²", "Verdict:", "The picture:", "Error (", "Cost", "Figures of the verdict:", "Try next:")
    places = [ran.out.index(part) for part in parts]
    assert places == sorted(places)
    assert all(len(line) <= 80 for line in ran.out.splitlines() if str(tmp_path) not in line)


@pytest.mark.slow
def test_json_is_one_object_and_the_same_as_the_report(run: Callable[..., Ran], tmp_path: Path) -> None:
    ran = run("factorize", *SMALL, *SIZE, "--method", "mccool", "--out", tmp_path / "o", "--json")
    assert (ran.code, ran.err) == (0, "")
    record = json.loads(ran.out)
    check_record(record)
    assert record == json.loads((tmp_path / "o" / "report.json").read_text())
    # The fit is McCool's own already: there is nothing to set it beside.
    assert "mccool" not in record


@pytest.mark.slow
def test_quiet_says_nothing(run: Callable[..., Ran], tmp_path: Path) -> None:
    assert run("factorize", *SMALL, *SIZE, "--method", "mccool", "--out", tmp_path / "o", "-q") == (0, "", "")


@pytest.mark.slow
def test_a_second_result_needs_force_and_force_replaces(run: Callable[..., Ran], tmp_path: Path) -> None:
    command = ["factorize", *SMALL, *SIZE, "--method", "mccool", "--out", tmp_path / "o", "-q"]
    assert run(*command).code == 0
    before = (tmp_path / "o" / "factorization.npz").read_bytes()
    again = run(*command, "--size", "8")
    assert again.code == 2
    assert "expected a new folder or --force" in again.err
    assert (tmp_path / "o" / "factorization.npz").read_bytes() == before
    assert run(*command, "--size", "8", "--force").code == 0
    assert (tmp_path / "o" / "factorization.npz").read_bytes() != before


@pytest.mark.slow
def test_the_same_seed_gives_the_same_fit_and_another_one_does_not(run: Callable[..., Ran]) -> None:
    def errors(seed: int) -> Any:
        ran = run("compare", *SMALL, *FAST, "--methods", "cole", "--seed", seed, "--json")
        return json.loads(ran.out)["rows"][0]["error"]

    assert errors(1) == errors(1) != errors(2)


@pytest.mark.slow
def test_compare_gives_a_row_for_each_method_and_a_figure(
    run: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    methods = "mccool,mccool:theta_h-theta_d,cole"
    ran = run("compare", *SMALL, *FAST, "--methods", methods, "--plot", tmp_path / "f" / "errors.svg")
    assert ran.code == 0
    for word in ("mccool", "cole", "held out", "training", "log mae", "max", "bytes", "fetches", "total s"):
        assert word in ran.out
    assert all(len(line) <= 80 for line in ran.out.splitlines())
    assert "…" not in ran.out
    assert "<svg" in (tmp_path / "f" / "errors.svg").read_text()
    assert [path.name for path in (tmp_path / "f").iterdir()] == ["errors.svg"]
    answer = json.loads(run("compare", *SMALL, *FAST, "--methods", methods, "--json").out)
    assert [row["label"] for row in answer["rows"]] == methods.split(",")
    assert [row["method"] for row in answer["rows"]] == ["mccool", "mccool", "cole"]
    assert [row["textures"] for row in answer["rows"]] == [2, 1, 1]
    for row in answer["rows"]:
        check_record(row)
    assert answer["rows"][0]["error"] != answer["rows"][1]["error"]


def test_info_says_what_is_there(run: Callable[..., Ran]) -> None:
    ran = run("info", *SMALL)
    assert (ran.code, ran.err) == (0, "")
    assert "600" in ran.out
    facts = json.loads(run("info", *SMALL, "--json").out)
    assert (facts["samples"], facts["channels"], facts["kind"]) == (600, ["R", "G", "B"], "material")


def test_nothing_is_suspected_of_pairs_drawn_of_a_table(run: Callable[..., Ran], tmp_path: Path) -> None:
    """A table that is cut at zero, an instrument's fault in a measurement; a fit of it says nothing of it either."""
    table = rough((0.0,))
    table["rgb"] = np.where(np.arange(table["rgb"].shape[-1]) % 3, table["rgb"], -1).astype("f4")
    facts = json.loads(run("info", write_tensors(tmp_path / "cut.bsdf", table), "--count", 2000, "--json").out)
    assert (facts["kind"], "suspected" in facts) == ("drawn", False)
    assert facts["faults"]["negative_values"] > 200


@pytest.mark.parametrize(("wanted", "names"), [("luminance", ["Y"]), ("G", ["G"]), ("rgb", ["R", "G", "B"])])
def test_channels_may_be_named(run: Callable[..., Ran], wanted: str, names: list[str]) -> None:
    assert json.loads(run("info", *SMALL, "--channels", wanted, "--json").out)["channels"] == names


@pytest.mark.slow
def test_one_channel_of_a_source_is_that_column(run: Callable[..., Ran], tmp_path: Path) -> None:
    def mean(channels: str) -> Any:
        command = ["compare", *SMALL, *SIZE, "--methods", "mccool", "--channels", channels, "--json"]
        return json.loads(run(*command).out)["rows"][0]["mean"]

    assert mean("G") == {"G": mean("rgb")["G"]}
    out = tmp_path / "o"
    assert run("factorize", *SMALL, *SIZE, "--method", "mccool", "--channels", "G", "--out", out, "-q").code == 0
    assert homofact.load(str(out / "factorization.npz")).channels == ("G",)


@pytest.mark.slow
def test_light_stands_in_report_table_and_verdict(run: Callable[..., Ran], tmp_path: Path) -> None:
    out = tmp_path / "o"
    ran = run("factorize", *SMALL, *SIZE, "--method", "mccool", "--out", out)
    assert "Light, fit over source" in ran.out
    report = json.loads((out / "report.json").read_text())
    found, verdict = report["appearance"], report["verdict"]
    assert (verdict["off"], verdict["highlight"]) == (found["albedo_worst"], found["highlight"])
    assert "highlight" in {each["name"] for each in verdict["findings"]}
    assert "Of the fit:" in ran.out
    assert f"Verdict: {verdict['summary']}" in " ".join(ran.out.split())
    advice = verdict["recommended"]
    option = f"--{advice['setting']} {advice['value']}"
    assert f"Try next: the same command with {option}" in " ".join(ran.out.split())
    assert len(found["albedo_ratio"]) == len(found["degrees"]) == 5
    # A measurement is known at its samples alone: nothing is made up.
    measured = ["compare", ROOT / "data_synthetic" / "synthetic_cornell.brdf", *SIZE, "--methods", "mccool"]
    ran = run(*measured, "--json")
    row = json.loads(ran.out)["rows"][0]
    assert row["appearance"] is None
    assert row["verdict"]["source_albedo"] is None
    assert "Light, fit over source" not in run(*measured).out


def test_render_draws_a_result_under_another_light(run: Callable[..., Ran], result: Path, tmp_path: Path) -> None:
    ran = run("render", result, "--light", "-1,0.5,1", "--size", "48", "--out", tmp_path / "p" / "a.png", "--json")
    assert (ran.code, ran.err) == (0, "")
    assert json.loads(ran.out)["picture"] == str(tmp_path / "p" / "a.png")
    ran = run("render", result / "factorization.npz", "--size", "48", "--out", tmp_path / "p" / "b.png", "-q")
    assert ran == (0, "", "")
    pictures = [(tmp_path / "p" / name).read_bytes() for name in ("a.png", "b.png")]
    assert all(each.startswith(b"\x89PNG") for each in pictures)
    assert pictures[0] != pictures[1]
    assert sorted(path.name for path in (tmp_path / "p").iterdir()) == ["a.png", "b.png"]


@pytest.mark.slow
def test_render_draws_a_source_in_an_environment_at_the_exposure_asked_for(
    run: Callable[..., Ran], tmp_path: Path
) -> None:
    sky, picture = tmp_path / "sky.exr", tmp_path / "a.png"
    write_exr(sky, np.full((8, 16, 3), (0.5, 0.6, 0.9), np.float32), "RGB")
    command = ["render", "material:phong-30", "--environment", sky, "--size", "48", "--out", picture, "--json"]
    plain, brighter, clipped = (
        json.loads(run(*command, *more).out)
        for more in ([], ["--exposure", "2"], ["--exposure", "8", "--tonemap", "srgb"])
    )
    assert plain["light"] == "environment sky.exr"
    assert (plain["tonemap"], clipped["tonemap"]) == ("filmic", "srgb")
    assert brighter["exposure"] == pytest.approx(4 * plain["exposure"])
    assert (plain["clipped"], clipped["clipped"]) == (0, 1)
    measured = ROOT / "data_synthetic" / "synthetic_cornell.brdf"
    assert run("render", measured, "--size", "48", "--out", tmp_path / "b.png", "-q") == (0, "", "")


@pytest.mark.slow
def test_a_configuration_gives_what_the_command_line_does_not(run: Callable[..., Ran], tmp_path: Path) -> None:
    config = tmp_path / "run.toml"
    config.write_text(
        'seed = 4\n[source]\npath = "material:blinn-phong-50"\ncount = 500\n'
        f'[fit]\nmethod = "mccool"\nsize = 5\nsmoothing = 0.5\n[output]\nfolder = "{tmp_path / "o"}"\n'
    )
    record = json.loads(run("factorize", "-c", config, "--json").out)
    assert (record["seed"], record["samples"], record["size"], record["method"]) == (4, 500, 5, "mccool")
    record = json.loads(
        run("factorize", "-c", config, "--seed", 0, "--size", 7, "--smoothing", 0, "--force", "--json").out
    )
    assert (record["seed"], record["size"]) == (0, 7)
    loaded = homofact.load(str(tmp_path / "o" / "factorization.npz"))
    assert loaded.provenance["smoothing"] == 0.0


def environment() -> dict[str, str]:
    return {**os.environ, "TERM": "xterm", "COLUMNS": "100", "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}


PROGRAM = [sys.executable, "-m", "homofact.cli.main"]


@pytest.mark.slow
def test_a_pipe_gets_json_and_silence() -> None:
    command = [*PROGRAM, "compare", *SMALL, *FAST, "--methods", "cole", "--json"]
    ran = subprocess.run(command, capture_output=True, text=True, env=environment(), timeout=120)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert json.loads(ran.stdout)["rows"][0]["method"] == "cole"


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo-terminal")
@pytest.mark.parametrize("quiet", [False, True])
def test_a_terminal_sees_the_bar_unless_quiet(quiet: bool) -> None:
    terminal, theirs = os.openpty()
    command = [*PROGRAM, "compare", *SMALL, *FAST, "--methods", "cole", "--restarts", "3", "--json"]
    command += ["-q"] if quiet else []
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs, env=environment()) as process:
        os.close(theirs)
        assert process.stdout is not None
        seen = b""
        try:
            while part := os.read(terminal, 65536):
                seen += part
        except OSError:  # Linux's way to say that the other end is closed.
            pass
        out = process.stdout.read()
    os.close(terminal)
    assert process.returncode == 0
    assert json.loads(out)["rows"]
    if quiet:
        assert seen == b""
    else:
        assert b"term 1/1, restart" in seen
        assert b"evaluations, best" in seen


@pytest.mark.slow
def test_a_closed_pipe_is_left_quietly() -> None:
    with subprocess.Popen(
        [*PROGRAM, "info", *SMALL], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment()
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        err = process.stderr.read()
    assert (process.returncode, err) == (141, b"")


def test_help_does_not_wait_for_torch() -> None:
    code = (
        "import sys; from homofact.cli.main import main; assert main(['factorize', '--help']) == 0;"
        "slow = {'torch', 'numpy', 'scipy', 'matplotlib', 'colour'} & set(sys.modules);"
        "sys.exit(str(slow) if slow else 0)"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment())
    assert (ran.returncode, ran.stderr) == (0, "")
    assert "--textures" in ran.stdout


@pytest.mark.slow
def test_strict_and_refuse_leave_nothing_behind(run: Callable[..., Ran], tmp_path: Path) -> None:
    out = tmp_path / "o"
    asked = ["factorize", *SMALL, *SIZE, "--method", "mccool", "--out", out]
    for options, words in (
        (["--strict"], "refused because it is"),
        (["--refuse", "zeros+highlight"], "refused because of the finding highlight: the brightest directions hold"),
        (["--refuse", "zeroes"], "refuse: found 'zeroes', expected some of status, condition, light"),
    ):
        ran = run(*asked, *options)
        assert ran.code == 2
        assert words in ran.err
        assert not out.exists()
    assert run(*asked, "--refuse", "zeros+azimuth").code == 0
    assert (out / "report.json").is_file()
    ran = run("compare", *SMALL, *SIZE, "--methods", "mccool", "--strict")
    assert ran.code == 2
    assert "refused because it is" in ran.err
