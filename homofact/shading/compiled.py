"""The program compiled for this machine's processor: many pairs of directions at once, in float32.

The same program that the shaders print becomes Python source for numba. Its statements fall into stretches between
the fetches; a stretch is one loop over a block of pairs without calls or branches (`float_functions`), which the
compiler turns into vector instructions; a fetch is a loop of its own, for it reads from where the pairs say. Between
loops a block's values wait in rows of a small buffer that stays in the first cache. Blocks are shared by all threads.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numba import njit, prange
from torch import Tensor

from homofact.errors import BadInput
from homofact.factor.fitted import Fitted
from homofact.geometry.expression import INFIX, Expression, Let, component, nodes
from homofact.shading import float_functions
from homofact.shading.encoding import as_floats
from homofact.shading.program import Program, program_of

BLOCK = 128


@dataclass(frozen=True)
class Compiled:
    """A `Reflectance` that is evaluated by compiled code, in float32 whatever it is asked in.

    `source` is the Python source of the kernel, for who wants to read it.
    """

    channels: tuple[str, ...]
    source: str
    _kernel: Any
    _texels: tuple[np.ndarray, ...]

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """BRDF values (N, C) in sr⁻¹, without the cosine, 0 under the horizon; float32 values in wi's type."""
        values = self.evaluate_array(*(w.detach().cpu().to(torch.float32).numpy() for w in (wi, wo)))
        return torch.from_numpy(values).to(wi)

    def evaluate_array(self, wi: np.ndarray, wo: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
        """The same of float32 arrays (N, 3), into `out` (N, C) float32 where it is given.

        Raises BadInput for other shapes or types.
        """
        for name, w in (("wi", wi), ("wo", wo)):
            if w.dtype != np.float32 or w.ndim != 2 or w.shape[1] != 3 or len(w) != len(wi):
                raise BadInput(f"{name}: found {w.dtype} of shape {w.shape}, expected float32 of shape (N, 3), N alike")
        shape = (len(wi), len(self.channels))
        values = np.empty(shape, np.float32) if out is None else out
        if values.dtype != np.float32 or values.shape != shape:
            raise BadInput(f"out: found {values.dtype} of shape {values.shape}, expected float32 of shape {shape}")
        self._kernel(np.ascontiguousarray(wi), np.ascontiguousarray(wo), values, *self._texels)
        return values


def compiled(fitted: Fitted) -> Compiled:
    """A fit ready for fast evaluation; the first evaluation compiles it, in seconds.

    Raises BadInput for more than four channels.
    """
    plain = [as_floats(texture.texels) for texture in fitted.textures]
    return compiled_program(program_of(fitted, plain), [texture.stored for texture in plain])


def compiled_program(program: Program, textures: Sequence[np.ndarray]) -> Compiled:
    """A program with its decoded texels (rows, columns, C) float32 as a reflectance."""
    source, constants = _kernel_source(program)
    functions = {name: getattr(float_functions, name) for name in ("exp", "log", "asinh", "atan2")}
    space: dict[str, Any] = {"np": np, "prange": prange, "BLOCK": BLOCK, **constants, **functions}
    exec(compile(source, "<shading program>", "exec"), space)
    space["evaluate_block"] = njit(fastmath=True, error_model="numpy")(space["evaluate_block"])
    kernel = njit(parallel=True)(space["kernel"])
    return Compiled(program.channels, source, kernel, tuple(texels.reshape(-1) for texels in textures))


def _kernel_source(program: Program) -> tuple[str, dict[str, np.float32]]:
    """(source of the kernel, its constants by name).

    The buffer is one array whose rows begin at multiples of BLOCK, a constant: the compiler then sees that what a loop
    writes is not what it reads, and may do many pairs at once. Directions and values are moved by loops of their own.
    """
    constants: dict[str, np.float32] = {}
    channels = len(program.channels)
    results = [f"value_{c}" for c in range(channels)]
    stretches = _stretches(program)
    names = [f"{w}_{k}" for w in ("wi", "wo") for k in range(3)] + sorted(_kept(program, stretches)) + results
    rows = {name: k * BLOCK for k, name in enumerate(names)}
    body = _loop([f"buffer[{rows[f'{w}_{k}']} + i] = {w}[i, {k}]" for w in ("wi", "wo") for k in range(3)])
    for stretch in stretches:
        if isinstance(stretch, Let):
            body += _loop(_fetch(stretch, program, rows, constants))
            continue
        pairs = [pair for let in stretch for pair in _scalars(let)]
        if stretch is stretches[-1]:
            pairs += [(name, component(program.result, c)) for c, name in enumerate(results)]
        made = {name for name, _ in pairs}
        read = {name for _, scalar in pairs for name in _names(scalar)} - made
        lines = [f"{name} = buffer[{rows[name]} + i]" for name in sorted(read)]
        for name, scalar in pairs:
            lines.append(f"{name} = {_render(scalar, constants)}")
            if name in rows:
                lines.append(f"buffer[{rows[name]} + i] = {name}")
        body += _loop(lines)
    body += _loop([f"values[i, {c}] = buffer[{rows[name]} + i]" for c, name in enumerate(results)])
    textures = "".join(f", texels_{k}" for k in range(len(program.shapes)))
    inner = "\n".join(f"    {line}" for line in body)
    return (
        f"def evaluate_block(count, buffer, wi, wo, values{textures}):\n{inner}\n\n"
        f"def kernel(wi, wo, values{textures}):\n"
        "    n = wi.shape[0]\n"
        "    for block in prange((n + BLOCK - 1) // BLOCK):\n"
        f"        buffer = np.empty({len(rows) * BLOCK}, np.float32)\n"
        "        begin = block * BLOCK\n"
        "        end = min(begin + BLOCK, n)\n"
        f"        evaluate_block(end - begin, buffer, wi[begin:end], wo[begin:end], values[begin:end]{textures})\n"
    ), constants


def _loop(lines: Sequence[str]) -> list[str]:
    return ["for i in range(count):", *(f"    {line}" for line in lines)]


def _stretches(program: Program) -> list[Let | list[Let]]:
    """The statements as stretches without a fetch, and fetches between them; the last is a stretch."""
    found: list[Let | list[Let]] = [[]]
    for let in program.statements:
        if let.expression.kind == "fetch":
            found.append(let)
            found.append([])
        else:
            last = found[-1]
            assert isinstance(last, list)
            last.append(let)
    return [stretch for stretch in found[:-1] if isinstance(stretch, Let) or stretch] + [found[-1]]


def _scalars(let: Let) -> list[tuple[str, Expression]]:
    """Each component of a statement by its scalar name."""
    dimension = let.expression.dimension
    if dimension == 1:
        return [(let.name, component(let.expression, 0))]
    return [(f"{let.name}_{k}", component(let.expression, k)) for k in range(dimension)]


def _kept(program: Program, stretches: Sequence[Let | list[Let]]) -> set[str]:
    """Scalars that are read in another loop than the one that makes them."""
    kept: set[str] = set()
    made: dict[str, int] = {}
    for number, stretch in enumerate(stretches):
        lets = [stretch] if isinstance(stretch, Let) else stretch
        read = {name for let in lets for name in _read(let)}
        if stretch is stretches[-1]:
            read |= {name for c in range(len(program.channels)) for name in _names(component(program.result, c))}
        kept |= {name for name in read if made.get(name, number) != number}
        for let in lets:
            made |= dict.fromkeys(_made(let), number)
    return kept


def _made(let: Let) -> list[str]:
    dimension = let.expression.dimension
    return [let.name] if dimension == 1 else [f"{let.name}_{k}" for k in range(dimension)]


def _read(let: Let) -> set[str]:
    if let.expression.kind == "fetch":
        return {name for k in (0, 1) for name in _names(component(let.expression.operands[0], k))}
    return {name for _, scalar in _scalars(let) for name in _names(scalar)}


def _names(scalar: Expression) -> set[str]:
    found = set()
    for node in nodes(scalar):
        if node.kind == "swizzle":
            found.add(f"{node.operands[0].text}_{'xyzw'.index(node.text)}")
        elif node.kind == "name" and node.dimension == 1:
            found.add(node.text)
    return found


def _fetch(let: Let, program: Program, rows: dict[str, int], constants: dict[str, np.float32]) -> list[str]:
    """The lines of a fetch; places are unsigned, for a signed one might count from the end."""
    number, channels = int(let.expression.text), let.expression.dimension
    height, width = program.shapes[number]
    uv = let.expression.operands[0]
    place = [_render(component(uv, k), constants) for k in (0, 1)]
    last = [_constant(float(side - 1), constants) for side in (width, height)]
    sides = [_constant(float(side), constants) for side in (width, height)]
    half, zero, one = (_constant(value, constants) for value in (0.5, 0.0, 1.0))
    right, above = channels if width > 1 else 0, channels * width if height > 1 else 0
    lines = [
        *(f"{name} = buffer[{rows[name]} + i]" for name in sorted(_read(let))),
        f"x = min(max({place[0]} * {sides[0]} - {half}, {zero}), {last[0]})",
        f"y = min(max({place[1]} * {sides[1]} - {half}, {zero}), {last[1]})",
        f"column = min(np.int32(x), np.int32({max(width - 2, 0)}))",
        f"row = min(np.int32(y), np.int32({max(height - 2, 0)}))",
        "u = x - np.float32(column)",
        "v = y - np.float32(row)",
        f"a, b, c, d = ({one} - u) * ({one} - v), u * ({one} - v), ({one} - u) * v, u * v",
        f"at = np.uint32(row * np.int32({width * channels}) + column * np.int32({channels}))",
    ]
    for k, name in enumerate(_made(let)):
        parts = (f"{w} * texels_{number}[at + np.uint32({step + k})]" for w, step in
                 (("a", 0), ("b", right), ("c", above), ("d", right + above)))  # fmt: skip
        if name in rows:
            lines.append(f"buffer[{rows[name]} + i] = {' + '.join(parts)}")
    return lines


def _constant(value: float, constants: dict[str, np.float32]) -> str:
    for name, known in constants.items():
        if known == np.float32(value):
            return name
    name = f"C_{len(constants)}"
    constants[name] = np.float32(value)
    return name


def _render(scalar: Expression, constants: dict[str, np.float32]) -> str:
    kind, operands = scalar.kind, scalar.operands
    if kind == "constant":
        return _constant(scalar.values[0], constants)
    if kind == "name":
        return scalar.text
    if kind == "swizzle":
        return f"{operands[0].text}_{'xyzw'.index(scalar.text)}"
    parts = [_render(operand, constants) for operand in operands]
    if kind in INFIX:
        return f"({parts[0]} {kind} {parts[1]})"
    if kind == "fract":
        return f"({parts[0]} - np.floor({parts[0]}))"
    if kind == "step":
        one, zero = _constant(1.0, constants), _constant(0.0, constants)
        return f"({one} if {parts[1]} >= {parts[0]} else {zero})"
    return f"{f'np.{kind}' if kind in ('sqrt', 'floor') else kind}({', '.join(parts)})"
