"""WebGPU for tests: a shader run over pairs of directions, on whatever adapter there is, a software one included."""

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch

_BYTES = {"r8uint": 1, "rgba8unorm": 4, "rgba16float": 8, "rgba32float": 16}
SAMPLER = 16  # where shaders under test have their sampler
GLSL_BUFFERS = """layout(local_size_x = 64) in;
layout(set = 1, binding = 0) readonly buffer Lights { vec4 lights[]; };
layout(set = 1, binding = 1) readonly buffer Viewers { vec4 viewers[]; };
layout(set = 1, binding = 2) buffer Values { vec4 values[]; };
"""


def wgsl_main(*lines: str) -> str:
    """An entry point with `lines` for every id.x: `lights` and `viewers` are read, `values` written."""
    return (
        "\n@group(1) @binding(0) var<storage, read> lights: array<vec4<f32>>;"
        "\n@group(1) @binding(1) var<storage, read> viewers: array<vec4<f32>>;"
        "\n@group(1) @binding(2) var<storage, read_write> values: array<vec4<f32>>;"
        "\n\n@compute @workgroup_size(64)\nfn main(@builtin(global_invocation_id) id: vec3<u32>) {"
        f"\n    if (id.x < arrayLength(&values)) {{{_indented(lines)}\n    }}\n}}\n"
    )


def hlsl_main(*lines: str) -> str:
    """The same in HLSL."""
    return (
        "\n[[vk::binding(0, 1)]] StructuredBuffer<float4> lights;"
        "\n[[vk::binding(1, 1)]] StructuredBuffer<float4> viewers;"
        "\n[[vk::binding(2, 1)]] RWStructuredBuffer<float4> values;"
        "\n\n[numthreads(64, 1, 1)]\nvoid main(uint3 id : SV_DispatchThreadID)\n{"
        "\n    uint count, stride;\n    values.GetDimensions(count, stride);"
        f"\n    if (id.x < count) {{{_indented(lines)}\n    }}\n}}\n"
    )


def glsl_main(*lines: str) -> str:
    """The same in GLSL behind GLSL_BUFFERS; the id is k."""
    head = "\nvoid main() {\n    uint k = gl_GlobalInvocationID.x;\n    if (k < values.length()) {"
    return f"{head}{_indented(lines)}\n    }}\n}}\n"


def _indented(lines: tuple[str, ...]) -> str:
    return "".join(f"\n        {line}" for line in lines)


WGSL_MAIN = wgsl_main("let value = fit_evaluate(lights[id.x].xyz, viewers[id.x].xyz);", "values[id.x] = WIDENED;")
WIDENED = {1: "(value, 0.0, 0.0, 0.0)", 3: "(value, 0.0)", 4: "(value)"}
_FEATURES = ("float32-filterable", "texture-compression-bc")


@dataclass(frozen=True)
class Image:
    """Bytes of one texture's texels or blocks, rows from the top, and WebGPU's name of their format.

    Formats: rgba8unorm, rgba16float, rgba32float, for BC6H bc6h-rgb-float, for labels r8uint. Of a texture array the
    layers stand one under another, `rows` counts those of all. A cube map has `levels`, largest first, each with its
    six faces one under another; `rows` counts those of the first.
    """

    format: str
    rows: int
    columns: int
    data: bytes
    layers: int = 0
    levels: int = 0

    @classmethod
    def cube(cls, levels: Sequence[np.ndarray]) -> "Image":
        """Levels (6, N, N, 3) of a cube map as float32."""
        wide = [np.concatenate((level, np.ones_like(level[..., :1])), -1).astype(np.float32) for level in levels]
        side = levels[0].shape[1]
        return cls("rgba32float", 6 * side, side, b"".join(each.tobytes() for each in wide), 6, len(levels))

    @classmethod
    def of(cls, texels: np.ndarray) -> "Image":
        """float32 or uint8 texels (rows, columns, C), as RGBA."""
        rows, columns, channels = texels.shape
        wide = np.zeros((rows, columns, 4), texels.dtype)
        wide[..., :channels] = texels
        return cls("rgba8unorm" if texels.dtype == np.uint8 else "rgba32float", rows, columns, wide.tobytes())


class Gpu:
    """A device with what the tests need of it."""

    def __init__(self) -> None:
        """Take the first adapter; skip the test where there is none."""
        self.wgpu = pytest.importorskip("wgpu", reason="wgpu is missing: pip install homofact[dev]")
        try:
            adapter = self.wgpu.gpu.request_adapter_sync(power_preference="high-performance")
        except Exception as error:
            pytest.skip(f"no WebGPU adapter ({error}): Debian's mesa-vulkan-drivers has one in software")
        missing = [feature for feature in _FEATURES if feature not in adapter.features]
        if missing:
            pytest.skip(f"the WebGPU adapter {adapter.summary} lacks {', '.join(missing)}")
        self.device = adapter.request_device_sync(required_features=list(_FEATURES))

    def compiled(self, code: str | bytes):
        """The shader module of WGSL or SPIR-V, validated by naga."""
        return self.device.create_shader_module(code=code)

    def run(
        self, code: str | bytes, images: Sequence[Image], wi: torch.Tensor, wo: torch.Tensor, sampler_at: int | None
    ) -> np.ndarray:
        """What the entry point `main` writes for each pair, (N, 4).

        Group 0 holds the images from binding 0 and a sampler, linear and clamped, at `sampler_at` (None: there is no
        group 0); group 1 arrays of wi, wo (4 floats each, 3 used) and of the values written. A workgroup takes 64
        pairs.
        """
        module = self.compiled(code)
        pipeline = self.device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": "main"})
        own = [{"binding": k, "resource": self._uploaded(image)} for k, image in enumerate(images)]
        sampler = self.device.create_sampler(mag_filter="linear", min_filter="linear", mipmap_filter="linear")
        if sampler_at is not None:
            own.append({"binding": sampler_at, "resource": sampler})
        count = len(wi)
        buffers = [self._buffer(directions) for directions in (wi, wo)]
        usage = self.wgpu.BufferUsage.STORAGE | self.wgpu.BufferUsage.COPY_SRC
        buffers.append(self.device.create_buffer(size=count * 16, usage=usage))
        whole = [{"binding": k, "resource": {"buffer": buffer}} for k, buffer in enumerate(buffers)]
        encoder = self.device.create_command_encoder()
        work = encoder.begin_compute_pass()
        work.set_pipeline(pipeline)
        for group, entries in enumerate((own, whole)):
            if not entries:
                continue
            layout = pipeline.get_bind_group_layout(group)
            work.set_bind_group(group, self.device.create_bind_group(layout=layout, entries=entries))
        work.dispatch_workgroups(-(-count // 64))
        work.end()
        self.device.queue.submit([encoder.finish()])
        return np.frombuffer(self.device.queue.read_buffer(buffers[2]), np.float32).reshape(count, 4).copy()

    def _buffer(self, directions: torch.Tensor):
        wide = np.zeros((len(directions), 4), np.float32)
        wide[:, : directions.shape[1]] = directions.numpy()
        return self.device.create_buffer_with_data(data=wide, usage=self.wgpu.BufferUsage.STORAGE)

    def _uploaded(self, image: Image):
        count, levels = max(image.layers, 1), max(image.levels, 1)
        size = (image.columns, image.rows // count, count)
        usage = self.wgpu.TextureUsage.TEXTURE_BINDING | self.wgpu.TextureUsage.COPY_DST
        texture = self.device.create_texture(size=size, format=image.format, usage=usage, mip_level_count=levels)
        at = 0
        for level in range(levels):
            columns, rows = size[0] >> level, size[1] >> level
            # A row of blocks is 16 bytes for 4 columns.
            pitch = columns * _BYTES.get(image.format, 4)
            rows_stored = rows if image.format in _BYTES else rows // 4
            layout = {"bytes_per_row": pitch, "rows_per_image": rows_stored}
            whole = pitch * rows_stored * count
            place = {"texture": texture, "mip_level": level}
            self.device.queue.write_texture(place, image.data[at : at + whole], layout, (columns, rows, count))
            at += whole
        assert at == len(image.data)
        return texture.create_view(dimension="cube" if image.levels else "2d-array" if image.layers else "2d")


def glslang(code: str, folder: Path, stage: str, *options: str) -> bytes:
    """SPIR-V where `options` ask for it; fails with the compiler's messages."""
    tool = shutil.which("glslangValidator")
    if tool is None:
        pytest.skip("glslangValidator is missing: Debian's package glslang-tools")
    source, result = folder / f"shader.{stage}", folder / "shader.spv"
    source.write_text(code, encoding="utf-8")
    output = ["-o", str(result)] if "-V" in options else []
    done = subprocess.run([tool, "-S", stage, *options, *output, str(source)], capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stdout}{done.stderr}\n{code}"
    assert "WARNING" not in done.stdout, done.stdout
    return result.read_bytes() if output else b""
