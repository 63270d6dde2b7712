"""Draw a sphere of a fit with Mitsuba 3 and the plugin `homofact`, with the same framing as `render_sphere`."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.rendering.mitsuba_bsdf import load_bsdf, open_mitsuba

SAMPLES = 1024  # paths a pixel


def mitsuba_sphere(
    result: Path, size: int, radius: float, lights: Sequence[DirectionalLight] = (),
    environment: EnvironmentMap | None = None, samples: int = SAMPLES,
) -> np.ndarray:  # fmt: skip
    """Linear radiance (size, size, 3) of the unit sphere, rows from the top; `result` is a fit's folder or saved file.

    Lights have one number. Raises MissingDependency without Mitsuba, BadInput for a fit that it cannot show.
    """
    mi = open_mitsuba()
    at = mi.ScalarTransform4f()
    scene = {
        "type": "scene",
        "integrator": {"type": "direct", "hide_emitters": True},
        "sensor": {
            "type": "orthographic",
            "to_world": at.look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]) @ at.scale([1 / radius, 1 / radius, 1]),
            "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
            "sampler": {"type": "multijitter", "sample_count": samples},
        },
        # Turned so that its first texture coordinate runs round the y axis, as our tangents do.
        "ball": {"type": "sphere", "to_world": at.rotate([1, 0, 0], -90), "bsdf": load_bsdf(result)},
    }
    for k, light in enumerate(lights):
        towards = [-x for x in light.unit().tolist()]
        irradiance = {"type": "rgb", "value": light.levels()[0]}
        scene[f"light_{k}"] = {"type": "directional", "direction": towards, "irradiance": irradiance}
    if environment is not None:
        map_ = np.broadcast_to(environment.radiance.numpy(), (*environment.radiance.shape[:2], 3))
        # The middle of Mitsuba's map is at +z.
        turned = 180 + np.degrees(environment.turn)
        bitmap = mi.Bitmap(np.ascontiguousarray(map_, np.float32))
        scene["sky"] = {"type": "envmap", "bitmap": bitmap, "to_world": at.rotate([0, 1, 0], turned)}
    return np.array(mi.render(mi.load_dict(scene)))[..., :3]
