"""A fit as a layer of the viewer: its generated shader text, the textures it reads, what an evaluation costs.

The page asks for `vec3 KEY_evaluate(vec3 wi, vec3 wo)`. Three channels that are no spectrum are red, green and blue;
one channel is grey, the three being equal; anything else is refused, since no three of many channels are the colour.
Texels go as they are stored: a texture that was fitted to 8 bits (`factor.quantize`) as bytes with its scale and bias,
which the shader decodes behind the sampler as any renderer would, every other one as float32. WebGL 2 has no
filtered 16-bit whole numbers: those go as the float32 that they stand for.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from homofact.brdf.channels import wavelengths_of
from homofact.errors import BadInput
from homofact.factor.factorization import Factorization, Term
from homofact.factor.fitted import Fitted
from homofact.separable.separable import Separable
from homofact.shading.cost import cost_of
from homofact.shading.encoding import Encoded, as_floats, encode_term
from homofact.shading.fitted_program import fitted_program, textures_of
from homofact.shading.languages import GLSL, shader
from homofact.shading.program import Program
from homofact.viewer.viewer import Facts, Layer, LayerTexture

EIGHT_BITS = 255
_LETTERS = {
    "wi": "ωi", "wo": "ωo", "theta_i": "θi", "theta_o": "θo", "theta_h": "θh", "theta_d": "θd", "phi_d": "φd",
    "phi_h": "φh", "delta_phi": "Δφ",
}  # fmt: skip
_SPACES = {
    "in-out": "ωi, ωo", "half-diff": "h, d", "isotropic-half-diff": "θh, θd, φd", "isotropic-in-out": "θi, θo, Δφ",
    "half-angles": "θh, φh",
}  # fmt: skip


def fit_layer(fitted: Fitted, key: str, title: str, facts: Facts = ()) -> Layer:
    """The layer of a factorization or a separable fit; `facts` come before what it costs.

    Raises BadInput for channels that the page cannot show, and for a fit that is neither.
    """
    check_shown(fitted.channels)
    if isinstance(fitted, Factorization):
        encoded = [encode_term(term, _storage(term)) for term in fitted.terms]
        captions = [_caption(term) for term in fitted.terms]
        masks = [term.flat().mask for term in fitted.terms]
        quantity = "log"
    elif isinstance(fitted, Separable):
        encoded = [as_floats(texture) for texture in textures_of(fitted)]
        captions = _separable_captions(fitted)
        masks = [fitted.read] * len(encoded)
        quantity = "factor"
    else:
        raise BadInput(f"layer {key}: found a {type(fitted).__name__}, expected a factorization or a separable one")
    program = fitted_program(fitted, encoded)
    textures = tuple(
        _texture(f"{_prefix(program, key)}_texture_{k}", each, caption, mask.cpu().numpy(), quantity)
        for k, (each, caption, mask) in enumerate(zip(encoded, captions, masks, strict=True))
    )
    return Layer(key, title, _glsl(program, key), textures, (*facts, *_costs(program, encoded)))


def check_shown(channels: Sequence[str]) -> None:
    """Raise BadInput for channels that are neither one nor red, green and blue."""
    if len(channels) == 1 or (len(channels) == 3 and wavelengths_of(channels) is None):
        return
    listed = ", ".join(channels[:3]) + (" …" if len(channels) > 3 else "")
    raise BadInput(f"channels: found {len(channels)} ({listed}), expected 1 or RGB to show: fit with --channels rgb")


def _storage(term: Term) -> str:
    return "unorm8" if term.grid is not None and term.grid.levels == EIGHT_BITS else "float32"


def _prefix(program: Program, key: str) -> str:
    """What the generated names begin with: `key` itself, unless its function gives one number and not three."""
    return key if len(program.channels) == 3 else f"{key}_grey"


def _glsl(program: Program, key: str) -> str:
    text = shader(program, GLSL, _prefix(program, key))
    if len(program.channels) == 3:
        return text
    return f"{text}\nvec3 {key}_evaluate(vec3 wi, vec3 wo) {{\n    return vec3({key}_grey_evaluate(wi, wo));\n}}\n"


def _texture(name: str, encoded: Encoded, caption: str, mask: np.ndarray, quantity: str) -> LayerTexture:
    stored = encoded.stored
    # Four channels, as every GPU holds them; the last one is never read.
    pixels = np.full((*stored.shape[:2], 4), EIGHT_BITS if stored.dtype == np.uint8 else 1, stored.dtype)
    pixels[..., :3] = stored
    if stored.dtype != np.uint8:
        return LayerTexture(name, pixels, caption, mask, quantity=quantity)
    scale, bias = (_three(values) for values in (encoded.scale, encoded.bias))
    return LayerTexture(name, pixels, caption, mask, scale, bias, quantity)


def _three(values: np.ndarray) -> tuple[float, float, float]:
    red, green, blue = np.broadcast_to(values, 3).tolist()
    return red, green, blue


def _caption(term: Term) -> str:
    """What the texture is indexed by, in the field's letters: "θh, θd, warped", "searched in θi, θo, Δφ"."""
    projection = term.projection
    if projection.rotation is None:
        where = ", ".join(_LETTERS.get(axis, axis) for axis in projection.name.split("-"))
    else:
        where = f"{projection.name} in {_SPACES.get(projection.coordinates, projection.coordinates)}"
    return where if projection.warp is None else f"{where}, warped"


def _separable_captions(fitted: Separable) -> list[str]:
    sides = ("ωi", "ωo") if fitted.parameterization == "in-out" else ("h", "d")
    names = []
    for k, term in enumerate(fitted.terms, 1):
        shared = len(term.textures) == 1
        names += [f"term {k}: {' and '.join(sides)}"] if shared else [f"term {k}: {side}" for side in sides]
    return [f"{name}, {fitted.map}" for name in names]


def _costs(program: Program, encoded: Sequence[Encoded]) -> Facts:
    """Textures, their bytes without the fourth channel, fetches, operations beyond the change of frame."""
    cost = cost_of(program, sum(each.stored.nbytes for each in encoded))
    kinds = Counter(
        f"{columns} × {rows}{', 8 bit' if each.stored.dtype == np.uint8 else ''}"
        for (rows, columns), each in zip(program.shapes, encoded, strict=True)
    )
    return (
        ("Textures", "; ".join(f"{count} of {kind}" for kind, count in kinds.items())),
        ("Bytes", f"{cost.nbytes:,}"),
        ("Fetches", str(cost.fetches)),
        ("Operations (scalar)", f"{cost.total} ({cost.scalar})"),
    )
