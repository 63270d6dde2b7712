"""Explain what a table of text lacks to be a readable CSV file, instead of listing all formats."""

from homofact.brdf.formats.csv import ANGLES, VECTORS
from homofact.files.text import numbered_lines, short

_NAMES = f"{','.join(ANGLES)} (in degrees with _deg)"
_EXPECTED = f"{_NAMES} or {','.join(VECTORS)}, and the channels"
_SEPARATORS = ((";", "';'"), ("\t", "tabs"), (None, "blanks"))
_IMAGES = (b"#?RADIANCE", b"#?RGBE", b"v/1\x01", b"\x89PNG", b"\xff\xd8\xff")  # HDR, EXR, PNG, JPEG
_LEAST_COLUMNS = 5
_MOST_NAMED = 6


def hint_of(head: bytes) -> str | None:
    """Return what is wrong with a table that begins with `head`; None if `head` is not text or not a table."""
    if head.startswith(_IMAGES):
        return "a picture, no BRDF; environment maps light the scenes of `homofact.relight` and `homofact.edit`"
    if b"\0" in head:
        return None
    lines = [line for _, line in numbered_lines(head) if not line.startswith("#")][:2]
    if not lines:
        return None
    if "," in lines[0]:
        words = lines[0].split(",")
        if len(words) >= _LEAST_COLUMNS and _numbers(words):
            return f"a table without a header line, expected {_EXPECTED}"
    for separator, shown in _SEPARATORS:
        words = lines[0].split(separator)
        if len(words) > 1 and any(map(_direction, words)):
            return f"a table separated by {shown}, expected commas"
        if len(words) >= _LEAST_COLUMNS and _numbers(words):
            return f"a table separated by {shown}, expected commas and a header line: {_EXPECTED}"
        if len(words) >= _LEAST_COLUMNS and len(lines) > 1 and _numbers(lines[1].split(separator)):
            named = ", ".join(short(word.strip()) for word in words[:_MOST_NAMED])
            return f"a table separated by {shown}, with columns {named}; expected commas and {_NAMES}"
    words = lines[0].split(",")
    if len(words) >= _LEAST_COLUMNS and _numbers(lines[-1].split(",")):
        named = ", ".join(short(word.strip()) for word in words[:_MOST_NAMED])
        return f"its header names no directions: the columns are {named}, expected {_EXPECTED}"
    return None


def _direction(word: str) -> bool:
    name = word.strip().strip('"').lower().removesuffix("_deg").removesuffix("_rad")
    return name in ANGLES or name in VECTORS


def _numbers(words: list[str]) -> bool:
    """Whether all words are numbers, be it with a comma for the decimal point."""
    try:
        return bool([float(word.strip().replace(",", ".")) for word in words])
    except ValueError:
        return False
