"""A strict reader of the part of pbrt-v4's scene format that an export uses, for tests.

Tokens are those of pbrt's `Tokenizer::Next`, values those of `parseParameters` (src/pbrt/parser.cpp); which statements
stand before and behind WorldBegin, and what parameters each has, is as pbrt.org/fileformat-v4 says. A name that is not
listed here is an error, whatever pbrt would make of it.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_TOKEN = re.compile(r'\s+|#[^\r\n]*|"(?:[^"\\\n]|\\[bfnrt\\\'"])*"|\[|\]|[^\s"\[\]#]+')
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
# How many numbers, or words, make one value.
_SIZES = {"float": 1, "integer": 1, "string": 1, "bool": 1, "rgb": 3, "point2": 2, "point3": 3, "normal": 3}
_OPTIONS = {
    ("Camera", "perspective"): {
        "float frameaspectratio", "float screenwindow", "float lensradius", "float focaldistance", "float fov",
        "float shutteropen", "float shutterclose",
    },
    ("Film", "rgb"): {
        "integer xresolution", "integer yresolution", "float cropwindow", "integer pixelbounds", "float diagonal",
        "string filename", "bool savefp16", "float iso", "float whitebalance", "string sensor",
        "float maxcomponentvalue",
    },
    ("Sampler", "zsobol"): {"integer pixelsamples", "integer seed", "string randomization"},
    ("Integrator", "path"): {"integer maxdepth", "string lightsampler", "bool regularize"},
}  # fmt: skip
_WORLD = {
    ("LightSource", "infinite"): {"string filename", "rgb L", "float scale", "float illuminance", "point3 portal"},
    ("AreaLightSource", "diffuse"): {"string filename", "rgb L", "float scale", "float power", "bool twosided"},
    ("Shape", "bilinearmesh"): {"point3 P", "normal N", "point2 uv", "integer indices", "string emissionfilename"},
    ("Shape", "sphere"): {"float radius", "float zmin", "float zmax", "float phimax", "float alpha"},
    ("Material", "diffuse"): {"rgb reflectance", "float displacement", "string normalmap"},
    ("MakeNamedMaterial", "measured"): {"string type", "string filename", "float displacement", "string normalmap"},
}  # fmt: skip
_PLAIN = {"LookAt": 9, "Translate": 3, "Scale": 3, "Rotate": 4}


@dataclass(frozen=True)
class Statement:
    """A directive, its word (a type or a name), its numbers or parameters by "type name"; how deep it stands."""

    directive: str
    word: str = ""
    numbers: tuple[float, ...] = ()
    parameters: dict[str, list[Any]] = field(default_factory=dict)
    world: bool = False
    depth: int = 0


def parsed(path: Path) -> list[Statement]:
    """The statements of a scene with what it includes, from its own folder. Fails for anything unknown."""
    tokens = _tokens(path, path.parent)
    found: list[Statement] = []
    world, depth, named = False, 0, set()
    while tokens:
        directive = tokens.pop(0)
        if directive == "WorldBegin":
            assert not world, "WorldBegin twice"
            world = True
        elif directive in ("AttributeBegin", "AttributeEnd"):
            depth += 1 if directive == "AttributeBegin" else -1
            assert world, f"{directive} before WorldBegin"
            assert depth >= 0, "AttributeEnd without AttributeBegin"
        elif directive in _PLAIN:
            numbers = tuple(_number(tokens.pop(0)) for _ in range(_PLAIN[directive]))
            found.append(Statement(directive, "", numbers, {}, world, depth))
        elif directive == "NamedMaterial":
            name = _word(tokens.pop(0))
            assert world, "NamedMaterial before WorldBegin"
            assert name in named, f"NamedMaterial {name!r} is not made"
            found.append(Statement(directive, name, world=world, depth=depth))
        else:
            word = _word(tokens.pop(0))
            parameters = _parameters(tokens)
            kind = word
            if directive == "MakeNamedMaterial":
                (kind,) = parameters["string type"]
                assert word not in named, f"{word!r} twice"
                named.add(word)
            known = (_WORLD if world else _OPTIONS).get((directive, kind))
            assert known is not None, f"{directive} {kind!r} {'behind' if world else 'before'} WorldBegin"
            assert set(parameters) <= known, f"{directive} {kind!r}: {sorted(set(parameters) - known)}"
            found.append(Statement(directive, word, (), parameters, world, depth))
    assert world, "no WorldBegin"
    assert depth == 0, "AttributeBegin without AttributeEnd"
    return found


def _tokens(path: Path, folder: Path) -> list[str]:
    """The tokens of a file, without its comments, with those of the files that it includes."""
    text = path.read_text(encoding="utf-8")
    tokens, place = [], 0
    while place < len(text):
        match = _TOKEN.match(text, place)
        assert match, f"{path.name}: no token at {text[place : place + 30]!r}"
        place = match.end()
        if not match.group().isspace() and not match.group().startswith("#"):
            tokens.append(match.group())
    whole: list[str] = []
    while tokens:
        token = tokens.pop(0)
        whole += _tokens(folder / _word(tokens.pop(0)), folder) if token == "Include" else [token]
    return whole


def _parameters(tokens: list[str]) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    while tokens and tokens[0].startswith('"'):
        name = _word(tokens.pop(0))
        kind, _, own = name.partition(" ")
        assert kind in _SIZES, f"{name!r}: no type"
        assert re.fullmatch(r"\w+", own), f"{name!r}: no name"
        assert name not in found, f"{name!r} twice"
        first = tokens.pop(0)
        values = [first]
        if first == "[":
            end = tokens.index("]")
            values, tokens[: end + 1] = tokens[:end], []
        assert values, f"{name!r}: nothing"
        assert len(values) % _SIZES[kind] == 0, f"{name!r}: {len(values)} values"
        found[name] = [_value(kind, each) for each in values]
    return found


def _value(kind: str, token: str) -> Any:
    if kind == "string":
        return _word(token)
    if kind == "bool":
        assert token in ("true", "false"), token
        return token == "true"
    if kind == "integer":
        assert re.fullmatch(r"[+-]?\d+", token), f"{token!r}: no integer"
        return int(token)
    return _number(token)


def _number(token: str) -> float:
    assert _NUMBER.fullmatch(token), f"{token!r}: no number"
    return float(token)


def _word(token: str) -> str:
    assert len(token) >= 2, token
    assert token[0] == token[-1] == '"', f"{token}: no string"
    return re.sub(r"\\(.)", r"\1", token[1:-1])
