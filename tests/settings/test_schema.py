"""The JSON Schemas of TOML files: current, met by every file here, and refusing nothing that the reader takes."""

import json
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from homofact.config import fit_options, load_config
from homofact.errors import BadInput
from homofact.planning.scene import read_scene
from homofact.relighting.scene_file import RelightSceneTable
from homofact.settings.schema import value_schema
from homofact.settings.tables import read_table
from homofact.sweeps.sweep_file import read_sweep

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))
from make_schemas import FOLDER, schemas  # noqa: E402

PHONG = 'source = "material:phong-10"'
FILES = sorted((ROOT / "configs").rglob("*.toml"))


def _schema_of(file: Path) -> dict[str, Any]:
    """The schema that a file's first line names, as editors find it."""
    word, _, path = file.read_text(encoding="utf-8").splitlines()[0].partition(" ")
    assert word == "#:schema"
    return json.loads((file.parent / path).read_text(encoding="utf-8"))


def _valid(schema: dict[str, Any], value: Any) -> bool:
    return jsonschema.Draft202012Validator(schema).is_valid(value)


def test_the_stored_schemas_are_current() -> None:
    stored = {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in FOLDER.glob("*.json")}
    assert stored == json.loads(json.dumps(schemas()))
    for schema in stored.values():
        jsonschema.Draft202012Validator.check_schema(schema)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_file_of_the_repository_meets_its_schema(file: Path) -> None:
    jsonschema.validate(tomllib.loads(file.read_text(encoding="utf-8")), _schema_of(file))


@pytest.mark.parametrize(
    ("text", "read"),
    [
        ('[fit]\nmethd = "search"\n', load_config),
        ("[fit]\nsize = 8.5\n", load_config),
        ('[fit]\nsize = "8"\n', load_config),
        ("[fit]\ntextures = 0\n", load_config),
        ('[fit]\nobjective = "logs"\n', load_config),
        ("[evaluate]\nheld_out = 1\n", load_config),
        ("[render]\nlight = [0, 1]\n", load_config),
        ("seed = -1\n", load_config),
        ('[source]\npath = ["a"]\n', load_config),
        ('sources = ["material:phong-10"]\n', read_sweep),
        ('sources = ["material:phong-10"]\n[[method]]\nlabel = "a"\n', read_sweep),
        ('sources = ["material:phong-10"]\n[[method]]\nmethod = "mccool"\nsizes = 3\n', read_sweep),
        ('sources = ["material:phong-10"]\nbytes = [0]\n[[method]]\nmethod = "mccool"\n', read_sweep),
        (f'[[material]]\n{PHONG}\nshare = 2\n[lighting]\nnamed = "sun"\n[tolerance]\ncole = 1\n', read_scene),
        (f"[[material]]\n{PHONG}\nshare = 1\n[tolerance]\ncole = 1\n", read_scene),
    ],
)  # fmt: skip
def test_what_a_schema_refuses_the_reader_refuses(tmp_path: Path, text: str, read: Callable[[Path], object]) -> None:
    name = {load_config: "fit", read_sweep: "sweep", read_scene: "plan"}[read]
    assert not _valid(schemas()[name], tomllib.loads(text))
    file = tmp_path / "a.toml"
    file.write_text(text)
    with pytest.raises(BadInput):
        read(file)


def _ends(schema: dict[str, Any]) -> list[float]:
    ends = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
    return [schema[end] for end in ends if end in schema]


def test_ranges_and_choices_end_where_those_of_the_reader_end() -> None:
    """Every number's ends and what lies beside them, and every word, of all settings of all methods."""
    checked = 0
    for by_method in fit_options().values():
        for own in by_method.values():
            schema = value_schema(own)
            if own.is_list or own.option.expected_instead is not None:
                continue
            near = [end + step for end in _ends(schema) for step in (-1, 0, 1)]
            for value in [*near, *schema.get("enum", ()), "no such word", True]:
                try:
                    own.read(value)
                    taken = True
                except BadInput:
                    taken = False
                assert _valid(schema, value) is taken, (own.name, value)
                checked += 1
    assert checked > 100


def test_sections_may_be_one_or_several_only_where_the_reader_takes_both() -> None:
    lighting = schemas()["plan"]["properties"]["lighting"]
    assert [way["type"] for way in lighting["anyOf"]] == ["object", "array"]
    assert schemas()["relight"]["properties"]["object"]["type"] == "array"
    assert schemas()["relight"]["properties"]["transport"]["type"] == "object"
    assert set(schemas()["relight"]["required"]) == {"camera", "object", "lighting"}
    with pytest.raises(BadInput):
        read_table(RelightSceneTable, {"object": {}}, "")


def test_every_key_of_a_configuration_has_its_help() -> None:
    properties = schemas()["fit"]["properties"]
    for section, schema in properties.items():
        for name, own in schema.get("properties", {}).items():
            ways = own.get("anyOf", [own])
            assert "description" in own or all("description" in way for way in ways), (section, name)
