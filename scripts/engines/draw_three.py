"""Draw a sphere of a three.js export, or of a glTF look-alike, with three.js in a browser."""

import base64
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from homofact.errors import MissingDependency
from homofact.rendering.light import DirectionalLight, EnvironmentMap

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.headless import served

PACKAGE = Path(__file__).resolve().parents[2] / "tests/containers/node/node_modules/three"
# Draws the unit sphere in linear floats as `render_sphere` frames it, and gives its pixels.
PAGE = """<!doctype html>
<script type="importmap">{"imports": {"three": "./three/build/three.module.js",
 "three/addons/": "./three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from "three";
window.drawn = async function (folder, size, radius, lights, { environment, ...parameters }) {
  let material;
  if (parameters.glb) {
    const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js");
    const { scene } = await new GLTFLoader().loadAsync(`./${folder}/${parameters.glb}`);
    scene.traverse((each) => (material = each.material ?? material));
  } else {
    const { BrdfMaterial } = await import(`./${folder}/index.js`);
    material = new BrdfMaterial(parameters);
  }
  const renderer = new THREE.WebGLRenderer();
  const scene = new THREE.Scene();
  const geometry = new THREE.SphereGeometry(1, 512, 256);
  if (parameters.vertexTangents || parameters.glb) {
    const n = geometry.attributes.normal, t = new Float32Array(4 * n.count);
    for (let k = 0; k < n.count; k++) {
      const size = Math.hypot(n.getZ(k), n.getX(k)) || 1;
      t.set([n.getZ(k) / size, 0, -n.getX(k) / size, 1], 4 * k);
    }
    geometry.setAttribute("tangent", new THREE.BufferAttribute(t, 4));
  }
  const mesh = new THREE.Mesh(geometry, material);
  scene.add(mesh);
  for (const [x, y, z, power] of lights) {
    const light = new THREE.DirectionalLight(0xffffff, power);
    light.position.set(x, y, z);
    scene.add(light);
  }
  if (environment) {
    const { rows, columns, texels } = environment;
    const data = new Float32Array(Uint8Array.from(atob(texels), (letter) => letter.charCodeAt(0)).buffer);
    const map = new THREE.DataTexture(data, columns, rows, THREE.RGBAFormat, THREE.FloatType);
    map.mapping = THREE.EquirectangularReflectionMapping;
    map.minFilter = map.magFilter = THREE.LinearFilter;
    map.wrapS = THREE.RepeatWrapping;
    map.needsUpdate = true;
    scene.environment = new THREE.PMREMGenerator(renderer).fromEquirectangular(map).texture;
  }
  const camera = new THREE.OrthographicCamera(-1 / radius, 1 / radius, 1 / radius, -1 / radius, 0.1, 10);
  camera.position.z = 5;
  const target = new THREE.WebGLRenderTarget(size, size, { type: THREE.FloatType });
  renderer.setRenderTarget(target);
  renderer.render(scene, camera);
  const pixels = new Float32Array(4 * size * size);
  renderer.readRenderTargetPixels(target, 0, 0, size, size, pixels);
  return Array.from(pixels);
};
document.documentElement.dataset.ready = "yes";
</script>"""


def equirectangular(light: EnvironmentMap) -> dict[str, Any]:
    """A map as three lays it out, rows from the bottom, -z a quarter of its width from the left; floats in base64."""
    rows, columns, channels = light.radiance.shape
    texels = np.ones((rows, columns, 4), np.float32)
    texels[..., :3] = light.radiance.numpy() if channels == 3 else np.repeat(light.radiance.numpy(), 3, 2)
    turned = np.roll(texels, -round((light.turn / (2 * np.pi) + 0.25) * columns), 1)[::-1]
    return {"rows": rows, "columns": columns, "texels": base64.b64encode(turned.tobytes()).decode()}


def three_sphere(
    driver: Any, place: Path, folder: Path, size: int, radius: float, lights: Sequence[DirectionalLight] = (),
    environment: EnvironmentMap | None = None, **parameters: Any,
) -> np.ndarray:  # fmt: skip
    """Linear radiance (size, size, 3) of the unit sphere as `render_sphere` frames it, rows from the top.

    `driver` is a browser (`headless.chromium`), `place` a new folder for the page, `folder` an export with `--engine
    three`, or with `--engine gltf` where the parameters name its `glb`; others are the material's. Lights have one
    number. Raises MissingDependency where three is not installed, RuntimeError with what the page says where it fails.
    """
    if not PACKAGE.is_dir():
        raise MissingDependency("no npm package three: npm ci --prefix tests/containers/node")
    place.mkdir(parents=True)
    (place / "three").symlink_to(PACKAGE)
    (place / "export").symlink_to(folder.resolve())
    (place / "page.html").write_text(PAGE, encoding="utf-8")
    given = [[*light.direction, *light.levels()] for light in lights]
    if environment is not None:
        parameters["environment"] = equirectangular(environment)
    with served(place) as address:
        driver.get(f"{address}/page.html")
        found = driver.execute_async_script(
            "const done = arguments[5]; (function wait() { window.drawn ? window.drawn(...[...arguments].slice(0, 5))"
            ".then(done, (e) => done(String(e))) : setTimeout(() => wait(...arguments), 20); })(...arguments);",
            "export", size, radius, given, parameters,
        )  # fmt: skip
    if isinstance(found, str):
        raise RuntimeError(f"three: {found}")
    return np.array(found).reshape(size, size, 4)[::-1, :, :3]
