"""A material for Godot 4 in a folder to copy into a project: a spatial shader whose `light()` is the fit, its textures.

Godot's editor reads how to import a file from the .import beside it, and adds what is missing there. Without one it
would compress the texels (BC6H, which has no negative numbers) as soon as it sees them used in 3D, and take brdf.glsl
for a compute shader with errors.
"""

import torch

from homofact.exporting.as_source import knows_no_azimuth
from homofact.exporting.engines.base import Added, Engine, check_colour, template
from homofact.exporting.exported import Exported
from homofact.exporting.gltf_fit import fit_metallic_roughness
from homofact.files.words import in_markdown
from homofact.rendering.tonemap import encode_srgb
from homofact.shading.languages import GLSL, GODOT, shader
from homofact.shading.program import name_of
from homofact.version import __version__

NAME, MATERIAL = "brdf.gdshader", "brdf.tres"
# compress/mode 3 is "VRAM uncompressed", what "lossless" becomes for floats.
TEXTURE = """[remap]

importer="texture"
type="CompressedTexture2D"

[params]

compress/mode=3
compress/high_quality=false
compress/hdr_compression=0
compress/normal_map=2
compress/channel_pack=0
mipmaps/generate=false
process/fix_alpha_border=false
process/premult_alpha=false
process/hdr_as_srgb=false
process/hdr_clamp_exposure=false
process/size_limit=0
detect_3d/compress_to=0
"""
KEPT = '[remap]\n\nimporter="keep"\n'


def _files(made: Exported) -> Added:
    check_colour(made, "godot")
    look = fit_metallic_roughness(made.stored, knows_no_azimuth(made.stored), extensions=False)
    colour = look.base_colour if len(look.base_colour) == 3 else look.base_colour * 3
    numbers = {
        "ALBEDO": ", ".join(f"{x:.6f}" for x in colour),
        "CODED": ", ".join(f"{x:.6f}" for x in encode_srgb(torch.tensor(colour, dtype=torch.float64)).tolist()),
        "METALLIC": f"{look.metallic:.6f}",
        "ROUGHNESS": f"{look.roughness:.6f}",
    }
    files = {
        NAME: template("godot.gdshader", PROGRAM=shader(made.program, GODOT), **numbers),
        MATERIAL: _material(made.names),
        "README.md": template("godot.md", NAME=in_markdown(name_of(made.stored.provenance)), VERSION=__version__),
        f"brdf{GLSL.suffix}.import": KEPT,
        **{f"{name}.import": TEXTURE for name in made.names},
    }
    if made.prefiltered is not None:
        files[f"prefiltered{GLSL.suffix}.import"] = KEPT
    return Added(files, {"environment": look})


def _material(names: tuple[str, ...]) -> str:
    """The text of a ShaderMaterial of the shader and these textures, by paths relative to it."""
    lines = [f'[gd_resource type="ShaderMaterial" load_steps={len(names) + 2} format=3]', ""]
    lines += [f'[ext_resource type="Shader" path="{NAME}" id="shader"]']
    lines += [f'[ext_resource type="Texture2D" path="{name}" id="{k}"]' for k, name in enumerate(names)]
    lines += ["", "[resource]", 'shader = ExtResource("shader")']
    lines += [f'shader_parameter/homofact_texture_{k} = ExtResource("{k}")' for k in range(len(names))]
    return "\n".join(lines) + "\n"


GODOT_ENGINE = Engine("godot", ("exr16", "exr", "png8"), _files)
