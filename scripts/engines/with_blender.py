"""Render pictures with Blender for the programs and tests that compare with it. This module runs `in_blender.py`.

The environment's HOMOFACT_BLENDER names Blender's program, or a Python that has bpy (the extra `blender`); else it is
this Python, if it has bpy, or `blender` on the path.
"""

import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.rendering.surface import RADIUS

PROGRAM = Path(__file__).with_name("in_blender.py")


def command() -> list[str] | None:
    """What runs `in_blender.py` but for its argument; None where there is no Blender."""
    named = os.environ.get("HOMOFACT_BLENDER")
    if named is None and find_spec("bpy") is not None:
        named = sys.executable
    named = named or shutil.which("blender")
    if named is None:
        return None
    if Path(named).stem.lower().startswith("blender"):
        return [named, "--background", "--factory-startup", "--python-exit-code", "1", "--python", str(PROGRAM), "--"]
    return [named, str(PROGRAM)]


def drawn(folder: Path, requests: Sequence[dict[str, Any]], seconds: float = 900) -> list[np.ndarray]:
    """The pictures (rows, columns, 4), linear, of requests as `in_blender.py` has them, drawn in `folder`.

    Raises RuntimeError with what Blender said where it fails.
    """
    asked = command()
    if asked is None:
        raise RuntimeError("no Blender: name one by HOMOFACT_BLENDER, or pip install 'homofact[blender]'")
    usual = {"size": 64, "radius": RADIUS, "samples": 1, "lamps": []}
    made = [usual | each | {"out": str(folder / f"{k}.npy")} for k, each in enumerate(requests)]
    place = folder / "requests.json"
    place.write_text(json.dumps(made), encoding="utf-8")
    done = subprocess.run([*asked, str(place)], capture_output=True, text=True, timeout=seconds)
    if done.returncode != 0:
        raise RuntimeError(done.stdout[-3000:] + done.stderr[-3000:])
    return [np.load(each["out"]) for each in made]


def sky_of(sky: EnvironmentMap) -> np.ndarray:
    """A map's radiance (rows, columns, 3) in Blender's layout, whose middle is at its +x, our viewer's right.

    A turn counts in whole columns.
    """
    radiance = np.broadcast_to(sky.radiance.numpy(), (*sky.radiance.shape[:2], 3)).astype(np.float32)
    columns = radiance.shape[1]
    return np.roll(radiance, -(columns // 4) - round(sky.turn / (2 * math.pi) * columns), 1)


def blender_sphere(
    folder: Path, script: Path, size: int, lamps: Sequence[DirectionalLight], sky: EnvironmentMap | None,
    samples: int = 1024, **more: Any,
) -> np.ndarray:  # fmt: skip
    """Linear radiance (size, size, 3) of the unit sphere in the material of a script, drawn in `folder`.

    `more` are settings of `in_blender.py`. Raises RuntimeError as `drawn`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    asked = {"script": str(script), "size": size, "lamps": [sun(light) for light in lamps]} | more
    if sky is not None:
        np.save(folder / "sky.npy", sky_of(sky))
        asked |= {"sky": str(folder / "sky.npy"), "samples": samples}
    return drawn(folder, [asked])[0][..., :3]


def placed(towards: Sequence[float], distance: float = 0.0) -> list[list[float]]:
    """The matrix of a lamp that shines at the origin from a direction (3,) of `render_sphere`'s world.

    There y is up and z towards the viewer; in Blender z is up and the viewer at -y.
    """
    x, y, z = np.asarray(towards, float) / np.linalg.norm(towards)
    axis = np.array([x, -z, y])
    side = np.cross([0.0, 0.0, 1.0], axis)
    side /= np.linalg.norm(side)
    matrix = np.eye(4)
    matrix[:3] = np.stack((side, np.cross(axis, side), axis, axis * distance), 1)
    return matrix.tolist()


def sun(light: DirectionalLight) -> dict[str, Any]:
    """A light of one level as a lamp of a request, without width."""
    return {"kind": "SUN", "matrix": placed(light.direction), "energy": light.levels()[0], "angle": 0.0}


def differences(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """|found − expected| over the expected, at least 5% of its mean, within .85 of the sphere's radius, a row a pixel.

    Towards the silhouette a pixel's mean, which `render_sphere` has, is not its middle.
    """
    size = len(expected)
    y, x = np.mgrid[:size, :size] + 0.5 - size / 2
    inner = np.hypot(x, y) < 0.85 * RADIUS * size / 2
    return np.abs(found[inner, :3] - expected[inner]) / np.maximum(expected[inner], 0.05 * expected[inner].mean())
