"""The viewer's page in a headless Chromium: what its tests ask it, and what they show on it."""

import math
from typing import Any

import numpy as np
import torch
from browser import headless
from torch import Tensor

from homofact.geometry.directions import draw_uniform
from homofact.meshes.mesh import Mesh

PAIRS = draw_uniform(1500, torch.Generator().manual_seed(0))
SIDE = 200
# Distances of pixels from the middle; those whose surroundings the sphere covers wholly.
DISTANCE = np.hypot(*(np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2))
INSIDE = DISTANCE < 0.94 * SIDE / 2 - 1.5


def evaluate(driver: Any, key: str, wi: Tensor, wo: Tensor) -> np.ndarray:
    """(N, 3) of the page's own shader."""
    script = (
        "return Array.from(window.homofact.evaluate(arguments[0], Float32Array.from(arguments[1]),"
        " Float32Array.from(arguments[2])))"
    )
    values = driver.execute_script(script, key, wi.reshape(-1).tolist(), wo.reshape(-1).tolist())
    return np.array(values).reshape(-1, 3)


def gathered(driver: Any, passes: int) -> None:
    """Wait until so many passes of a sky are in the picture."""
    driver.execute_async_script(
        "const [passes, done] = arguments;"
        "(function wait() { window.homofact.passes < passes ? setTimeout(wait, 30) : done(); })();",
        passes,
    )


def change(driver: Any, **state: Any) -> dict[str, Any]:
    driver.execute_script("Object.assign(window.homofact.state, arguments[0]); window.homofact.changed();", state)
    return headless.settled(driver)


def shrink(driver: Any, side: int = SIDE) -> None:
    """Square pictures that software draws in no time."""
    driver.execute_script(
        "for (const p of document.querySelectorAll('.picture')) {"
        " p.style.width = p.style.height = arguments[0] + 'px'; p.style.maxHeight = 'none'; }"
        "window.homofact.changed();",
        side,
    )
    headless.settled(driver)


def picture(driver: Any, number: int = 0) -> np.ndarray:
    """(SIDE, SIDE, 3) in 0 … 255 of a card's canvas."""
    script = (
        "const c = document.querySelectorAll('.picture canvas')[arguments[0]];"
        "const copy = Object.assign(document.createElement('canvas'), {width: c.width, height: c.height});"
        "const context = copy.getContext('2d', {willReadFrequently: true});"
        "context.drawImage(c, 0, 0);"
        "return [c.width, c.height, Array.from(context.getImageData(0, 0, c.width, c.height).data)]"
    )
    width, height, data = driver.execute_script(script, number)
    assert (width, height) == (SIDE, SIDE)
    return np.array(data, float).reshape(SIDE, SIDE, 4)[..., :3]


def press(driver: Any, keys: str, *, shift: bool = False) -> dict[str, Any]:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    actions = ActionChains(driver)
    if shift:
        actions.key_down(Keys.SHIFT)
    actions.send_keys(keys)
    if shift:
        actions.key_up(Keys.SHIFT)
    actions.perform()
    return driver.execute_script("return structuredClone(window.homofact.state)")


def ball(rings: int = 60) -> Mesh:
    theta, phi = np.meshgrid(
        np.linspace(0, math.pi, rings + 1), np.linspace(0, 2 * math.pi, 2 * rings + 1), indexing="ij"
    )
    points = np.stack((np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)), -1).reshape(-1, 3)
    at = np.arange(points.shape[0]).reshape(theta.shape)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    triangles = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return Mesh(points, points, triangles, "ball.obj")


def radiance(driver: Any, key: str) -> np.ndarray:
    """(height, width, 3) linear radiance of a layer's picture, row 0 on top, as the page has gathered it; 0 beside."""
    width, height, values = driver.execute_script(
        "const r = window.homofact.radiance(arguments[0]); return [r.width, r.height, Array.from(r.values)]", key
    )
    sums = np.array(values).reshape(height, width, 4)[::-1]
    return sums[..., :3] / np.maximum(sums[..., 3:], 1e-9)


def shown_note(driver: Any) -> tuple[str, bool]:
    """(the line beside the controls, whether it says that something is wrong)."""
    note = driver.find_element("id", "note")
    return note.text, "wrong" in note.get_attribute("class").split()
