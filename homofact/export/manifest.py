"""The manifest: everything but the texels that a program needs to evaluate a factorization, in JSON.

The format is versioned by itself. Numbers are written so that they read back exactly (float64, shortest
form); a reader in another language needs this file and the EXR textures, nothing else.
"""

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from homofact.containers.exr import exr_channel_names
from homofact.errors import BadInput
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import Projection
from homofact.files.atomic import write_text
from homofact.geometry.rotation import Pair
from homofact.version import __version__

FORMAT = "homofact manifest"
FORMAT_VERSION = 1

CONVENTIONS = {
    "frame": "z is the surface normal, x the tangent, y the binormal, right-handed",
    "directions": "wi points to the light, wo to the viewer; unit, both away from the surface, z >= 0",
    "value": "BRDF in 1/sr, linear, without the cosine; 0 where wi or wo is under the horizon",
    "parabolic_map": "(u, v) = (w.x, w.y) / (1 + w.z)",
    "half_difference": "h = norm(wi + wo); r = norm(t - (t.h) h) with t = (1, 0, 0); s = cross(h, r);"
    " d = (r.wi, s.wi, h.wi); where h = +-t, r = norm((0, 0, -h.x)) (Kautz and McCool)",
    "coordinates": {
        "in-out": "x = (parabolic wi, parabolic wo)",
        "half-diff": "x = (parabolic h, parabolic d)",
        "isotropic-half-diff": "x = (theta_h, theta_d, phi_d) * 4/pi - 1, in radians; theta_h the angle of h"
        " from the normal, theta_d of wi from h, phi_d = atan2(|h.x wi.y - h.y wi.x|, |wi.z - (h.wi) h.z|)",
        "isotropic-in-out": "x = (2 theta_i, 2 theta_o, |phi_i - phi_o| in [0, pi]) * 2/pi - 1, in radians",
    },
    "warp": "where a width w is given, r -> asinh(r/w)/asinh(1/w) before the matrix, with r the length of"
    " parabolic h (half-diff; its direction is kept) or theta_h/(pi/2) (isotropic-half-diff)",
    "projection": "(u, v) = matrix x in [-1, 1]^2; a conjugate matrix, where there is one, is a second lookup"
    " of the same texture (reciprocity)",
    "texels": "column = (u + 1)/2 (columns - 1), row = (v + 1)/2 (rows - 1), clamped, bilinear between texel"
    " centres; a sampler in [0, 1] reads at ((column + 1/2)/columns, (row + 1/2)/rows)",
    "images": "EXR: logarithm p, the first scanline is row 0 (v = -1), the first pixel column 0"
    " (u = -1); PNG: p for the eye, same way round, not for evaluation",
    "evaluation": "f = A max(0, exp(sum over all lookups of p(u, v)) - epsilon), p interpolated bilinearly",
    "mask": "one string a row, row 0 first; 1: the projected domain reaches the texel or its neighbour,"
    " 0: filler that no pair of directions reads",
    "rotation": "quaternions (w, x, y, z); a pair acts on R^4 as v -> left v right, a single one on R^3 as"
    " v -> q v q^-1; the rows of the unscaled matrix are the images of the first two basis vectors",
}


def manifest(factorization: Factorization, files: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """The JSON-able description; `files` names each texture's files, for instance {"exr": …, "png": …}.

    Raises BadInput where the files are not one entry a texture.
    """
    if len(files) != len(factorization.terms):
        raise BadInput(f"manifest: files of {len(files)} textures, expected {len(factorization.terms)}")
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "homofact_version": __version__,
        "channels": list(factorization.channels),
        "exr_channels": list(exr_channel_names(factorization.channels)),
        "epsilon": factorization.transform.epsilon,
        "A": {
            "values": factorization.transform.mean.tolist(),
            "unit": "1/sr",
            "meaning": "mean of the training samples, per channel",
        },
        "bytes": factorization.nbytes,
        "fetches": factorization.fetches,
        "textures": [_texture(term, names) for term, names in zip(factorization.terms, files, strict=True)],
        "seed": factorization.provenance.get("seed"),
        "provenance": factorization.provenance,
        "conventions": CONVENTIONS,
    }


def write_json(path: str | os.PathLike[str], obj: Any) -> None:
    """Write `obj` as indented UTF-8 JSON, whole or not at all.

    Raises BadInput for what JSON cannot hold (NaN and infinities included) and a place that cannot be
    written.
    """
    try:
        text = json.dumps(obj, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    except (TypeError, ValueError) as error:
        raise BadInput(f"{path}: not JSON ({error}), expected plain finite values") from error
    write_text(path, text)


def _texture(term: Term, names: Mapping[str, str]) -> dict[str, Any]:
    rows, columns = term.size
    return {
        "files": dict(names),
        "rows": rows,
        "columns": columns,
        "mask": bits(term.mask),
        "projection": describe_projection(term.projection),
    }


def bits(mask: Tensor) -> list[str]:
    """A mask (rows, columns) as one string a row, 1 where it is True."""
    return ["".join("1" if texel else "0" for texel in row) for row in mask.tolist()]


def describe_projection(projection: Projection) -> dict[str, Any]:
    """The JSON-able description of a projection, as `CONVENTIONS` explains it."""
    matrices = projection.matrices()
    return {
        "name": projection.name,
        "coordinates": projection.coordinates,
        "axes": list(projection.system.axes),
        "matrix": projection.matrix.tolist(),
        "scale": projection.matrix.norm(dim=1).tolist(),
        "reciprocal": projection.reciprocal,
        "conjugate_matrix": matrices[1].tolist() if len(matrices) == 2 else None,
        "lookups": projection.lookups,
        "warp": None if projection.warp is None else {"width": projection.warp.width},
        "rotation": _rotation(projection.rotation),
    }


def _rotation(rotation: Pair | Tensor | None) -> dict[str, Any] | None:
    if isinstance(rotation, Pair):
        return {"kind": "pair", "left": rotation.left.tolist(), "right": rotation.right.tolist()}
    if isinstance(rotation, torch.Tensor):
        return {"kind": "single", "quaternion": rotation.tolist()}
    return None
