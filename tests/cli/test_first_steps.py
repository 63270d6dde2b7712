"""What a newcomer meets: greeting, help in sections, named materials, the nearest name, the state of things."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from typer.main import get_command

from homofact.brdf.materials import MATERIALS
from homofact.brdf.source_names import MATERIAL_NAMES
from homofact.cli import doctor
from homofact.cli.main import COMMANDS, RESEARCH, app, main


def test_alone_it_greets_with_commands_that_exist(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    said = capsys.readouterr().out
    assert all(len(line) <= 80 for line in said.splitlines())
    named = [line.split()[1] for line in said.splitlines() if line.startswith("  homofact ")]
    assert named == ["info", "factorize", "view", "export", "compare"]
    assert main(["--help"]) == 0
    helped = capsys.readouterr().out
    for each in (*named, "research", "doctor"):
        assert f"│ {each} " in helped


def test_a_long_help_shows_everyday_options_and_all_when_asked(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["factorize", "--help"]) == 0
    short = capsys.readouterr().out
    assert main(["factorize", "--help-all"]) == 0
    whole = capsys.readouterr().out
    for name in (
        "--out",
        "--method",
        "--textures",
        "--size",
        "--bytes",
        "--effort",
        "--channels",
        "--calibrate",
        "--help-all",
    ):
        assert f"{name} " in short
    for name in ("--smoothing", "--search-samples", "--projections", "--held-out"):
        assert f"{name} " not in short
        assert f"{name} " in whole
    # A command that is short anyway hides nothing.
    assert main(["info", "--help"]) == 0
    assert "--calibrate" in capsys.readouterr().out


@pytest.mark.parametrize("command", [name for _, name, _ in COMMANDS] + [f"research {name}" for _, name, _ in RESEARCH])
def test_every_command_takes_help_all(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*command.split(), "--help-all"]) == 0
    whole = capsys.readouterr().out
    assert f"Usage: homofact {command} " in whole
    assert main([*command.split(), "-h"]) == 0
    short = capsys.readouterr().out
    if command not in ("factorize", "compare"):
        assert whole == short
        assert "--help,--help-all" in short


def test_the_help_of_all_says_the_first_sentence_of_each_command_and_loads_none(
    capsys: pytest.CaptureFixture[str],
) -> None:
    commands: Any = get_command(app)
    inner = commands.commands["research"].commands
    for panel, name, said in (*COMMANDS, *RESEARCH):
        command = inner[name] if panel == "Research" else commands.commands[name]
        assert (panel, said) == (command.rich_help_panel, command.help.split("\n\n")[0].replace("\n", " "))
    program = "import sys\nfrom homofact.cli.main import main\nassert main(['--help']) == 0\n"
    program += "assert not {f'homofact.cli.{name}' for name in sys.argv[1:]} & set(sys.modules)"
    names = [name for _, name, _ in COMMANDS]
    assert main(["research"]) == 0
    assert all(f" {name} " in capsys.readouterr().out for _, name, _ in RESEARCH[:1])
    shown = subprocess.run([sys.executable, "-c", program, *names], capture_output=True, text=True, check=True).stdout
    assert all(f" {name} " in shown for name in names)


@pytest.mark.parametrize(
    ("words", "now"),
    [
        (["chart", "material:phong-10", "--out", "charts"], "homofact compare SOURCE --chart FOLDER"),
        (["materials"], "homofact info without a source"),
        (["stability", "--short"], "homofact research stability"),
        (["terms", "material:phong-10"], "homofact research terms"),
    ],
)
def test_the_name_of_an_older_version_is_answered_with_that_of_now(
    words: list[str], now: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", f"homofact: {words[0]}: no command of this version (now: {now})\n")
    assert not list(tmp_path.iterdir())
    # What it names is a command.
    assert main([*now.split()[1:2], *(now.split()[2:3] if "research" in now else []), "--help"]) == 0


@pytest.mark.parametrize(
    ("words", "now"),
    [(["export", "fit", "--to", "engine"], "--out"), (["plan", "scene.toml", "--write", "choices"], "--out")],
)
def test_an_option_of_an_older_version_is_answered_with_its_name_now(
    words: list[str], now: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    said = capsys.readouterr()
    command, _, old, _ = words
    line = f"homofact: {old}: no option of this version, now: {now} (see homofact {command} --help)\n"
    assert (said.out, said.err) == ("", line)
    assert not list(tmp_path.iterdir())
    # What it names is an option of the command.
    assert main([command, "--help"]) == 0
    assert now in capsys.readouterr().out


def test_hidden_options_work_as_before(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["factorize", "material:phong-10", "--smoothing", "-1", "--out", "x"]) == 2
    assert "smoothing: found -1" in capsys.readouterr().err


def test_named_materials_are_listed_and_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = {name: MATERIALS[name] for name in ("phong-10", "lafortune-clay")}
    monkeypatch.setattr("homofact.brdf.materials.MATERIALS", kept)
    sheet = tmp_path / "new" / "sheet.png"
    assert main(["info", "--plot", str(sheet), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [(each["name"], each["model"]) for each in said["materials"]] == [
        ("phong-10", "Phong"), ("lafortune-clay", "Lafortune"),
    ]  # fmt: skip
    assert all(each["source"] for each in said["materials"])
    with Image.open(sheet) as picture:
        # Two spheres side by side; their middles have their own colours, which are not grey.
        middles = [picture.getpixel((14 + 190 * column + 88, 14 + 88)) for column in (0, 1)]
    assert middles[0] != middles[1]
    assert all(isinstance(each, tuple) and each[0] > each[2] + 10 for each in middles)
    assert main(["info", "--plot", str(tmp_path / "sheet.jpg")]) == 2
    assert "ends in '.jpg', expected .png" in capsys.readouterr().err


def test_a_narrow_terminal_breaks_no_name_that_one_has_to_type(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    assert main(["info"]) == 0
    said = capsys.readouterr().out
    assert all(len(line) <= 60 for line in said.splitlines())
    assert set(MATERIAL_NAMES) <= {word for line in said.splitlines() for word in line.split()[:1]}


@pytest.mark.parametrize("given", ["lafortune-blue-paint", "lafortune-bluepaint"])
def test_a_material_without_its_prefix_is_told(given: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", given]) == 2
    expected = f"homofact: {given}: no such file, expected a BRDF file or"
    assert capsys.readouterr().err.startswith(expected)


def test_the_names_that_are_known_without_torch_are_all() -> None:
    assert tuple(MATERIALS) == MATERIAL_NAMES


def test_a_file_that_is_like_no_material_is_only_missing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "measured/car.brdf"]) == 2
    assert (
        capsys.readouterr().err == "homofact: measured/car.brdf: no such file, expected a BRDF file or material:NAME\n"
    )


def test_the_doctor_tries_what_is_there(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) == 0
    states = {each["name"]: each["state"] for each in json.loads(capsys.readouterr().out)["findings"]}
    assert states["torch"] == states["nlopt"] == "installed"
    assert states["a fit"] == states["compiled kernels"] == "works"
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert set(project["optional-dependencies"]) - set(states) <= {"all", "docs"}


def test_the_doctor_names_what_fails(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def broken() -> str:
        raise ValueError("off by 3%\non a Lambertian surface")

    versions = doctor._version
    monkeypatch.setattr(doctor, "_fit", broken)
    monkeypatch.setattr(doctor, "_version", lambda name: None if name == "nlopt" else versions(name))
    assert main(["doctor"]) == 2
    said = capsys.readouterr()
    assert "ValueError: off by 3% on a" in said.out
    assert (
        said.err == "homofact: doctor: found nlopt, a fit not working, expected everything that is installed to work\n"
    )


@pytest.mark.parametrize("width", [54, 80])
def test_the_doctor_s_table_breaks_no_word_and_names_each_part_once(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    findings = [
        doctor.Diagnosis("needed", "torch", "installed", "2.13.0"),
        doctor.Diagnosis("extras", "containers", "works", "EXR, PNG and PLY files: export, environments, meshes"),
        doctor.Diagnosis("extras", "glslangValidator", "missing", "checks the exported GLSL and HLSL of environments"),
    ]
    monkeypatch.setattr(doctor, "_findings", lambda: iter(findings))
    monkeypatch.setenv("COLUMNS", str(width))
    assert main(["doctor"]) == 0
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= width
    words = said.split()
    assert words.count("extras") == 1
    assert [word for each in findings for word in " ".join(each[1:]).split() if word not in words] == []
    # As in the other tables, the state begins below the state.
    starts = {line.index(each.state) for each in findings for line in said.splitlines() if each.name in line}
    assert len(starts) == 1
    # An empty line ends each part.
    first, second = (
        said.splitlines().index(line) for line in said.splitlines() if line.split()[:1] in (["needed"], ["extras"])
    )
    assert not said.splitlines()[second - 1].strip()
    assert first < second


@pytest.mark.parametrize(
    ("command", "option", "said"),
    [
        ([], "--version", "Print the version."),
        (["info"], "--json", "Print one JSON object"),
        (["research"], "--help", ""),
    ],
)
def test_the_help_of_a_flag_asks_for_no_value(
    command: list[str], option: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command, "--help"]) == 0
    text = capsys.readouterr().out
    (line,) = [line for line in text.splitlines() if option in line]
    assert said in line
    assert "<bool>" not in text
