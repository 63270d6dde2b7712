"""Write one self-contained HTML file that shows a fit, McCool's fit and the source on a lit sphere or mesh.

The page is `page.html` with `page.css`, the scripts and the data inserted. It loads no other file; its
Content-Security-Policy forbids that (`assembly`). It renders with WebGL 2 and names missing features in a message.
`packing` encodes its arrays.

A layer provides reflectance to the page. It consists of shader text that defines `vec3 KEY_evaluate(vec3 wi, vec3 wo)`,
the BRDF in sr⁻¹ without the cosine for unit directions in the surface frame, and of the textures that this text
declares.
"""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.scattered import interpolated_samples
from homofact.errors import BadInput
from homofact.files.atomic import write_bytes
from homofact.meshes.mesh import Mesh
from homofact.meshes.shapes import torus_knot
from homofact.web.assembly import assembled, part
from homofact.web.packing import differences, pack
from homofact.web.source_table import STEP, SourceTable, source_table

PACKAGE = "homofact.web"
SCRIPTS = (
    "data.js", "elements.js", "vectors.js", "files.js", "hdr.js", "latlong.js", "tones.js", "webgl.js", "sky.js",
    "lighting.js", "occlusion.js", "shading.js", "mesh.js", "targets.js", "stage.js", "curve.js", "cards.js",
    "saving.js", "link.js", "controls.js", "page.js",
)  # fmt: skip
SOURCE = "source"
# Round and across the tube of the knot that a page has where no mesh is given.
KNOT = (112, 12)
Facts = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class LayerTexture:
    """One texture of a layer.

    `name` is the sampler2D in the shader text; `pixels` (rows, columns, 4) float32, float16 or uint8, row 0 at texture
    coordinate 0; `caption` names the texture's projection; `mask` (rows, columns), if given, is False at texels that no
    pair of directions reads. The other attributes are only for the displayed pictures of textures: the value of a texel
    is pixel · `scale` + `bias` in its first three channels (for uint8, pixel/255), or the pixel itself if both are
    None. `quantity` names the kind of value: "log" for the textures of a product, "factor" for those of a sum of
    products.
    """

    name: str
    pixels: np.ndarray
    caption: str
    mask: np.ndarray | None = None
    scale: tuple[float, float, float] | None = None
    bias: tuple[float, float, float] | None = None
    quantity: str = "log"

    def __post_init__(self) -> None:
        """Reject invalid shapes and types, and texels that are not finite."""
        if self.pixels.ndim != 3 or self.pixels.shape[2] != 4 or 0 in self.pixels.shape:
            raise BadInput(f"pixels have shape {self.pixels.shape}", where=self.name, expected="(rows, columns, 4)")
        if self.pixels.dtype.name not in ("float32", "float16", "uint8"):
            raise BadInput(f"pixels are {self.pixels.dtype}", where=self.name, expected="float32, float16 or uint8")
        if not np.isfinite(self.pixels).all():
            raise BadInput("a texel is not finite", where=self.name, expected="finite texels")
        if self.mask is not None and self.mask.shape != self.pixels.shape[:2]:
            raise BadInput(f"the mask has shape {self.mask.shape}", where=self.name, expected=self.pixels.shape[:2])
        if (self.scale is None) != (self.bias is None):
            raise BadInput("scale without bias", where=self.name, expected="both or none")


@dataclass(frozen=True)
class Layer:
    """A reflectance that the page shows as one picture.

    `key` is the prefix in `glsl` and identifies the layer ("fit", "mccool", "source"). The page shows differences from
    "source", or from the last layer if there is no source. `title` is the displayed name. `facts` are (name, value)
    pairs for the table of numbers; layers share a column for equal names. `table` is the source's table. `measured_to`
    is the largest angle in degrees of a source known only at its samples.
    """

    key: str
    title: str
    glsl: str
    textures: tuple[LayerTexture, ...]
    facts: Facts = ()
    table: SourceTable | None = None
    measured_to: float | None = None

    def __post_init__(self) -> None:
        """Reject a key that is no GLSL identifier, and shader text without the function or textures of the layer."""
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.key):
            raise BadInput(f"key is {self.key!r}", where="layer", expected="small letters, digits and _")
        names = [f"vec3 {self.key}_evaluate", *(texture.name for texture in self.textures)]
        missing = [name for name in names if name not in self.glsl]
        if missing:
            raise BadInput(f"its shader text has no {missing[0]}", where=f"layer {self.key}", expected="it to")


def source_layer(reflectance: Reflectance, facts: Facts = (), seed: int = 0) -> Layer:
    """Return the source as a layer with a `source_table`; its facts state the number of samples, if it has some.

    Raises BadInput as `source_table`.
    """
    table, samples = source_table(reflectance, seed=seed), interpolated_samples(reflectance)
    measured = None if samples is None else samples.largest_angle
    facts = (*facts, ("Textures", "none" if samples is None else f"none ({len(samples):,} samples)"))
    return Layer(SOURCE, "Source", table.glsl(SOURCE), (), facts, table, measured)


def viewer_html(
    layers: Sequence[Layer], *, title: str, subtitle: str = "", mesh: Mesh | None = None, notes: Sequence[str] = ()
) -> str:
    """Return the HTML text of the page.

    `layers` are one to three layers in the order of the pictures. `title` and `subtitle` are the page's headings. If
    `mesh` is given, the page shows it first; otherwise it shows a sphere first and offers a torus knot. `notes` are
    lines of text beside the picture; the page adds a note on the error of the source's table. Raises BadInput for no or
    more than three layers, and for keys that repeat.
    """
    keys = [layer.key for layer in layers]
    if not 1 <= len(keys) <= 3 or len(set(keys)) < len(keys):
        found = f"the layers {', '.join(keys) or 'none'}"
        raise BadInput(where="viewer", found=found, expected="one to three different ones")
    own = [
        f"The page draws {layer.title} from a table of {layer.table.size} nodes, and interpolates its logarithms. At"
        f" {layer.table.error.count:,} random cosine-weighted pairs of directions, the table differs from the source by"
        f" {layer.table.error.words()}. Only this page uses the table: the listed bytes do not include it."
        for layer in layers
        if layer.table is not None
    ]
    data = {
        "layers": [_layer(layer) for layer in layers],
        "mesh": {**_mesh(_knot() if mesh is None else mesh), "first": mesh is not None},
        "notes": [*notes, *own],
    }
    return assembled(
        part(PACKAGE, "page.html"),
        title=title,
        subtitle=subtitle,
        styles=[part(PACKAGE, "page.css")],
        scripts=[part(PACKAGE, name) for name in SCRIPTS],
        data=data,
    )


def write_viewer(
    path: str | os.PathLike[str],
    layers: Sequence[Layer],
    *,
    title: str,
    subtitle: str = "",
    mesh: Mesh | None = None,
    notes: Sequence[str] = (),
    new: bool = False,
) -> int:
    """Write `viewer_html` to `path` atomically, and return its size in bytes.

    If `new`, an existing file is an error. Raises BadInput as `viewer_html` does, and for a path that cannot be
    written.
    """
    data = viewer_html(layers, title=title, subtitle=subtitle, mesh=mesh, notes=notes).encode("utf-8")
    write_bytes(path, data, new=new)
    return len(data)


def _layer(layer: Layer) -> dict[str, Any]:
    table, volume = layer.table, None
    if table is not None:
        volume = {"name": f"{layer.key}_texture_0", "step": STEP, "steps": pack(table.differences())}
    return {
        "key": layer.key,
        "title": layer.title,
        "glsl": layer.glsl,
        "textures": [_texture(texture) for texture in layer.textures],
        "facts": [list(fact) for fact in layer.facts],
        "volume": volume,
        "measuredTo": layer.measured_to,
    }


def _texture(texture: LayerTexture) -> dict[str, Any]:
    reached = texture.mask is None or bool(texture.mask.all())
    return {
        "name": texture.name,
        "caption": texture.caption,
        "texels": pack(texture.pixels),
        "mask": None if reached else pack(np.packbits(np.asarray(texture.mask, bool).reshape(-1))),
        "scale": texture.scale,
        "bias": texture.bias,
        "quantity": texture.quantity,
    }


@cache
def _knot() -> Mesh:
    """Return the page's default mesh, its vertices in the order of use by triangles, which compresses well."""
    made = torus_knot(*KNOT)
    corners = made.triangles.reshape(-1)
    order = corners[np.sort(np.unique(corners, return_index=True)[1])]
    place = np.empty(len(made.positions), np.int64)
    place[order] = np.arange(len(order))
    return Mesh(made.positions[order], made.normals[order], place[made.triangles], "Knot")


def _mesh(mesh: Mesh) -> dict[str, Any]:
    positions = np.round((mesh.positions + 1) / 2 * 65535).clip(0, 65535).astype(np.uint16)
    n = mesh.normals / np.abs(mesh.normals).sum(1, keepdims=True)
    # The octahedral map: the lower half folded over the upper one's corners.
    signs = np.where(n[:, :2] < 0, -1.0, 1.0)
    flat = np.where(n[:, 2:] < 0, (1 - np.abs(n[:, 1::-1])) * signs, n[:, :2])
    return {
        "name": mesh.name,
        "positions": pack(positions),
        "normals": pack(np.round(flat * 32767).astype(np.int16)),
        "triangles": pack(differences(mesh.triangles.astype(np.int32).reshape(-1), (0,))),
    }
