"""`homofact doctor`: which parts are installed, which of them work, and what is missing for the others."""

import platform
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import PackageNotFoundError, requires, version
from typing import NamedTuple

from rich.table import Table
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.layout import add_names, plain_table
from homofact.cli.screen import Screen
from homofact.errors import BadInput
from homofact.files.embedded import FOLDERS, root
from homofact.files.extras import LIBRARIES
from homofact.version import __version__

# What each extra of the package is for.
_EXTRAS = {
    "pictures": "factorize, chart, --plot: figures, textures as PNG previews",
    "containers": "EXR, PNG and PLY files: export, environments, meshes",
    "relight": "relight and edit: shadows, glTF meshes",
    "metrics": "compare --metrics: SSIM, FLIP",
    "mitsuba": "fits as Mitsuba's materials",
    "materialx": "tests: compiles what export --engine materialx writes",
    "blender": "tests: draws what export --engine blender writes",
    "cluster": "sweep --scheduler: Dask",
    "report": "report: Parquet",
    "nmf": "tests: checks of nmf",
    "textures": "tests: checks of BC6H",
    "dev": "tests",
}
# What others' programs do for those who change homofact; a fit and its export need none.
_PROGRAMS = {
    "cc": "compiles the exported brdf.c",
    "glslangValidator": "checks the exported GLSL and HLSL",
    "dxc": "compiles the exported HLSL if libdxcompiler.so is missing",
    "llvm-config": "Mitsuba's llvm variants",
    "pdflatex": "compiles the tables of compare --latex",
    "node": "checks KTX2 files",
    "chromium": "opens the pages in tests",
}
_STYLES = {"works": "green", "installed": "green", "missing": "yellow", "fails": "bold red"}


class Diagnosis(NamedTuple):
    """One line: the part and its name, its state (a key of `_STYLES`), and a comment."""

    part: str
    name: str
    state: str
    told: str


def doctor(as_json: o.AsJson = False, quiet: o.Quiet = False) -> None:
    """Check what is installed, what works, and what is missing for more features.

    It runs a fit, a computation on the GPU, and each optional package, so that it detects broken installations too.
    It exits with code 2 if an installed or required part fails.
    """
    screen = Screen(as_json, quiet)
    findings: list[Diagnosis] = []
    with screen.bar() as bar:
        for finding in _findings():
            bar.stage(finding.name)
            findings.append(finding)
    if not quiet:
        screen.show(_findings_table(findings))
    screen.answer({"version": __version__, "findings": [each._asdict() for each in findings]})
    broken = [each.name for each in findings if each.state == "fails"]
    if broken:
        raise BadInput(
            where="doctor", found=f"{', '.join(broken)} not working", expected="everything that is installed to work"
        )


def _findings_table(findings: Sequence[Diagnosis]) -> Table:
    """One line per finding; the part is named once."""
    table = plain_table(f"homofact {__version__}")
    table.show_header = False
    for number in range(3):
        add_names(table, longest=max(len(each[number]) for each in findings))
    table.add_column(overflow="fold")
    before = ""
    for part, name, state, told in findings:
        if before not in ("", part):
            table.add_section()
        table.add_row(Text("" if part == before else part), Text(name), Text(state, _STYLES[state]), Text(told))
        before = part
    return table


def _findings() -> Iterator[Diagnosis]:
    yield Diagnosis("needed", "Python", "installed", f"{platform.python_version()}, {sys.executable}")
    for need, extra in _needs():
        if not extra:
            found = _version(need)
            yield Diagnosis("needed", need, "installed" if found else "fails", found or "not installed")
    yield _tried("tried", "a fit", _fit)
    yield _tried("tried", "compiled kernels", _kernels)
    yield _tried("tried", "embedded files", _embedded)
    yield _gpu()
    for extra, purpose in _EXTRAS.items():
        packages = [need for need, whose in _needs() if whose == extra and need != "homofact"]
        # Metadata of an older editable installation does not know every extra.
        packages = packages or [package for package, own in LIBRARIES.values() if own == extra]
        missing = [each for each in packages if _version(each) is None]
        here = bool(packages) and not missing
        lacking = f" ({', '.join(missing)})" if missing else ""
        said = ", ".join(packages) if here else f"pip install 'homofact[{extra}]'{lacking}"
        if extra in _TRIED and here:
            tried = _tried("extras", extra, _TRIED[extra])
            yield tried._replace(told=f"{purpose}: {tried.told}")
        else:
            yield Diagnosis("extras", extra, "installed" if here else "missing", f"{purpose}: {said}")
    for program, purpose in _PROGRAMS.items():
        yield Diagnosis("programs", program, "installed" if shutil.which(program) else "missing", purpose)


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


def _tried(part: str, name: str, check: Callable[[], str]) -> Diagnosis:
    try:
        return Diagnosis(part, name, "works", check())
    except Exception as error:  # whatever breaks is what is asked for
        return Diagnosis(part, name, "fails", f"{type(error).__name__}: {' '.join(str(error).split())}")


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
    return f"Lambertian surface, error {error:.0e}"


def _kernels() -> str:
    import numba

    from homofact.linear.normal import warm_up

    warm_up()
    return f"numba {numba.__version__}, {numba.get_num_threads()} threads"


def _embedded() -> str:
    """The example data and settings that come with homofact."""
    missing = [each for each in FOLDERS if not (root() / each).is_dir()]
    if missing:
        raise FileNotFoundError(f"no {' and '.join(missing)} in {root()}")
    return f"{' and '.join(FOLDERS)} in {root()}"


def _gpu() -> Diagnosis:
    import torch

    if not torch.cuda.is_available():
        return Diagnosis("tried", "GPU", "missing", "torch sees none; not needed")
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
    return "traced a shadow correctly"


def _figure() -> str:
    """A figure of nothing, by the backend that needs no screen."""
    from io import BytesIO

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    file = BytesIO()
    FigureCanvasAgg(Figure()).print_png(file)
    return f"drew a {len(file.getvalue())}-byte figure"


def _exr() -> str:
    """A texel written and read back."""
    import tempfile
    from pathlib import Path

    import numpy as np

    from homofact.containers.exr import read_exr, write_exr

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "texel.exr"
        write_exr(place, np.full((1, 1, 1), 0.5, np.float32), ("Y",))
        if float(read_exr(place)["Y"][0, 0]) != 0.5:
            raise ValueError("a texel comes back as another")
    return "wrote and read an EXR"


_TRIED: dict[str, Callable[[], str]] = {"relight": _rays, "pictures": _figure, "containers": _exr}
