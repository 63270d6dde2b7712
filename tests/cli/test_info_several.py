"""`info` of several sources: each as alone, one after another, with what is asked of all of them once."""

import json
from pathlib import Path
from typing import Any

import pytest

from homofact.cli.main import main

PAINT = "data_synthetic/synthetic_cornell.brdf"
MATERIAL = "material:phong-30"


def said(capsys: pytest.CaptureFixture[str], *line: str) -> str:
    assert main(["info", *line]) == 0
    # The time that reading took is never the same.
    return "\n".join(line for line in capsys.readouterr().out.split("\n") if "seconds read" not in line)


def record(capsys: pytest.CaptureFixture[str], *line: str) -> dict[str, Any]:
    assert main(["info", *line, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_each_source_is_described_as_alone(capsys: pytest.CaptureFixture[str]) -> None:
    one, two = (said(capsys, source) for source in (PAINT, MATERIAL))
    both = said(capsys, PAINT, MATERIAL)
    head = one.split("Please check:")[0]
    assert both.startswith(head)
    assert two in both
    assert both.count("Does a white standard") == 1
    assert "Please check for each measurement:" in both


def test_json_is_one_object_with_the_records(capsys: pytest.CaptureFixture[str]) -> None:
    one = record(capsys, MATERIAL)
    both = record(capsys, MATERIAL, PAINT)
    assert list(both) == ["sources"]
    assert both["sources"][0] | {"seconds_read": 0} == one | {"seconds_read": 0}
    assert both["sources"][1]["source"] == "synthetic_cornell.brdf"


def test_a_picture_is_of_one_source(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["info", PAINT, MATERIAL, "--plot", str(tmp_path / "p.png")]) == 2
    assert capsys.readouterr().err == "homofact: plot: found it with 2 sources, expected one source\n"
    assert main(["info", MATERIAL, "missing.brdf"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "missing.brdf" in err
