"""Convert the shading program to Python source for numba, with loops over a block of pairs of directions.

The depth of a statement is the number of fetches on which it depends. The statements of one depth form a loop over the
block without calls or branches (`float_functions`), or several loops if there are many constants, which the compiler
turns into vector instructions. The last of these loops also computes the places of the next fetches. Each fetch is a
separate loop, in which the vectors are the channels of its four texels (`vector_code.bilinear`); texels of three
channels are stored as four numbers. Between loops, the values of the block are stored in rows of one buffer that fits
into the fastest caches.

A block is always computed completely, even if it contains fewer pairs; only existing pairs are read and written. In a
shorter loop, the compiler would compute the last pairs one by one, and scalar code rounds differently (a vector
division is a refined estimate of the reciprocal). So the value of a pair does not depend on its position or on the
number of pairs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from homofact.errors import BadInput
from homofact.geometry.expression import INFIX, Expression, Let, component, nodes
from homofact.shading.program import Program
from homofact.shading.vector_code import LANES

BLOCK = 256
# A loop keeps its constants in registers. Of more the compiler makes vectors in memory, which are slow to read.
_MOST_CONSTANTS = 16
# Names of the kernel's own, besides `C_0` … and those that end in a number of a row or a texture.
OWN = (
    "i", "j", "x", "y", "row", "column", "count", "whole", "buffer", "texels", "places", "values", "np", "min", "max",
)  # fmt: skip


def texel_width(channels: int) -> int:
    """Return the number of floats per stored texel: the channels rounded up to a power of two."""
    return 1 << (channels - 1).bit_length()


@dataclass
class _Source:
    """The lines of a kernel while it is written: `rows` of the buffer by name, constants by name."""

    program: Program
    rows: dict[str, int]
    constants: dict[str, np.float32]
    lines: list[str]

    @property
    def channels(self) -> int:
        """How many values a pair has."""
        return len(self.program.channels)

    def row(self, name: str) -> int:
        """Return where a name's row begins: a multiple of BLOCK, so that the compiler sees that rows do not overlap."""
        return self.rows.setdefault(name, len(self.rows)) * BLOCK

    def loop(self, lines: Sequence[str], pairs: str = f"{BLOCK}") -> None:
        """A loop over the block's pairs, all of them or those in the range `pairs`."""
        self.lines += [f"for i in range({pairs}):", *(f"    {line}" for line in lines)]

    def apart(self, source: str, stride: int, names: Sequence[str], whole: str = f"{BLOCK}") -> None:
        """The numbers of each pair up to `whole`, side by side in `source`, into a row each of the buffer."""
        first = self.row(names[0])
        assert [self.row(name) for name in names] == [first + k * BLOCK for k in range(len(names))]
        call = f"apart_{stride}_{len(names)}({source}, {stride} * j, buffer, {first} + j, {BLOCK})"
        self.lines += [f"for j in range(0, {whole}, {LANES}):", f"    {call}"]

    def directions(self, source: str, names: Sequence[str]) -> None:
        """The directions of the pairs that there are; (1, 1, 1), which can be computed with, for the others."""
        self.apart(source, 3, names, "whole")
        rows = [f"buffer[{self.row(name)} + i]" for name in names]
        self.loop([f"{row} = {source}[3 * i + {k}]" for k, row in enumerate(rows)], "whole, count")
        one = self.constant(1.0)
        self.loop([f"{row} = {one}" for row in rows], f"count, {BLOCK}")

    def constant(self, value: float) -> str:
        """Return the name of a constant: a global of float32, since a literal would be of float64."""
        for name, known in self.constants.items():
            if known == np.float32(value):
                return name
        name = f"C_{len(self.constants)}"
        self.constants[name] = np.float32(value)
        return name

    def text(self, scalar: Expression) -> str:
        """Return a scalar expression as Python."""
        kind, operands = scalar.kind, scalar.operands
        if kind == "constant":
            return self.constant(scalar.values[0])
        if kind == "name":
            return scalar.text
        if kind == "swizzle":
            return f"{operands[0].text}_{'xyzw'.index(scalar.text)}"
        parts = [self.text(operand) for operand in operands]
        if kind in INFIX:
            return f"({parts[0]} {kind} {parts[1]})"
        if kind == "fract":
            return f"({parts[0]} - np.floor({parts[0]}))"
        if kind == "step":
            return f"({self.constant(1.0)} if {parts[1]} >= {parts[0]} else {self.constant(0.0)})"
        return f"{f'np.{kind}' if kind in ('sqrt', 'floor') else kind}({', '.join(parts)})"


def kernel_source(program: Program) -> tuple[str, dict[str, np.float32]]:
    """Return the source of `kernel(wi, wo, values, *textures)` and its constants by name.

    Arrays are flat: directions and values of all pairs one after the other, textures with `texel_width` numbers per
    texel. Raises BadInput if two names of the program would be equal in the kernel.
    """
    _check_names(program)
    made = _Source(program, {}, {}, [])
    phases = _loops(program)
    results = [f"value_{c}" for c in range(made.channels)]
    for w in ("wi", "wo"):
        made.directions(w, [f"{w}_{k}" for k in range(3)])
    for results_of_this in [name for _, fetches in phases for let in fetches for name in _made(let)], results:
        for name in results_of_this:
            made.row(name)
    for name in _kept(program, phases):
        made.row(name)
    count = 0
    for depth, (lets, fetches) in enumerate(phases):
        numbers = range(count, count + len(fetches))
        count += len(fetches)
        last = results if depth == len(phases) - 1 else []
        _stretch(made, lets, list(zip(numbers, fetches, strict=True)), last)
        for number, let in zip(numbers, fetches, strict=True):
            _fetch(made, number, let)
    first, stride = made.row(results[0]), made.channels
    call = f"together_{stride}(buffer, {first} + j, {BLOCK}, values, {stride} * j)"
    made.lines += [f"for j in range(0, whole, {LANES}):", f"    {call}"]
    rest = [f"values[{stride} * i + {c}] = buffer[{made.row(name)} + i]" for c, name in enumerate(results)]
    made.loop(rest, "whole, count")
    return _wrapped(made, count), made.constants


def _check_names(program: Program) -> None:
    """A vector `f` is the scalars `f_0`, `f_1`, … here, so a scalar of such a name would be taken for its component."""
    taken = {f"{w}_{k}": w for w in ("wi", "wo") for k in range(3)} | dict.fromkeys(OWN, "the kernel")
    taken |= {f"value_{c}": "the result" for c in range(len(program.channels))}
    for let in program.statements:
        for name in _made(let):
            if name in taken:
                raise BadInput(
                    where="program", found=f"{name} of {let.name} and of {taken[name]}", expected="different names"
                )
            taken[name] = let.name


def _wrapped(made: _Source, fetches: int) -> str:
    """The functions round the lines: a block, and the loop over all blocks that threads share."""
    textures = "".join(f", texels_{k}" for k in range(len(made.program.shapes)))
    inner = "\n".join(f"    {line}" for line in made.lines)
    scratch = texel_width(made.channels) * BLOCK if fetches else 1
    stride = made.channels
    return (
        f"def evaluate_block(count, buffer, texels, places, wi, wo, values{textures}):\n"
        f"    whole = count - count % {LANES}\n{inner}\n\n"
        f"def kernel(wi, wo, values{textures}):\n"
        "    n = wi.shape[0] // 3\n"
        "    for block in prange((n + BLOCK - 1) // BLOCK):\n"
        f"        buffer = np.empty({len(made.rows) * BLOCK}, np.float32)\n"
        f"        texels = np.empty({scratch}, np.float32)\n"
        f"        places = np.empty({max(fetches, 1) * BLOCK}, np.uint32)\n"
        "        begin = block * BLOCK\n"
        "        end = min(begin + BLOCK, n)\n"
        "        evaluate_block(\n"
        "            end - begin, buffer, texels, places, wi[3 * begin : 3 * end], wo[3 * begin : 3 * end],\n"
        f"            values[{stride} * begin : {stride} * end]{textures}\n"
        "        )\n"
    )


def _stretch(made: _Source, lets: Sequence[Let], fetches: Sequence[tuple[int, Let]], results: Sequence[str]) -> None:
    """One loop: statements, where the fetches read, and at the end the values."""
    pairs = [pair for let in lets for pair in _scalars(let)]
    pairs += [(name, component(made.program.result, c)) for c, name in enumerate(results)]
    own = {name for name, _ in pairs}
    read = {name for _, scalar in pairs for name in _names(scalar)}
    read |= {name for _, let in fetches for name in _read(let)}
    lines = [f"{name} = buffer[{made.row(name)} + i]" for name in sorted(read - own)]
    for name, scalar in pairs:
        lines.append(f"{name} = {made.text(scalar)}")
        if name in made.rows:
            lines.append(f"buffer[{made.row(name)} + i] = {name}")
    for number, let in fetches:
        lines += _place(made, number, let)
    if lines:
        made.loop(lines)


def _place(made: _Source, number: int, let: Let) -> list[str]:
    """Where a fetch reads: its first texel, inside whatever the directions are, and the shares of its neighbours."""
    height, width = made.program.shapes[int(let.expression.text)]
    uv = let.expression.operands[0]
    half, zero = made.constant(0.5), made.constant(0.0)
    lines = []
    for axis, side, cell in (("x", width, "column"), ("y", height, "row")):
        place = made.text(component(uv, "xy".index(axis)))
        most, sides = made.constant(float(side - 1)), made.constant(float(side))
        lines += [
            f"{axis} = min(max({place} * {sides} - {half}, {zero}), {most})",
            f"{cell} = max(min(np.int32({axis}), np.int32({max(side - 2, 0)})), np.int32(0))",
            f"buffer[{made.row(f'{axis}_{number}')} + i] = {axis} - np.float32({cell})",
        ]
    texel = texel_width(made.channels)
    lines.append(f"places[{number * BLOCK} + i] = row * np.int32({width * texel}) + column * np.int32({texel})")
    return lines


def _fetch(made: _Source, number: int, let: Let) -> None:
    """The loop that reads, and those that put the channels into rows."""
    texture = int(let.expression.text)
    height, width = made.program.shapes[texture]
    texel = texel_width(made.channels)
    right, above = texel if width > 1 else 0, texel * width if height > 1 else 0
    names = _made(let)
    to = f"buffer, {made.row(names[0])} + i" if texel == 1 else f"texels, {texel} * i"
    shares = ", ".join(f"buffer[{made.row(f'{axis}_{number}')} + i]" for axis in "xy")
    made.loop([f"bilinear_{texel}(texels_{texture}, places[{number * BLOCK} + i], {right}, {above}, {shares}, {to})"])
    if texel > 1:
        made.apart("texels", texel, names)


def _loops(program: Program) -> list[tuple[list[Let], list[Let]]]:
    """(statements, fetches behind them) of one loop each: by depth, and with few constants (`_MOST_CONSTANTS`)."""
    loops: list[tuple[list[Let], list[Let]]] = []
    for lets, fetches in _by_depth(program):
        loop: list[Let] = []
        known: set[float] = set()
        for let in lets:
            new = {float(x) for node in nodes(let.expression) if node.kind == "constant" for x in node.values}
            if loop and len(known | new) > _MOST_CONSTANTS:
                loops.append((loop, []))
                loop, known = [], set()
            loop.append(let)
            known |= new
        loops.append((loop, fetches))
    return loops


def _by_depth(program: Program) -> list[tuple[list[Let], list[Let]]]:
    """By the number of fetches before them: (statements, fetches)."""
    depths: dict[str, int] = {}
    depths_of: list[tuple[list[Let], list[Let]]] = [([], [])]
    for let in program.statements:
        depth = max((depths.get(name, 0) for name in _read(let)), default=0)
        is_fetch = let.expression.kind == "fetch"
        while len(depths_of) <= depth + is_fetch:
            depths_of.append(([], []))
        depths_of[depth][is_fetch].append(let)
        depths |= dict.fromkeys(_made(let), depth + is_fetch)
    return depths_of


def _kept(program: Program, phases: Sequence[tuple[list[Let], list[Let]]]) -> list[str]:
    """Return the scalars that one loop computes and another reads, except directions and fetched values."""
    made: dict[str, int] = {}
    kept: list[str] = []
    for number, (lets, fetches) in enumerate(phases):
        made |= {name: number for let in lets for name in _made(let)}
        read = {name for let in (*lets, *fetches) for name in _read(let)}
        if number == len(phases) - 1:
            read |= {name for c in range(len(program.channels)) for name in _names(component(program.result, c))}
        kept += [name for name in sorted(read) if made.get(name, number) != number and name not in kept]
    return kept


def _scalars(let: Let) -> list[tuple[str, Expression]]:
    """Each component of a statement by its scalar name."""
    return [(name, component(let.expression, k)) for k, name in enumerate(_made(let))]


def _made(let: Let) -> list[str]:
    dimension = let.expression.dimension
    return [let.name] if dimension == 1 else [f"{let.name}_{k}" for k in range(dimension)]


def _read(let: Let) -> set[str]:
    if let.expression.kind == "fetch":
        return {name for k in (0, 1) for name in _names(component(let.expression.operands[0], k))}
    return {name for _, scalar in _scalars(let) for name in _names(scalar)}


def _names(scalar: Expression) -> set[str]:
    names = set()
    for node in nodes(scalar):
        if node.kind == "swizzle":
            names.add(f"{node.operands[0].text}_{'xyzw'.index(node.text)}")
        elif node.kind == "name" and node.dimension == 1:
            names.add(node.text)
    return names
