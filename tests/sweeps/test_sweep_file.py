"""The sweep's file: what it means, and what it refuses."""

import zipfile
from pathlib import Path

import pytest

from homofact.brdf.materials import MATERIALS
from homofact.errors import BadInput
from homofact.methods.mccool import McCool
from homofact.methods.search import Search
from homofact.sweeps.sweep_file import read_sweep
from homofact.sweeps.task import source_digest, tasks_of

ROOT = Path(__file__).parents[2]
METHOD = '[[method]]\nmethod = "mccool"\n'


def written(folder: Path, text: str) -> Path:
    file = folder / "paints.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_the_embedded_example() -> None:
    asked = read_sweep(ROOT / "configs/sweep.toml")
    names = [Path(each).name.removeprefix("material:") for each in asked.sources]
    assert names == ["lafortune-blue-paint", "lafortune-clay", "lafortune-skin", "blue_paint.npz"]
    assert [label for label, _ in asked.fits()] == ["ours, 3276 B", "mccool, 3276 B", "ggx"]


def test_methods_times_bytes_times_seeds_and_what_bytes_mean(tmp_path: Path) -> None:
    text = 'sources = ["material:phong-30"]\nseeds = [3, 5]\nbytes = [3276, 12288]\n'
    text += '[[method]]\nmethod = "search"\n[[method]]\nmethod = "mccool"\n[[method]]\nmethod = "ggx"\n'
    fits = read_sweep(written(tmp_path, text)).fits()
    assert [(label, method.seed) for label, method in fits] == [
        (label, seed)
        for label in ("search, 3276 B", "search, 12288 B", "mccool, 3276 B", "mccool, 12288 B", "ggx")
        for seed in (3, 5)
    ]
    spent = [method.bytes for _, method in fits if isinstance(method, Search)]
    assert spent == [3276, 3276, 12288, 12288]
    # Two RGB textures of n² texels in float32: the largest n that fits.
    sizes = [method.size for _, method in fits if isinstance(method, McCool)]
    assert sizes == [11, 11, 22, 22]
    assert all(2 * 12 * n**2 <= count < 2 * 12 * (n + 1) ** 2 for n, count in ((11, 3276), (22, 12288)))


def test_files_are_relative_to_the_file_and_patterns_match(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    for name in ("b.brdf", "a.brdf", "c.txt"):
        (tmp_path / "data" / name).write_text(name)
    asked = read_sweep(written(tmp_path, f'sources = ["data/*.brdf", "data/c.txt", "data/a.brdf"]\n{METHOD}'))
    assert asked.sources == tuple(str((tmp_path / "data" / name).resolve()) for name in ("a.brdf", "b.brdf", "c.txt"))


def test_named_materials_come_in_the_order_of_their_names(tmp_path: Path) -> None:
    found = read_sweep(written(tmp_path, f'sources = ["material:*"]\n{METHOD}')).sources
    assert found == tuple(f"material:{name}" for name in sorted(MATERIALS))


@pytest.mark.parametrize("pattern", ["*.brdf", "run#1/*.brdf"])
def test_a_pattern_matches_under_folders_with_a_number_sign(tmp_path: Path, pattern: str) -> None:
    folder = tmp_path / "set#2"
    (folder / "run#1").mkdir(parents=True)
    place = folder / pattern.replace("*", "a")
    place.write_text("1")
    assert read_sweep(written(folder, f'sources = ["{pattern}"]\n{METHOD}')).sources == (str(place.resolve()),)


def test_a_pattern_after_the_file_s_name_matches_its_materials(tmp_path: Path) -> None:
    file = tmp_path / "fits.npz"
    with zipfile.ZipFile(file, "w") as archive:
        for name in ("red-b", "red-a", "blue"):
            archive.writestr(f"{name}/w0.npy", b"")
    asked = read_sweep(written(tmp_path, f'sources = ["fits.npz#red-*"]\n{METHOD}'))
    assert asked.sources == (f"{file.resolve()}#red-a", f"{file.resolve()}#red-b")
    first, second = tasks_of(asked)
    assert first.key != second.key


def test_a_key_follows_what_matters_and_nothing_else(tmp_path: Path) -> None:
    first, second = tmp_path / "a.brdf", tmp_path / "b.brdf"
    first.write_text("1")
    second.write_text("1")

    def keys(text: str) -> list[str]:
        return [task.key for task in tasks_of(read_sweep(written(tmp_path, text)))]

    one = keys(f'sources = ["a.brdf"]\n{METHOD}')
    assert keys(f'sources = ["b.brdf"]\n{METHOD}') == one, "the same bytes are the same source"
    assert keys(f'name = "x"\nsources = ["a.brdf"]\n{METHOD}label = "other words"') == one
    assert keys(f'sources = ["a.brdf"]\nseeds = [1]\n{METHOD}') != one
    assert keys(f'sources = ["a.brdf"]\nheld_out = 0.3\n{METHOD}') != one
    assert keys(f'sources = ["a.brdf"]\n{METHOD}size = 8') != one
    assert keys(f'sources = ["a.brdf"]\n[source]\nchannels = "luminance"\n{METHOD}') != one
    first.write_text("2")
    assert keys(f'sources = ["a.brdf"]\n{METHOD}') != one


def test_a_folder_is_told_by_its_files_and_their_names(tmp_path: Path) -> None:
    place = tmp_path / "rings"
    place.mkdir()
    (place / "a").write_text("1")
    before = source_digest(str(place))
    (place / "a").rename(place / "b")
    assert source_digest(str(place)) != before


def test_a_list_for_one_setting_is_told_how_to_ask_for_several(tmp_path: Path) -> None:
    hints = []
    for value in ("[1, 2]", "0"):
        with pytest.raises(BadInput) as refusal:
            read_sweep(written(tmp_path, f'{MATERIALS_ALL}[[method]]\nmethod = "search"\ntextures = {value}\n'))
        assert refusal.value.where.endswith("method[0].textures")
        hints.append("[[method]]" in refusal.value.hint)
    assert hints == [True, False]


MATERIALS_ALL = 'sources = ["material:*"]\n'


@pytest.mark.parametrize(
    ("text", "where", "found"),
    [
        (METHOD, "sources", "nothing"),
        (f"sources = []\n{METHOD}", "sources", "none"),
        (f"sources = 3\n{METHOD}", "sources", "3"),
        (f'sources = ["x.brdf"]\n{METHOD}', "sources[0]", "'x.brdf', which matches nothing"),
        (f'sources = ["*.xyz"]\n{METHOD}', "sources[0]", "'*.xyz', which matches nothing"),
        (f'sources = ["x.npz#*"]\n{METHOD}', "sources[0]", "'x.npz#*', which matches nothing"),
        (f'sources = ["material:plastik"]\n{METHOD}', "sources[0]", "'material:plastik', which matches nothing"),
        (MATERIALS_ALL, "method", "nothing"),
        (f'{MATERIALS_ALL}method = "search"\n', "method", "the string 'search'"),
        (f"{MATERIALS_ALL}[[method]]\nsize = 8\n", "method[0].method", "nothing"),
        (f'{MATERIALS_ALL}[[method]]\nmethod = "serch"\n', "method[0].method", "'serch'"),
        (f"{MATERIALS_ALL}{METHOD}siz = 8\n", "method[0].siz", "mccool has no such setting"),
        (f"{MATERIALS_ALL}{METHOD}seed = 8\n", "method[0].seed", "8"),
        (f"{MATERIALS_ALL}{METHOD}bytes = 8\n", "method[0].bytes", "8"),
        (f'{MATERIALS_ALL}{METHOD}label = "a"\n{METHOD}size = 4\nlabel = "a"\n', "method[1]", "'a' twice"),
        (f"{MATERIALS_ALL}{METHOD}{METHOD}", "method[1]", "'mccool' twice"),
        (f"{MATERIALS_ALL}seeds = []\n{METHOD}", "seeds", "none"),
        (f"{MATERIALS_ALL}seeds = [1, 1]\n{METHOD}", "seeds", "1, 1"),
        (f"{MATERIALS_ALL}seeds = [-1]\n{METHOD}", "seeds", "-1"),
        (f"{MATERIALS_ALL}bytes = [8]\n{METHOD}", "bytes", "8"),
        (f"{MATERIALS_ALL}held_out = 2\n{METHOD}", "held_out", "2"),
        (f"{MATERIALS_ALL}name = ' '\n{METHOD}", "name", "an empty one"),
        (f"{MATERIALS_ALL}sedes = [1]\n{METHOD}", "sedes", "unknown key"),
        (f"{MATERIALS_ALL}epsilon = 0.1\n{METHOD}", "epsilon", "unknown key"),
        (f'{MATERIALS_ALL}[source]\nchanels = "rgb"\n{METHOD}', "source.chanels", "unknown key"),
        (f"{MATERIALS_ALL}[source]\ncount = 0\n{METHOD}", "source.count", "0"),
        (f"{MATERIALS_ALL}[source]\npath = 'x'\n{METHOD}", "source.path", "'x'"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path: Path, text: str, where: str, found: str) -> None:
    file = written(tmp_path, text)
    with pytest.raises(BadInput) as refusal:
        read_sweep(file)
    assert (refusal.value.where, refusal.value.found) == (f"{file}: {where}", found)
    assert ("[[method]]" in refusal.value.hint) == (where == "epsilon")
