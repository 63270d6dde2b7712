"""A process of its own that compiles HLSL by libdxcompiler.so: a line of JSON in, a line of JSON out.

    {"code": …, "arguments": ["-T", "ps_6_0", …]}  →  {"done": true, "compiled": base64, "told": messages}

The library's interface is COM (its header dxcapi.h): an object begins with the address of a table of its methods, whose
first argument is the object. After an error DXC 1.6 waits for ever for a lock of its own when its process ends, so this
one ends without it.
"""

import base64
import json
import os
import sys
import uuid
from collections.abc import Sequence
from ctypes import (
    CDLL,
    CFUNCTYPE,
    POINTER,
    Structure,
    byref,
    c_char,
    c_char_p,
    c_int32,
    c_size_t,
    c_uint32,
    c_void_p,
    c_wchar_p,
    cast,
    string_at,
)
from pathlib import Path
from typing import Any

_COMPILER, _COMPILER_3 = "73e22d93-e6ce-47f3-b5bf-f0664f39c1b0", "228b4687-5a6a-4730-900c-9702b2203f54"
_RESULT = "58346cda-dde7-4497-9461-6f87af5e0659"
# In the table of DXC 1.6 on Linux: QueryInterface, AddRef, Release, a destructor twice, then an interface's own.
_RELEASE, _FIRST = 2, 5
_UTF8 = 65001


class _Source(Structure):
    _fields_ = (("text", c_char_p), ("size", c_size_t), ("encoding", c_uint32))


def main() -> None:
    """Answer until the input ends."""
    compiler = _compiler(Path(__file__).with_name("libdxcompiler.so"))
    for line in sys.stdin:
        asked = json.loads(line)
        done, compiled, told = compiled_by(compiler, asked["code"], asked["arguments"])
        answer = {"done": done, "compiled": base64.b64encode(compiled).decode(), "told": told}
        print(json.dumps(answer), flush=True)
    os._exit(0)


def compiled_by(compiler: c_void_p, code: str, arguments: Sequence[str]) -> tuple[bool, bytes, str]:
    """(whether it was compiled, what it became, the messages)."""
    text = code.encode()
    source, words = _Source(text, len(text), _UTF8), (c_wchar_p * len(arguments))(*arguments)
    result, status = c_void_p(), c_int32()
    compile_it = _method(
        compiler, _FIRST, POINTER(_Source), POINTER(c_wchar_p), c_uint32, c_void_p, c_void_p, POINTER(c_void_p)
    )
    failed = compile_it(byref(source), words, len(arguments), None, _guid(_RESULT), byref(result))
    if failed:
        return False, b"", f"IDxcCompiler3::Compile returned {failed:#x}"
    _method(result, _FIRST, POINTER(c_int32))(byref(status))
    compiled, told = (_bytes(result, _FIRST + k) for k in (1, 2))
    _method(result, _RELEASE)()
    return status.value == 0, compiled, told.rstrip(b"\0").decode()


def _compiler(path: Path) -> c_void_p:
    create, made = CDLL(str(path)).DxcCreateInstance, c_void_p()
    create.argtypes = (c_void_p, c_void_p, POINTER(c_void_p))
    failed = create(_guid(_COMPILER), _guid(_COMPILER_3), byref(made))
    if failed:
        raise OSError(f"DxcCreateInstance returned {failed:#x}")
    return made


def _guid(text: str) -> Any:
    return (c_char * 16).from_buffer_copy(uuid.UUID(text).bytes_le)


def _method(of: c_void_p, place: int, *types: Any, returns: Any = c_int32) -> Any:
    """The method at a place of an object's table, bound."""
    table = cast(of, POINTER(POINTER(c_void_p)))[0]
    function = CFUNCTYPE(returns, c_void_p, *types)(table[place])
    return lambda *arguments: function(of, *arguments)


def _bytes(result: c_void_p, place: int) -> bytes:
    """What the blob holds that a method hands out, nothing where there is none."""
    blob = c_void_p()
    _method(result, place, POINTER(c_void_p))(byref(blob))
    if not blob:
        return b""
    start, size = (_method(blob, _FIRST + k, returns=kind)() for k, kind in enumerate((c_void_p, c_size_t)))
    held = string_at(start, size) if size else b""
    _method(blob, _RELEASE)()
    return held


if __name__ == "__main__":
    main()
