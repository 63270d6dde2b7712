"""A fit as a layer of the viewer: its generated shader text, its textures, and the cost of an evaluation.

The page calls `vec3 KEY_evaluate(vec3 wi, vec3 wo)`. Three channels that are not a spectrum are red, green and blue,
and a single channel is grey. Other numbers of channels are rejected, since they do not define a colour. Texels are
passed as they are stored. A texture that was fitted to 8 bits (`factor.quantize`) is passed as bytes with its scale and
bias, and the shader decodes it after the sampler as any renderer would. Every other texture is float32. WebGL 2 cannot
filter 16-bit integers, so these are converted to float32.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from homofact.brdf.wavelengths import wavelengths_of
from homofact.errors import Advice, BadInput
from homofact.factor.fitted import Fitted, Texture
from homofact.shading.cost import cost_of
from homofact.shading.encoding import Encoded, encode_texture
from homofact.shading.languages import GLSL, shader
from homofact.shading.program import Program, program_of
from homofact.web.viewer import Facts, Layer, LayerTexture

EIGHT_BITS = 255


def fit_layer(fitted: Fitted, key: str, title: str, facts: Facts = ()) -> Layer:
    """Return the layer of a fit; its facts are `facts`, then the cost of an evaluation.

    Raises BadInput for channels that the page cannot show.
    """
    check_shown(fitted.channels)
    whole = (texture.grid is not None and texture.grid.levels == EIGHT_BITS for texture in fitted.textures)
    stored = ("unorm8" if each else "float32" for each in whole)
    encoded = [encode_texture(*each) for each in zip(fitted.textures, stored, strict=True)]
    program = program_of(fitted, encoded)
    textures = tuple(
        _texture(f"{_prefix(program, key)}_texture_{k}", each, texture)
        for k, (each, texture) in enumerate(zip(encoded, fitted.textures, strict=True))
    )
    return Layer(key, title, _glsl(program, key), textures, (*facts, *_costs(program, encoded, fitted.nbytes)))


def check_shown(channels: Sequence[str]) -> None:
    """Raise BadInput unless there is one channel, or red, green and blue."""
    if len(channels) == 1 or (len(channels) == 3 and wavelengths_of(channels) is None):
        return
    listed = ", ".join(channels[:3]) + (" …" if len(channels) > 3 else "")
    raise BadInput(
        where="channels",
        found=f"{len(channels)} ({listed})",
        expected="1 or RGB to show",
        hint=f"fit with {Advice('channels', 'rgb')}",
    )


def _prefix(program: Program, key: str) -> str:
    """Return the prefix of generated names: `key`, or another one if the program returns one number."""
    return key if len(program.channels) == 3 else f"{key}_grey"


def _glsl(program: Program, key: str) -> str:
    text = shader(program, GLSL, _prefix(program, key))
    if len(program.channels) == 3:
        return text
    return f"{text}\nvec3 {key}_evaluate(vec3 wi, vec3 wo) {{\n    return vec3({key}_grey_evaluate(wi, wo));\n}}\n"


def _texture(name: str, encoded: Encoded, texture: Texture) -> LayerTexture:
    stored, mask = encoded.stored, texture.mask
    # Four channels, as every GPU holds them; the last one is never read.
    pixels = np.full((*stored.shape[:2], 4), EIGHT_BITS if stored.dtype == np.uint8 else 1, stored.dtype)
    pixels[..., :3] = stored
    if stored.dtype != np.uint8:
        return LayerTexture(name, pixels, texture.caption, mask, quantity=texture.quantity)
    scale, bias = ((*np.broadcast_to(values, 3).tolist(),) for values in (encoded.scale, encoded.bias))
    return LayerTexture(name, pixels, texture.caption, mask, scale, bias, texture.quantity)


def _costs(program: Program, encoded: Sequence[Encoded], without_textures: int) -> Facts:
    """Return facts: textures, bytes without the fourth channel, fetches, and operations besides the change of frame.

    For a fit without textures, `without_textures` is its number of bytes.
    """
    cost = cost_of(program, sum(each.stored.nbytes for each in encoded) if encoded else without_textures)
    kinds = Counter(
        f"{rows} × {columns}{', 8 bit' if each.stored.dtype == np.uint8 else ''}"
        for (rows, columns), each in zip(program.shapes, encoded, strict=True)
    )
    return (
        ("Textures", "; ".join(f"{count} of {kind}" for kind, count in kinds.items()) or "none"),
        ("Bytes", f"{cost.nbytes:,}"),
        ("Fetches", str(cost.fetches)),
        ("Operations (scalar)", f"{cost.total} ({cost.scalar})"),
    )
