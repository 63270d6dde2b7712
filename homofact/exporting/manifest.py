"""The manifest: everything but the texels that a program needs to evaluate a fit, in JSON.

The format has its own version number. Numbers are written as the shortest decimals that read back exactly as float64. A
reader in another language needs only this file and the EXR textures.
"""

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

from homofact.containers.exr import exr_channel_names
from homofact.errors import BadInput
from homofact.factor.fitted import Fitted, Texture
from homofact.files.atomic import write_text
from homofact.version import __version__

FORMAT = "homofact manifest"
SEPARABLE_FORMAT = "homofact separable manifest"
MODEL_FORMAT = "homofact model manifest"
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
        "isotropic-half-tilt": "x = (theta_h * 4/pi - 1, theta_d * 4/pi - 1, 2 |wi.z - wo.z| - 1), in radians",
        "half-angles": "x = (theta_h * 4/pi - 1, phi_h / pi), in radians; phi_h = atan2(h.y, h.x), 0 where both are",
        "isotropic-angles": "x = (theta_i, theta_o, theta_d) * 4/pi - 1, in radians",
        "isotropic-in-out": "x = (2 theta_i, 2 theta_o, |phi_i - phi_o| in [0, pi]) * 2/pi - 1, in radians",
    },
    "warp": "where a width w is given, r -> asinh(r/w)/asinh(1/w) before the matrix, with r the length of"
    " parabolic h (half-diff; its direction is kept) or theta_h/(pi/2) (isotropic-half-diff, isotropic-half-tilt,"
    " half-angles)",
    "projection": "(u, v) = matrix x in [-1, 1]^2; a conjugate matrix, where there is one, is a second lookup"
    " of the same texture (reciprocity)",
    "texels": "column = (u + 1)/2 (columns - 1), row = (v + 1)/2 (rows - 1), clamped, bilinear between texel"
    " centres; a sampler in [0, 1] reads at ((column + 1/2)/columns, (row + 1/2)/rows)",
    "periodic": "of u and v, whether the axis goes round: -1 and +1 are the same place, and the last column (u) or row"
    " (v) of the texture repeats the first, so that it is read like any other",
    "images": "EXR: logarithm p, the first scanline is row 0 (v = -1), the first pixel column 0"
    " (u = -1); PNG: p for the eye, same way round, not for evaluation",
    "evaluation": "f = A max(0, exp(sum over all lookups of p(u, v)) - epsilon), p interpolated bilinearly",
    "basis": "where there is one, the channels of a texture are coordinates s of a spectrum: p of band k is"
    " sum over v of s[v] vectors[v][k] + offset[k], s being summed over all lookups first; between bands f is linear",
    "mask": "one string a row, row 0 first; 1: the projected domain reaches the texel or its neighbour,"
    " 0: filler that no pair of directions reads",
    "rotation": "quaternions (w, x, y, z); a pair acts on R^4 as v -> left v right, a single one on R^3 as"
    " v -> q v q^-1; the rows of the unscaled matrix are the images of the first two basis vectors",
}


# Of a sum of products, in place of those above.
_MAPS = {
    "parabolic": "(u, v) = (w.x, w.y) / (1 + w.z)",
    "orthographic": "(u, v) = (w.x, w.y)",
    "polar": "u = atan2(w.y, w.x) / pi, v = 2 sqrt(1 - w.z) - 1",
}
_SUM = (
    "f = max(0, sum over terms of sign * first(place of a) * second(place of b)), per channel; (a, b) = (wi, wo) for"
    " in-out, (h, d) for half-diff; a term without second reads first at both"
)
# By the kind of a model without textures, how its numbers make a value.
_MODELS = {
    "ggx": "f = diffuse/pi + sum over lobes of specular F D G / (4 cos_i cos_o), with a the lobe's roughness (alpha)"
    " and R its reflectance: D = a^2 / (pi (cos_h^2 (a^2 - 1) + 1)^2), F = R + (1 - R) (1 - cos_d)^5, and the Smith"
    " term of both directions together G / (4 cos_i cos_o) = 1/2 / (cos_o sqrt(cos_i^2 (1 - a^2) + a^2)"
    " + cos_i sqrt(cos_o^2 (1 - a^2) + a^2)); h is the half vector, d the angle between it and wi",
}
_SUM_IMAGES = {
    "images": "EXR: the factor, linear, first scanline row 0 (v = -1), first pixel column 0 (u = -1); PNG: its absolute"
    " value for the eye, same way round, not for evaluation",
    "read": "one string a row, row 0 first; 1: some direction's bilinear stencil reads the texel",
}


def conventions(described: Mapping[str, Any]) -> dict[str, Any]:
    """Describe the conventions that a fit's `describe` leaves out, except the storage of its texels."""
    kept = ["frame", "directions", "value", "half_difference", "mask"]
    if described["kind"] == "product":
        kept += ["parabolic_map", "coordinates", "warp", "projection", "periodic", "rotation", "evaluation"]
        kept += ["basis"] if "basis" in described else []
        return {name: CONVENTIONS[name] for name in CONVENTIONS if name in kept}
    if "model" in described:
        said = {name: CONVENTIONS[name] for name in ("frame", "directions", "value")}
        return said | {"evaluation": _MODELS.get(described["kind"], "as the paper of the model gives it")}
    own = {"evaluation": _SUM, "map": _MAPS[described["map"]]}
    return {name: CONVENTIONS[name] for name in kept} | own


def manifest(fitted: Fitted, files: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """Return the JSON-able description; `files` names each texture's files, for instance {"exr": …, "png": …}.

    Raises BadInput unless `files` has one entry per texture.
    """
    textures, described = fitted.textures, fitted.describe()
    if len(files) != len(textures):
        raise BadInput(f"files of {len(files)} textures", where="manifest", expected=len(textures))
    layout = _model if "model" in described else _product if described["kind"] == "product" else _sum_of_products
    own = layout(described, textures, files)
    stored = (textures[0].components if textures else ()) or fitted.channels
    return {
        "format_version": FORMAT_VERSION,
        "homofact_version": __version__,
        "channels": list(fitted.channels),
        "exr_channels": list(exr_channel_names(stored)),
        "epsilon": fitted.transform.epsilon,
        "bytes": fitted.nbytes,
        "fetches": fitted.fetches,
        "seed": fitted.provenance.get("seed"),
        "provenance": fitted.provenance,
        **own,
        "A": {"values": fitted.transform.mean.tolist(), "unit": "1/sr", "meaning": own["A"]},
    }


def _product(
    described: Mapping[str, Any], textures: Sequence[Texture], files: Sequence[Mapping[str, str]]
) -> dict[str, Any]:
    entries = [
        {
            "files": dict(names),
            "rows": texture.size[0],
            "columns": texture.size[1],
            "mask": term["mask"],
            "projection": term["projection"],
        }
        for term, texture, names in zip(described["terms"], textures, files, strict=True)
    ]
    return {
        "format": FORMAT,
        "A": "mean of the training samples, per channel",
        "textures": entries,
        **({"basis": described["basis"]} if "basis" in described else {}),
        "conventions": {name: text for name, text in CONVENTIONS.items() if name != "basis" or name in described},
    }


def _model(
    described: Mapping[str, Any], textures: Sequence[Texture], files: Sequence[Mapping[str, str]]
) -> dict[str, Any]:
    return {
        "format": MODEL_FORMAT,
        "A": "mean of the training samples, per channel; of the error's log transform, not of the evaluation",
        **described,
        "conventions": conventions(described),
    }


def _sum_of_products(
    described: Mapping[str, Any], textures: Sequence[Texture], files: Sequence[Mapping[str, str]]
) -> dict[str, Any]:
    sides = ("first", "second")
    said = {name: text for name, text in conventions(described).items() if name != "mask"}
    return {
        "format": SEPARABLE_FORMAT,
        "A": "mean of the training samples, per channel; of the error's log transform, not of the evaluation",
        "map": described["map"],
        "parameterization": described["parameterization"],
        "rows": textures[0].size[0],
        "columns": textures[0].size[1],
        "read": described["read"],
        "terms": [
            {
                "files": {side: dict(files[k]) for side, k in zip(sides, term["textures"], strict=False)},
                "signs": term["signs"],
            }
            for term in described["terms"]
        ],
        "conventions": said | {"texels": CONVENTIONS["texels"]} | _SUM_IMAGES,
    }


def write_json(path: str | os.PathLike[str], obj: Any) -> None:
    """Write `obj` as indented UTF-8 JSON, whole or not at all.

    Raises BadInput for values that JSON does not support (including NaN and infinities), and if the file cannot be
    written.
    """
    try:
        text = json.dumps(obj, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    except (TypeError, ValueError) as error:
        raise BadInput(f"not JSON ({error})", where=path, expected="plain finite values") from error
    write_text(path, text)
