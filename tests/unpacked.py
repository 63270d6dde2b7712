"""The arrays of a page again."""

import base64
import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np


def unpack(packed: dict[str, Any]) -> np.ndarray:
    """The array that `homofact.web.packing.pack` took."""
    kind = np.dtype(packed["type"]).newbyteorder("<")
    grouped = np.frombuffer(zlib.decompress(base64.b64decode(packed["data"])), np.uint8)
    plain = np.ascontiguousarray(grouped.reshape(kind.itemsize, -1).T)
    return plain.view(kind).reshape(packed["shape"]).astype(packed["type"])


def written(path: Path) -> dict[str, Any]:
    """The data in a page."""
    found = re.search(
        r'<script type="application/json" id="data">(.*?)</script>', path.read_text(encoding="utf-8"), re.S
    )
    assert found is not None
    data = json.loads(found[1])
    repeated = data.pop("repeated", [])

    def inside(node: Any) -> Any:
        if isinstance(node, list):
            return [inside(each) for each in node]
        if not isinstance(node, dict):
            return node
        return repeated[node["repeated"]] if "repeated" in node else {name: inside(each) for name, each in node.items()}

    return inside(data)
