"""Read the text of a tensor tree (in braces), and write an array as the smallest tree within a tolerance.

{ {…} {…} … }      2ⁿ branches of n dimensions
{ 1 2 3 … }        a grid of 2^(n·k) values, the first dimension slowest
"""

import re

import numpy as np
import torch

from homofact.brdf.tensor_tree import Tree
from homofact.errors import BadInput
from homofact.files.text import short

_TOKENS = re.compile(r"[{}]|[^{}]+")
# Deeper than any file that is written: 2^20 cells along a side.
_DEEPEST = 20


def parsed_tree(where: object, text: str, dimensions: int) -> Tree:
    """Return the tree of a text.

    Raises BadInput for unbalanced braces, wrong numbers of branches or values, and words that are not numbers.
    """
    branches = 2**dimensions
    children: list[list[int]] = []
    grids: list[np.ndarray] = []
    open_nodes: list[list[int] | None] = []
    root: int | None = None
    for match in _TOKENS.finditer(text):
        token = match[0]
        if token == "{":
            if root is not None or (open_nodes and open_nodes[-1] is None):
                raise BadInput(f"a brace at character {match.start()}", where=where, expected="one tree")
            if len(open_nodes) > _DEEPEST:
                raise BadInput(f"braces deeper than {_DEEPEST}", where=where, expected="a tree")
            open_nodes.append([])
        elif token == "}":
            if not open_nodes:
                raise BadInput(f"a closing brace too many at character {match.start()}", where=where, expected="a tree")
            node = open_nodes.pop()
            if node is None:
                reference = -len(grids)
            else:
                if len(node) != branches:
                    raise BadInput(f"a node of {len(node)} branches", where=where, expected=f"{branches}, or values")
                children.append(node)
                reference = len(children) - 1
            if open_nodes:
                parent = open_nodes[-1]
                assert parent is not None
                parent.append(reference)
            else:
                root = reference
        elif words := token.replace(",", " ").split():
            if not open_nodes or open_nodes[-1]:
                raise BadInput(f"{short(words[0])} outside of a leaf", where=where, expected="values within braces")
            grids.append(_grid(where, words, dimensions))
            open_nodes[-1] = None
    if root is None:
        raise BadInput("a tree that is cut", where=where, expected="as many closing braces as opening ones")
    return _tree(children, grids, dimensions)


def _grid(where: object, words: list[str], dimensions: int) -> np.ndarray:
    side = (len(words).bit_length() - 1) // dimensions
    if 2 ** (side * dimensions) != len(words):
        allowed = ", ".join(str(2 ** (k * dimensions)) for k in range(4))
        raise BadInput(f"a leaf of {len(words)} values", where=where, expected=f"{allowed} or more")
    try:
        values = np.array(words, dtype=np.float64)
    except ValueError:
        values = np.array([np.nan])
    if not np.isfinite(values).all() or np.abs(values).max() > 1e30:
        bad = next((word for word in words if not _finite(word)), words[0])
        raise BadInput(where=where, found=short(bad), expected="a finite number")
    return values.clip(0)


def _finite(word: str) -> bool:
    try:
        return bool(abs(float(word)) <= 1e30)
    except ValueError:
        return False


def _tree(children: list[list[int]], grids: list[np.ndarray], dimensions: int) -> Tree:
    sides = np.array([(len(grid).bit_length() - 1) // dimensions for grid in grids])
    starts = np.cumsum([0, *(len(grid) for grid in grids)])[:-1]
    table = torch.tensor(children, dtype=torch.long).reshape(-1, 2**dimensions)
    # Children come before their parents.
    below = [0] * len(children)
    for k, node in enumerate(children):
        below[k] = 1 + max(below[child] if child >= 0 else int(sides[-1 - child]) for child in node)
    depth = below[-1] if below else int(sides[0])
    values = torch.from_numpy(np.concatenate(grids))
    return Tree(dimensions, table, torch.from_numpy(sides), torch.from_numpy(starts), values, depth)


def tree_text(values: np.ndarray, tolerance: float) -> str:
    """Return an array (equal sides, a power of 2) as text; a leaf's relative deviations are within `tolerance`."""
    parts: list[str] = []
    _write(values, tolerance, "", parts)
    return "\n".join(parts)


def _write(block: np.ndarray, tolerance: float, indent: str, parts: list[str]) -> None:
    mean = float(block.mean())
    if float(block.max() - block.min()) <= 2 * tolerance * abs(mean) and float(block.max() - mean) <= tolerance * mean:
        parts.append(f"{indent}{{ {mean:.6g} }}")
        return
    half = block.shape[0] // 2
    if half == 1:
        parts.append(f"{indent}{{ {' '.join(f'{x:.6g}' for x in block.reshape(-1).tolist())} }}")
        return
    parts.append(f"{indent}{{")
    for number in range(2**block.ndim):
        cut = tuple(slice(half, None) if number >> k & 1 else slice(None, half) for k in range(block.ndim))
        _write(block[cut], tolerance, indent + " ", parts)
    parts.append(f"{indent}}}")
