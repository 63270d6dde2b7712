"""The memory that a fit needs, estimated before it starts: the maximum over its steps.

The constants are measured (`scripts/speed/memory_of_sizes.py`): the number of dense T × T matrices that a step needs,
for T texels, and the bytes per stencil entry in sparse systems.
"""

from collections.abc import Sequence

from homofact.linear.layout import Shape
from homofact.linear.size import is_dense, refuse_beyond_memory
from homofact.linear.sparse_solve import COARSE
from homofact.methods.method import Method

# Matrices at a time: of a solve, of all folds in a search, of what every texel's spread or whole numbers need.
_SOLVE, _FOLDS, _CONFIDENCE, _WHOLE_NUMBERS, _ORTHOGONAL = 4, 10, 5, 8, 3
_ENTRY = 120  # bytes of a stencil's entry: by number and weight, as rows, and as columns
_BANDS = 4  # a texture's band at a time


def refuse_too_large(method: Method, shapes: Sequence[Shape], rows: int, searched: int = 0) -> None:
    """Raise BadInput if a fit with textures of these shapes needs more than the machine's memory.

    `rows` is the number of log samples, including azimuth copies, times the number of lookups. `searched` is the number
    of texels during the search. The message names the setting that needs the most memory.
    """
    texels = sum(rows_of * columns for rows_of, columns in shapes)
    matrix = 8.0 * texels**2
    if is_dense(texels):
        solved = _SOLVE * matrix
    else:
        bands = sum(8.0 * _BANDS * own * columns * (2 * columns + 3) for own, columns in shapes)
        solved = 4 * _ENTRY * rows + bands + _SOLVE * 8 * COARSE**2
    side = max(columns for _, columns in shapes)
    asked = f"{len(shapes)} textures, the largest {side} texels wide:"
    smaller = "expected smaller textures"
    needs = [(solved, f"size: found {asked} solving them", smaller)]
    if searched:
        folds = 8.0 * _FOLDS * searched**2
        needs.append((folds, f"search_size: a search on {searched} texels", "expected a smaller one"))
    if method.solver == "qr":
        needs.append((_ORTHOGONAL * matrix, f"solver: found qr and {asked} it", f"{smaller}, or cholesky"))
    if method.confidence:
        needs.append((_CONFIDENCE * matrix, f"confidence: found {asked} every texel's deviation", f"{smaller} or none"))
    if method.quantize != "none":
        needs.append(
            (_WHOLE_NUMBERS * matrix, f"quantize: found {asked} whole numbers", f"{smaller}, or export to round texels")
        )
    nbytes, what, instead = max(needs)
    refuse_beyond_memory(what, nbytes, instead)
