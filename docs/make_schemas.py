"""Write the JSON Schema of every kind of TOML file into configs/schemas, for editors that complete and check keys.

python docs/make_schemas.py [--out FOLDER]
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from homofact.config import ConfigTable, fit_options
from homofact.editing.scene_file import EditSceneTable
from homofact.planning.scene import PlanSceneTable
from homofact.relighting.scene_file import RelightSceneTable
from homofact.sections import FitSection
from homofact.settings.options import Declared
from homofact.settings.schema import schema_of, value_schema
from homofact.sweeps.sweep_file import SweepMethodTable, SweepTable

FOLDER = Path(__file__).resolve().parents[1] / "configs" / "schemas"


def _setting(by_method: dict[str, Declared]) -> dict[str, Any]:
    """A setting as any of the methods that have it takes it."""
    schemas: list[dict[str, Any]] = []
    for schema in map(value_schema, by_method.values()):
        if schema not in schemas:
            schemas.append(schema)
    return schemas[0] if len(schemas) == 1 else {"anyOf": schemas}


def schemas() -> dict[str, dict[str, Any]]:
    """The schemas by file name, without .json."""
    settings = {name: _setting(by_method) for name, by_method in fit_options().items()}
    rests = {FitSection: settings, SweepMethodTable: settings}
    tables = {
        "fit": (ConfigTable, "Configuration of factorize, compare, chart and render"),
        "plan": (PlanSceneTable, "Scene of homofact plan"),
        "relight": (RelightSceneTable, "Scene of homofact relight"),
        "edit": (EditSceneTable, "Scene of homofact edit"),
        "sweep": (SweepTable, "Sweep of homofact sweep"),
    }
    return {name: schema_of(table, title, rests) for name, (table, title) in tables.items()}


def main(arguments: list[str] | None = None) -> int:
    """Write all of them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, default=FOLDER, help="the folder (%(default)s)")
    folder = parser.parse_args(arguments).out
    folder.mkdir(parents=True, exist_ok=True)
    for name, schema in schemas().items():
        (folder / f"{name}.json").write_text(json.dumps(schema, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
