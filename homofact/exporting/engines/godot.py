"""A material for Godot 4, as a folder to copy into a project: textures and a shader whose `light()` is the fit.

With a prefiltered sky, `fragment()` reads the levels of the sky as the material's own table directs
(`rendering.prefilter`), and emits the light that the fit reflects. The engine's ambient light is then off. Without a
prefiltered sky, the look-alike reflects Godot's sky. The levels are stored as a Godot resource
(`containers.godot_cubemap`), because Godot's image importer would compute the levels of a cube map itself.

Godot's editor reads the import settings of a file from the .import file beside it, and adds missing settings. Without a
.import file, the editor would compress the texels as BC6H, without negative numbers, as soon as a 3D material uses
them. It would also read brdf.glsl as a compute shader and report errors.
"""

from collections.abc import Mapping

import torch

from homofact.containers.godot_cubemap import godot_cubemap
from homofact.exporting.as_source import knows_no_azimuth
from homofact.exporting.engines.base import Added, Engine, check_colour, fit_notes, template
from homofact.exporting.exported import Exported
from homofact.exporting.gltf_fit import fit_metallic_roughness
from homofact.exporting.look_alike import AddedLookAlike, likeness
from homofact.exporting.prefiltered import PREFIX, PrefilteredExport, with_alpha
from homofact.files.words import in_markdown
from homofact.rendering.tonemap import encode_srgb
from homofact.shading.languages import GLSL, GODOT, shader
from homofact.shading.program import name_of
from homofact.version import __version__

NAME, MATERIAL = "brdf.gdshader", "brdf.tres"
SKY, LIT = "prefiltered_sky.tres", "prefiltered_irradiance.tres"
_LOOK = """Sky and ambient light are reflected by ALBEDO,
// METALLIC and ROUGHNESS, the metallic-roughness material that looks most like the fit."""
_FIT = """One sky is reflected by the fit, as EMISSION.
// Godot's own ambient light, reflection probes and lightmaps are off. ALBEDO, METALLIC and ROUGHNESS serve bounced
// light: the metallic-roughness material that looks most like the fit."""
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
    light = made.prefiltered
    numbers = {
        "ALBEDO": ", ".join(f"{x:.6f}" for x in colour),
        "CODED": ", ".join(f"{x:.6f}" for x in encode_srgb(torch.tensor(colour, dtype=torch.float64)).tolist()),
        "METALLIC": f"{look.metallic:.6f}",
        "ROUGHNESS": f"{look.roughness:.6f}",
    }
    textures = {f"homofact_texture_{k}": ("Texture2D", name) for k, name in enumerate(made.names)}
    parts = {"RENDER_MODE": "", "SURROUNDINGS": _LOOK, "SKY": "", "EMISSION": ""}
    files: dict[str, str | bytes] = {}
    if light is not None:
        table, *_ = light.names
        kinds = (("Texture2D", table), ("Cubemap", SKY), ("Cubemap", LIT))
        textures |= {f"{PREFIX}_texture_{k}": each for k, each in enumerate(kinds)}
        parts = _sky_parts(light)
        for name, levels in ((SKY, light.data.sky.levels), (LIT, [light.data.sky.irradiance])):
            files[name] = godot_cubemap(name, with_alpha(levels))
        files |= {f"{table}.import": TEXTURE, f"prefiltered{GLSL.suffix}.import": KEPT}
    files |= {
        NAME: template("godot.gdshader", PROGRAM=shader(made.program, GODOT), **numbers, **parts),
        MATERIAL: _material(textures),
        "README.md": _readme(made),
        f"brdf{GLSL.suffix}.import": KEPT,
        **{f"{name}.import": TEXTURE for name in made.names},
    }
    if light is not None:
        return Added(files)
    return AddedLookAlike(files, {"environment": look}, likeness=likeness(look, made.stored, under_sky_alone=True))


def _readme(made: Exported) -> str:
    """The folder's README."""
    light = made.prefiltered
    names = {"NAME": in_markdown(name_of(made.stored.provenance)), "VERSION": __version__}
    names["NOTES"] = fit_notes(made)
    if light is None:
        return template("godot.md", SURROUNDINGS=template("godot_look.md").rstrip(), **names)
    sky = {"SKY": in_markdown(light.data.sky.name), "ERROR": f"{light.error:.1%}"}
    return template("godot.md", SURROUNDINGS=template("godot_sky.md", **sky).rstrip(), **names)


def _sky_parts(light: PrefilteredExport) -> dict[str, str]:
    """What the shader has more if it reads a prefiltered sky."""
    program = light.data.program((f"The fit under {light.data.sky.name}: radiance towards wo, linear.",), 0)
    frame = "n, wo" if light.data.material.across is None else "n, t, cross(n, t), wo"
    turned = "    vec3 t = homofact_in_sky((INV_VIEW_MATRIX * vec4(homofact_tangent(NORMAL, TANGENT), 0.0)).xyz);\n"
    return {
        "RENDER_MODE": "render_mode ambient_light_disabled;\n",
        "SURROUNDINGS": _FIT,
        "SKY": template("godot_sky.gdshader", PROGRAM=shader(program, GODOT, PREFIX)),
        "EMISSION": (
            "    vec3 n = homofact_in_sky((INV_VIEW_MATRIX * vec4(NORMAL, 0.0)).xyz);\n"
            "    vec3 wo = homofact_in_sky((INV_VIEW_MATRIX * vec4(VIEW, 0.0)).xyz);\n"
            f"{turned * (light.data.material.across is not None)}"
            f"    vec3 reflected = {PREFIX}_reflected({frame}) * sky_energy;\n"
            "    EMISSION = OUTPUT_IS_SRGB ? homofact_coded(reflected) : reflected;\n"
        ),
    }


def _material(textures: Mapping[str, tuple[str, str]]) -> str:
    """The text of a ShaderMaterial of the shader and these textures: by uniform, their type and the path beside it."""
    lines = [f'[gd_resource type="ShaderMaterial" load_steps={len(textures) + 2} format=3]', ""]
    lines += [f'[ext_resource type="Shader" path="{NAME}" id="shader"]']
    lines += [
        f'[ext_resource type="{kind}" path="{name}" id="{k}"]' for k, (kind, name) in enumerate(textures.values())
    ]
    lines += ["", "[resource]", 'shader = ExtResource("shader")']
    lines += [f'shader_parameter/{uniform} = ExtResource("{k}")' for k, uniform in enumerate(textures)]
    return "\n".join(lines) + "\n"


GODOT_ENGINE = Engine("godot", ("exr16", "exr", "png8"), _files, "fitting Godot's material, for its sky")
