"""The page of a scene that `relight` wrote: its own sky, the built-in ones and others, its numbers, its reference."""

from collections.abc import Sequence
from pathlib import Path

from homofact.relighting.page.build import PageReference, page_objects, shown_name, write_page
from homofact.relighting.page.skies import PageSky, page_sky
from homofact.relighting.result import RelightResult, distinct_names
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.tonemap import DEFAULT_CURVE
from homofact.scene.lighting import NAMED, named_lighting
from homofact.web.scene_page import percent


def write_relit_page(
    target: Path, saved: RelightResult, others: Sequence[EnvironmentMap] = (), new: bool = False
) -> int:
    """Write the page, whole or not at all; its bytes. Raises BadInput as `page.build.write_page`."""
    size = saved.sky.cube.shape[1]
    own = PageSky(shown_name(saved.sky.name), saved.sky.cube, saved.sky.picture)
    skies = [own, *(page_sky(shown_name(each.name), each, size) for each in others)]
    skies += _built_in(size, [saved.sky.name, *(each.name for each in others)], [each.name for each in skies])
    numbers: dict[str, dict[str, str | int | float]] = {}
    entries = saved.report.get("objects", [])
    names = distinct_names([f"{shown_name(each['mesh'])}, {shown_name(each['material'])}" for each in entries])
    for name, entry in zip(names, entries, strict=True):
        rows: dict[str, str | int | float] = {
            "vertices": entry["vertices"],
            "terms K": entry["terms"],
            "coefficients per vector": round(entry["coefficients_per_vector"]),
            "bytes": entry["bytes"],
        }
        for stage, value in (entry["error"] or {}).items():
            if stage == "psnr":
                rows[f"PSNR of the pixels, {DEFAULT_CURVE} curve"] = f"{value:.1f} dB"
            elif stage not in ("below_zero", "vertices"):
                rows[f"error, {stage}"] = percent(value)
        numbers[name] = rows
    reference = None if saved.reference is None else PageReference(saved.reference)
    objects, camera = page_objects(saved.objects), saved.cameras[0]
    return write_page(target, objects, skies, numbers, reference, title=saved.name, camera=camera, new=new)


def _built_in(size: int, there: Sequence[str], shown: Sequence[str]) -> list[PageSky]:
    """Return the named lightings that are maps and not yet `there`, renamed if a file `shown` has the name."""
    found = []
    for name in NAMED:
        lights = named_lighting(name).lights
        if name not in there and len(lights) == 1 and isinstance(lights[0], EnvironmentMap):
            found.append(page_sky(f"{name}, built in" if name in shown else name, lights[0], size))
    return found
