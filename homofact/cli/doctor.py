"""`homofact doctor`: what is installed, what of it works, and what would be needed for the rest."""

import shutil
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, requires, version
from typing import NamedTuple

from rich.table import Table
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.screen import Screen
from homofact.errors import BadInput
from homofact.version import __version__

# What each extra of the package is for.
_EXTRAS = {
    "relight": "relight and edit: shadows, glTF meshes",
    "metrics": "compare --metrics: SSIM, FLIP",
    "mitsuba": "fits as Mitsuba's materials",
    "cluster": "sweep --scheduler: Dask",
    "report": "report: Parquet",
    "nmf": "a second opinion on nmf",
    "textures": "a second opinion on BC6H",
    "dev": "tests",
}
# What others' programs do for those who change homofact; a fit and its export need none.
_PROGRAMS = {
    "cc": "compiles the exported brdf.c",
    "glslangValidator": "checks the exported GLSL and HLSL",
    "dxc": "compiles the exported HLSL",
    "node": "checks KTX2 files",
    "chromium": "opens the pages in tests",
}
_STYLES = {"works": "green", "installed": "green", "missing": "yellow", "fails": "bold red"}


class Finding(NamedTuple):
    """One line: what it is, its state (a key of `_STYLES`), and a word about it."""

    part: str
    name: str
    state: str
    told: str


def doctor(as_json: o.AsJson = False, quiet: o.Quiet = False) -> None:
    """Say what is installed, what of it works, and what is missing for more.

    The fit, the GPU and the extras are tried, not only looked up. Ends
    with exit code 2 where something that is installed or needed fails.
    """
    screen = Screen(as_json, quiet)
    findings: list[Finding] = []
    with screen.bar() as bar:
        for finding in _findings():
            bar.stage(finding.name)
            findings.append(finding)
    table = Table(box=None, pad_edge=False, show_header=False, title=f"homofact {__version__}", title_justify="left")
    for width in (9, 17, 9, None):
        table.add_column(overflow="fold", min_width=width)
    before = ""
    for part, name, state, told in findings:
        table.add_row(Text("" if part == before else part), Text(name), Text(state, _STYLES[state]), Text(told))
        before = part
    if not quiet:
        screen.show(table)
    screen.answer({"version": __version__, "findings": [each._asdict() for each in findings]})
    broken = [each.name for each in findings if each.state == "fails"]
    if broken:
        raise BadInput(f"doctor: found {', '.join(broken)} not working, expected everything that is installed to work")


def _findings() -> Iterator[Finding]:
    for need, extra in _needs():
        if not extra:
            found = _version(need)
            yield Finding("needed", need, "installed" if found else "fails", found or "not installed")
    yield _tried("tried", "a fit", _fit)
    yield _tried("tried", "compiled kernels", _kernels)
    yield _gpu()
    for extra, purpose in _EXTRAS.items():
        packages = [need for need, whose in _needs() if whose == extra]
        missing = [each for each in packages if _version(each) is None]
        here = bool(packages) and not missing
        lacking = f" ({', '.join(missing)})" if missing else ""
        said = ", ".join(packages) if here else f"pip install 'homofact[{extra}]'{lacking}"
        if extra == "relight" and here:
            tried = _tried("extras", extra, _rays)
            yield tried._replace(told=f"{purpose}: {tried.told}")
        else:
            yield Finding("extras", extra, "installed" if here else "missing", f"{purpose}: {said}")
    for program, purpose in _PROGRAMS.items():
        yield Finding("programs", program, "installed" if shutil.which(program) else "missing", purpose)


def _needs() -> list[tuple[str, str]]:
    """(package, its extra or "") of all that homofact's own metadata names."""
    found = []
    for line in requires("homofact") or []:
        words, _, marker = line.partition(";")
        extra = marker.partition("extra ==")[2].strip(" '\"")
        name = words.strip()
        for sign in "<>=!~[ ":
            name = name.partition(sign)[0]
        found.append((name, extra))
    return found


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _tried(part: str, name: str, check: Callable[[], str]) -> Finding:
    try:
        return Finding(part, name, "works", check())
    except Exception as error:  # whatever breaks is what is asked for
        return Finding(part, name, "fails", f"{type(error).__name__}: {' '.join(str(error).split())}")


def _fit() -> str:
    """McCool's projections of a Lambertian surface, which they hold exactly."""
    import torch

    from homofact.brdf.analytic import Lambert
    from homofact.brdf.sampling import sample_model
    from homofact.methods.mccool import McCool

    lambert = Lambert((0.5, 0.5, 0.5))
    samples = sample_model(lambert, 400, "lobe", 0)
    fit = McCool(size=4).fit(samples).factorization
    found = fit.evaluate(samples.wi, samples.wo).to(torch.float64)
    error = float((found / samples.values - 1).abs().max())
    if error > 1e-3:
        raise ValueError(f"off by {error:.1%} on a Lambertian surface")
    return f"a Lambertian surface within {error:.0e}"


def _kernels() -> str:
    import numba

    from homofact.linear.normal import warm_up

    warm_up()
    return f"numba {numba.__version__}, {numba.get_num_threads()} threads"


def _gpu() -> Finding:
    import torch

    if not torch.cuda.is_available():
        return Finding("tried", "GPU", "missing", "torch sees none; not needed")
    return _tried("tried", "GPU", _sum_on_gpu)


def _sum_on_gpu() -> str:
    import torch

    if float(torch.ones(8, device="cuda").sum()) != 8:
        raise ValueError("eight ones do not add up to 8")
    return torch.cuda.get_device_name()


def _rays() -> str:
    """Embree, by the shadow of a triangle."""
    import numpy as np

    from homofact.meshes.occlusion import Occluder

    over = Occluder(np.array([[-1.0, -1, 1], [2, -1, 1], [-1, 2, 1]]), np.array([[0, 1, 2]]))
    found = over.blocked(np.array([[0.0, 0, 0], [0, 0, 2]]), np.array([0.0, 0, 1]))
    if found.tolist() != [True, False]:
        raise ValueError("a triangle's shadow is not where it must be")
    return "a shadow is where it must be"
