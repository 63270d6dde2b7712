"""Strict TOML: what is read, what wins, and what is refused with the nearest known name."""

from pathlib import Path

import pytest

from homofact.config import Config, load_config
from homofact.errors import BadInput
from homofact.methods.cole import Cole
from homofact.methods.mccool import McCool
from homofact.methods.search import Search
from homofact.methods.table import METHODS

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def write(tmp_path: Path):
    def write(text: str) -> Path:
        path = tmp_path / "run.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_without_a_file_everything_has_its_default() -> None:
    config = load_config()
    assert config.fit.method_alone() == Search()
    assert (config.seed, config.source.channels, config.source.count) == (0, "rgb", 45_000)
    assert config.compare.methods == ("mccool", "cole", "search")


def test_every_section_is_read(write) -> None:
    config = load_config(
        write(
            'seed = 7\n[source]\npath = "a.brdf"\ncount = 10\n'
            '[fit]\nmethod = "mccool"\nsize = 24\nepsilon = 1\nprojections = ["wi", "h"]\n'
            '[evaluate]\nheld_out = 0.5\n[compare]\nmethods = ["cole"]\n'
            '[output]\nfolder = "o"\nforce = true\n'
            "[render]\nlight = [1, 0, 0.5]\nsize = 64\n"
        )
    )
    assert config.seed == 7
    assert config.fit.method_alone() == McCool(size=24, epsilon=1.0, projections=("wi", "h"), seed=7)
    assert (config.source.path, config.source.count) == ("a.brdf", 10)
    assert isinstance(config.fit.method_alone().epsilon, float)
    assert config.evaluate.held_out == 0.5
    assert config.compare.methods == ("cole",)
    assert (config.output.folder, config.output.force) == ("o", True)
    assert (config.render.light, config.render.size) == ((1.0, 0.0, 0.5), 64)


@pytest.mark.parametrize(
    ("key", "in_file", "given", "default"),
    [
        ("fit.smoothing", "0.5", 0.0, Cole().smoothing),
        ("fit.joint_terms", "3", 0, Cole().joint_terms),
        ("fit.reciprocal", "true", False, Cole().reciprocal),
        ("output.force", "true", False, False),
        ("seed", "5", 0, 0),
    ],
)
def test_the_command_line_wins_over_the_file_and_the_file_over_the_default(
    write, key: str, in_file: str, given: object, default: object
) -> None:
    section, _, name = key.rpartition(".")
    path = write((f"[{section}]\n" if section else "") + f"{name} = {in_file}\n")

    def value(config: Config) -> object:
        if section == "fit":
            return getattr(config.fit.methods(["cole"])["cole"], name)
        return getattr(getattr(config, section) if section else config, name)

    assert value(load_config()) == default
    assert value(load_config(path)) == value(load_config(path, {key: None})) != given
    # An explicit zero or false is a choice, not an absence.
    assert value(load_config(path, {key: given})) == given


@pytest.mark.parametrize(
    ("text", "where", "found"),
    [
        ("fit = 3\n", "fit", "3"),
        ('[fit]\nsize = "16"\n', "fit.size", "the string '16'"),
        ("[fit]\nsize = 16.0\n", "fit.size", "16.0"),
        ("[fit]\nsize = true\n", "fit.size", "true"),
        ("[fit]\nreciprocal = 1\n", "fit.reciprocal", "1"),
        ("[fit]\nsmoothing = true\n", "fit.smoothing", "true"),
        ("[fit]\nprojections = [1]\n", "fit.projections[0]", "1"),
        ("[fit]\nprojections = 3\n", "fit.projections", "3"),
        ("[fit]\nprojections = 'wi+hh'\n", "fit.projections", "'hh'"),
        ("[render]\nlight = [1, 2]\n", "render.light", "an array of 2"),
        ("[render]\nlight = [0, 0, 0]\n", "render.light", "(0.0, 0.0, 0.0)"),
        ("[fit]\nsize = 1\n", "fit.size", "1"),
        ("[fit]\ntextures = 0\n", "fit.textures", "0"),
        ("seed = -1\n", "seed", "-1"),
        ("[evaluate]\nheld_out = 1\n", "evaluate.held_out", "1"),
        ("[compare]\nmethods = []\n", "compare.methods", "none"),
        ("[compare]\nmethods = ['cole', 'cole']\n", "compare.methods", "cole, cole"),
        ("[source]\ncount = 0\n", "source.count", "0"),
    ],
)
def test_what_is_wrong_in_a_file_is_named_with_its_place(write, text: str, where: str, found: str) -> None:
    path = write(text)
    with pytest.raises(BadInput) as caught:
        load_config(path)
    assert (caught.value.where, caught.value.found) == (f"{path}: {where}", found)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "where", "nearest"),
    [
        ("[fit]\ntexturs = 2\n", "fit.texturs", "fit.textures"),
        ("[source]\ntextures = 2\n", "source.textures", "fit.textures"),
        ("[fit]\nseed = 2\n", "fit.seed", "seed"),
        ("sed = 2\n", "sed", "seed"),
        ("textures = 2\n", "textures", "fit.textures"),
        ("[fitt]\nsize = 2\n", "fitt", "fit"),
    ],
)
def test_an_unknown_key_is_named_with_the_nearest(write, text: str, where: str, nearest: str) -> None:
    path = write(text)
    with pytest.raises(BadInput) as caught:
        load_config(path)
    assert (caught.value.where, caught.value.hint) == (f"{path}: {where}", f"nearest: {nearest}")


@pytest.mark.parametrize("text", ["[fit\n", "[fit]\nsize = 2\nsize = 3\n"])
def test_a_file_that_is_no_toml_is_named(write, text: str) -> None:
    path = write(text)
    with pytest.raises(BadInput) as caught:
        load_config(path)
    assert caught.value.where == str(path)
    assert caught.value.found.startswith("not TOML: ")


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("sources = ['a']\n", "a sweep"),
        ("[[material]]\nshare = 1\n", "a scene for planning"),
        ("[[object]]\nterms = 1\n", "a scene for relighting"),
        ("[[object]]\nbands = [32]\n", "a scene for editing"),
    ],
)
def test_a_file_of_another_kind_is_named_as_what_it_is(write, text: str, kind: str) -> None:
    with pytest.raises(BadInput) as caught:
        load_config(write(text))
    assert (caught.value.found, caught.value.expected) == (kind, "a configuration")


def test_a_bad_option_is_not_blamed_on_the_file(write) -> None:
    path = write("[fit]\nsize = 24\n")
    with pytest.raises(BadInput, match=r"^size: found 1,"):
        load_config(path, {"fit.size": 1})


def test_a_missing_file_a_folder_and_bytes_are_refused(tmp_path: Path) -> None:
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe")
    for name, expected in (("none.toml", "no such file"), (".", "a folder, expected a TOML"), ("b.toml", "not TOML")):
        with pytest.raises(BadInput, match=expected):
            load_config(tmp_path / name)


# Sweeps are files of another kind: tests/sweeps reads them.
SWEEPS = {ROOT / "configs" / name for name in ("sweep.toml", "svbrdf.toml")}
SHIPPED = sorted(set((ROOT / "configs").glob("*.toml")) - SWEEPS)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_every_shipped_configuration_is_valid(path: Path) -> None:
    assert load_config(path).fit.methods(METHODS)


def test_the_thesis_run_takes_no_short_cut() -> None:
    fit = load_config(ROOT / "configs" / "thesis.toml").fit.method_alone()
    assert isinstance(fit, Cole)
    assert (fit.coordinates, fit.solver, fit.restarts, fit.joint_terms) == ("half-diff", "qmr", 6, 2)
    assert (fit.search_size, fit.search_samples, fit.epsilon, fit.bound) == (0, 0, 1e-5, "cube")


def test_a_setting_that_the_method_does_not_have_is_named_with_those_that_have_it(write) -> None:
    path = write("[fit]\nmethod = 'mccool'\nbudget = 60\n")
    with pytest.raises(BadInput) as caught:
        load_config(path).fit.method_alone()
    assert str(caught.value) == (
        f"{path}: fit.budget: mccool has no such setting, expected one of its own (projections, size, grid, epsilon,"
        " reciprocal, solver, smoothing, copies, mirrored, robust, confidence, quantize, spectral_tolerance,"
        " seed); search and cole have it"
    )
    # Beside a method that has it, it is that one's; beside none, nobody's.
    found = load_config(path).fit.methods(["mccool", "search"])
    assert found == {"mccool": McCool(), "search": Search(budget=60.0)}
    with pytest.raises(BadInput, match=r"fit\.budget: none of mccool, svd has such a setting, expected one of theirs"):
        load_config(path).fit.methods(["mccool", "svd"])


def test_the_command_lines_setting_is_not_blamed_on_the_file(write) -> None:
    path = write("[fit]\nmethod = 'mccool'\n")
    with pytest.raises(BadInput, match=r"^joint_terms: mccool has no such setting, .*; cole has it$"):
        load_config(path, {"fit.joint_terms": 1}).fit.method_alone()
