"""Every option reaches what it is an option of: by the command line, by TOML, and in the help with its own default."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from homofact.cli.main import app, main
from homofact.cli.options import shown_default
from homofact.config import SEED, Config, fit_options, load_config, section_options
from homofact.errors import BadInput
from homofact.methods.method import Method
from homofact.methods.table import METHODS, made, methods_with
from homofact.settings.options import Declared, options_of

# A value that is not the default, as a word of the command line and as TOML, where the type does not tell one.
OWN: dict[str, tuple[str, str]] = {
    "search.projections": ("h+half-diff", '["h", "half-diff"]'),
    "mccool.projections": ("wi+h+wo", '"wi+h+wo"'),
    "search.search": ("nlopt-PRAXIS", '"nlopt-PRAXIS"'),
    "search.effort": ("1234.5", "1234.5"),
    "svd.decomposition": ("power", '"power"'),
    "search.confidence": ("on", "true"),
    "search.bytes": ("6000", "6000"),
    "cole.joint_terms": ("1", "1"),
    "source.path": ("material:phong-10", '"material:phong-10"'),
    "source.channels": ("550nm", '"550nm"'),
    "compare.sources": ("material:phong-10", '["material:phong-10"]'),
    "compare.textures": ("4,5", "[4, 5]"),
    "compare.size": ("4,5", "[4, 5]"),
    "compare.search": ("powell,gradient", '["powell", "gradient"]'),
    "compare.methods": ("mccool:wi+h,svd", '["mccool:wi+h", "svd"]'),
    "compare.metrics": ("all", '["all"]'),
    "render.light": ("1,0,0.5", "[1, 0, 0.5]"),
    "render.eye": ("1,0,0.5", "[1, 0, 0.5]"),
    "render.target": ("1,0,0.5", "[1, 0, 0.5]"),
    "render.size": ("48", "48"),
    "output.folder": ("some/place", '"some/place"'),
}


def another(key: str, declared: Declared) -> tuple[str, str]:
    """A value of an option that is not its default: a word of the command line, and TOML."""
    if key in OWN:
        return OWN[key]
    default, kind, option = declared.default, declared.kinds[0], declared.option
    if kind is bool:
        return ("off", "false") if default else ("on", "true")
    if option.choices:
        word = next(word for word in option.choices if word != default and (word,) != default)
        return word, f'"{word}"'
    if kind is int:
        number = default + 3 if default is not None else 3
        return str(number), str(number)
    if kind is float:
        number = default / 2 if default else 0.3
        return repr(number), repr(number)
    return "some.png", '"some.png"'


SETTINGS = [
    (method, name, declared) for method in METHODS for name, declared in options_of(METHODS[method]).items()
]  # fmt: skip
IDS = [f"{method}.{name}" for method, name, _ in SETTINGS]


@pytest.fixture
def fitted(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Method]:
    """What reaches the fit of `factorize`."""

    class Reached(Exception):
        """Enough was seen."""

    def run(*arguments: str) -> Method:
        caught: list[Method] = []

        def stop(source: Any, method: Method, *_: Any, **__: Any) -> None:
            caught.append(method)
            raise BadInput("reached")

        monkeypatch.setattr("homofact.evaluation.compare.fit_and_measure", stop)
        assert main(["factorize", "material:phong-10", "--count", "50", "-q", *arguments]) == 2
        assert len(caught) == 1, "the command was refused before it fitted"
        return caught[0]

    return run


def written(name: str, declared: Declared, text: str) -> list[str]:
    if declared.kinds[0] is bool:
        return [f"--{'' if text == 'on' else 'no-'}{declared.flag}"]
    return [f"--{declared.flag}", text]


def check_only(name: str, method: Method, found: Any, plain: Method) -> None:
    """Only the setting in question differs from the method's defaults, and it does."""
    assert type(method) is type(plain)
    assert getattr(method, name) == found != getattr(plain, name)
    assert replace(method, **{name: getattr(plain, name)}) == plain


# What must stand beside a value that cannot stand alone.
BESIDE = {"cole.confidence": {"joint_terms": 0}, "search.textures": {}, "svd.reciprocal": {}}


@pytest.mark.parametrize(("method", "name", "declared"), SETTINGS, ids=IDS)
def test_every_setting_of_every_method_is_an_option(
    method: str, name: str, declared: Declared, fitted: Callable[..., Method], tmp_path: Path
) -> None:
    text, _ = another(f"{method}.{name}", declared)
    beside = BESIDE.get(f"{method}.{name}", {})
    more = [word for each, value in beside.items() for word in (f"--{each.replace('_', '-')}", str(value))]
    out = ["--out", str(tmp_path / "o")]
    found = fitted("--method", method, *written(name, declared, text), *more, *out)
    plain = fitted("--method", method, *more, *out)
    check_only(name, found, getattr(found, name), plain)
    value = {"on": True, "off": False}.get(text, text) if declared.kinds[0] is bool else declared.from_text(text)
    number = declared.kinds[0] is int
    assert getattr(found, name) == (int(text) if number else value)


@pytest.mark.parametrize(("method", "name", "declared"), SETTINGS, ids=IDS)
def test_every_setting_of_every_method_is_a_key_of_toml(
    method: str, name: str, declared: Declared, fitted: Callable[..., Method], tmp_path: Path
) -> None:
    toml = another(f"{method}.{name}", declared)[1]
    beside = "".join(f"{each} = {value}\n" for each, value in BESIDE.get(f"{method}.{name}", {}).items())
    path = tmp_path / "run.toml"

    def run(line: str) -> Method:
        # The run's one seed is a key of its own.
        top, own = (line, "") if name == "seed" else ("", line)
        path.write_text(f'{top}[fit]\nmethod = "{method}"\n{own}{beside}')
        return fitted("-c", str(path), "--out", str(tmp_path / "o"))

    found = run(f"{name} = {toml}\n")
    check_only(name, found, getattr(found, name), run(""))


@pytest.mark.parametrize("name", fit_options())
def test_a_setting_of_other_methods_is_refused_by_name(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    having = fit_options()[name]
    for method in METHODS.keys() - {*methods_with(name)}:
        first = next(iter(having))
        text, _ = another(f"{first}.{name}", having[first])
        line = ["factorize", "material:phong-10", "--method", method, *written(name, having[first], text)]
        assert main([*line, "--out", str(tmp_path / "o")]) == 2
        said = capsys.readouterr().err
        assert re.match(rf"homofact: {name}: {method} has no such setting, expected one of its own \(.*size, ", said)
        assert all(each in said.rpartition(";")[2] for each in having)


# The commands that take the options of sections, by a section's key.
COMMANDS = {
    "source.path": "factorize", "source.channels": "info", "source.count": "info", "source.scheme": "info",
    "source.calibrate": "info", "source.clipped": "info", "source.dismiss": "info",
    "source.subset": "compare", "evaluate.held_out": "compare", "compare.methods": "compare", "compare.plot": "compare",
    "compare.metrics": "compare", "compare.sources": "compare", "compare.csv": "compare", "compare.latex": "compare",
    "compare.chart": "compare", "compare.by_source": "compare", "compare.on": "compare", "compare.textures": "compare",
    "compare.size": "compare", "compare.search": "compare", "output.folder": "factorize", "output.force": "convert",
    "render.light": "render", "render.environment": "render", "render.exposure": "render", "render.tonemap": "render",
    "render.size": "render", "render.file": "render", "render.camera": "render", "render.eye": "render",
    "render.target": "render",
    "fit.method": "factorize", "seed": "factorize",
}  # fmt: skip
EVERY = section_options() | {"seed": SEED}


def value_of(config: Config, key: str) -> Any:
    section, _, name = key.rpartition(".")
    return getattr(getattr(config, section) if section else config, name)


@pytest.mark.parametrize("key", EVERY)
def test_every_key_of_a_section_is_an_option_and_a_key_of_toml(
    key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    declared, command = EVERY[key], COMMANDS[key]
    text, toml = another(key, declared)
    seen: list[Config] = []

    def keep(file: Any, given: dict[str, Any]) -> Config:
        seen.append(load_config(file, given))
        raise BadInput("enough")

    monkeypatch.setattr("homofact.cli.options.load_config", keep)
    arguments = {"render": [str(tmp_path)], "convert": ["material:phong-10", str(tmp_path / "a.csv")]}.get(command, [])
    words = [text] if declared.option.argument else written(declared.name, declared, text)
    section, _, name = key.rpartition(".")
    path = tmp_path / "run.toml"
    path.write_text(f"{f'[{section}]' if section else ''}\n{name} = {toml}\n")
    for each in ([], words, ["-c", str(path)]):
        assert main([command, *arguments, *each]) == 2
    plain, by_option, by_file = (value_of(config, key) for config in seen)
    assert by_option == by_file != plain == declared.default


def test_the_help_has_every_option_of_the_methods_with_whose_it_is_and_its_default() -> None:
    for command in ("factorize", "compare"):
        own = {each.name: each.help for each in get_command(app).commands[command].params}  # type: ignore[attr-defined]
        for name, by_method in fit_options().items():
            if command == "compare" and name in ("textures", "size", "search"):
                continue
            said = own[f"fit_{name}"]
            whose = "all methods" if len(by_method) == len(METHODS) else next(iter(by_method))
            assert re.search(rf"\(({whose}\b|all methods)", said), said
            for declared in by_method.values():
                assert declared.option.help in said
                assert shown_default(declared) in said.partition("Default: ")[2]


def test_every_option_says_what_it_is_and_takes_its_default() -> None:
    for method in METHODS.values():
        for name, declared in options_of(method).items():
            assert declared.option.help, name
            assert declared.default is None or declared.checked(declared.default) == declared.default
            assert declared.default is not None or declared.option.none, name
        assert made(method.name, {}) == method()


@pytest.mark.parametrize("bad", [math.nan, math.inf, "x", [], None])
@pytest.mark.parametrize(("method", "name", "declared"), SETTINGS, ids=IDS)
def test_what_is_of_no_use_is_refused_by_name(method: str, name: str, declared: Declared, bad: Any) -> None:
    if bad is None and declared.optional:
        return
    with pytest.raises(BadInput, match=rf"^{name}: found .*, expected .+"):
        METHODS[method](**{name: bad})
