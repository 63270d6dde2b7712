"""What pyproject.toml cannot say: example data and settings, which lie beside the package, go into the wheel."""

from setuptools import find_packages, setup

EMBEDDED = {
    "homofact.embedded.data_synthetic": "data_synthetic",
    "homofact.embedded.configs": "configs",
    "homofact.embedded.configs.scenes": "configs/scenes",
    "homofact.embedded.configs.schemas": "configs/schemas",
}
PAGES = (
    "homofact.web",
    "homofact.sweeps.report",
    "homofact.relighting.page",
    "homofact.editing.page",
)

setup(
    packages=[*find_packages(include=["homofact*"]), *EMBEDDED],
    package_dir=EMBEDDED,
    package_data={each: ["*.*"] for each in EMBEDDED}
    | {each: ["*.html", "*.css", "*.js"] for each in PAGES}
    | {"": ["*.json"]}
    | {"homofact.exporting.engines": ["*.gdshader", "*.glsl", "*.html", "*.js", "*.md", "*.pbrt", "*.txt"]},
)
