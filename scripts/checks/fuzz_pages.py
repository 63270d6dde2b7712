"""Pass damaged environment maps and damaged view links to the viewer's JavaScript, in Node.js.

`fuzz_scenes.py` runs it. The page's verdict on a sky is to be Python's, and a view that is read is one that its own
link gives back.
"""

import atexit
import base64
import json
import random
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.rendering.environment import read_environment
from homofact.web.assembly import part
from scripts.checks.fuzz_results import Kind
from scripts.checks.fuzzing import ABSURD, DAMAGES

LINK = "show=fit,source&on=mesh&light=sky&from=35.3,30&camera=0,0&zoom=1.5&stops=-2&factor=2"
ODD = ("%", "%E0%A4%A", "__proto__", "fit,fit", ",", "=", "1,2,3", "-0", "1e1", " 1", "1\n")
MORE = ([], [], ["__proto__=x"], ["constructor=1"], ["=&="], ["toString=1"], ["zoom=1"])
# A line of JSON is a request, [what, text]; what the page's scripts make of it is a line of JSON too.
NODE = """
class Trouble extends Error { constructor(message, remedy) { super(message); this.remedy = remedy; } }
const LIGHTS = ["sky", "point"], MODES = ["off", "signed"], FACTORS = ["1", "2"];
%s
%s
const fields = linkFields([{ key: "fit" }, { key: "source" }], ["sphere", "mesh"]);
const acts = {
  sky(text) {
    try {
      const found = readHdr(new Uint8Array(Buffer.from(text, "base64")), "sky");
      return [found.rows, found.columns, found.values.every(Number.isFinite)];
    } catch (error) {
      if (!(error instanceof Trouble)) throw error;
      return error.message;
    }
  },
  link(text) {
    const { found, wrong } = readLink(text, fields);
    if (wrong !== undefined) return String(wrong);
    const state = { visible: ["fit"], surface: "mesh", light: "sky", lightFrom: { azimuth: 0, elevation: 0 },
      camera: { azimuth: 0, elevation: 0 }, zoom: 1, stops: 0, difference: "off", factor: 1, ...found };
    const again = readLink(writeLink(state, fields), fields).found;
    const twice = readLink(writeLink({ ...state, ...again }, fields), fields).found;
    return [again !== undefined && JSON.stringify(again) === JSON.stringify(twice)];
  },
};
require("readline").createInterface({ input: process.stdin }).on("line", (line) => {
  const [what, text] = JSON.parse(line);
  let answer;
  try { answer = acts[what](text); } catch (error) { answer = { raised: String(error) }; }
  console.log(JSON.stringify(answer));
});
"""


class Page:
    """The page's scripts in one process of node that answers line by line."""

    def __init__(self, folder: Path) -> None:
        """Start it. Raises FileNotFoundError where there is no node."""
        program = folder / "page.js"
        program.write_text(NODE % (part("homofact.web", "hdr.js"), part("homofact.web", "link.js")), encoding="utf-8")
        self._process = subprocess.Popen(["node", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        atexit.register(self._process.__exit__, None, None, None)

    def asked(self, what: str, text: str) -> Any:
        """The answer. Raises ArithmeticError where the script did anything but refuse."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps([what, text]) + "\n")
        self._process.stdin.flush()
        found = json.loads(self._process.stdout.readline() or '{"raised": "it ended"}')
        if isinstance(found, dict):
            raise ArithmeticError(found["raised"])
        return found


def page_kinds(folder: Path, put_sky: Callable[[random.Random, Path], None]) -> list[Kind]:
    """The kinds that the page reads, skies as `put_sky` damages them."""
    page = Page(folder)

    def use_page_sky(path: Path, _: int) -> None:
        answer = page.asked("sky", base64.b64encode(path.read_bytes()).decode())
        try:
            shape = list(read_environment(path).radiance.shape[:2])
        except BadInput as error:
            if not isinstance(answer, str):
                raise ArithmeticError(f"the page takes what Python refuses: {error}") from error
            raise
        if isinstance(answer, str):
            raise ArithmeticError(f"the page refuses what Python takes: {answer}")
        if answer != [*shape, True]:
            raise ArithmeticError(f"the page reads {answer}, Python {shape}")

    def put_link(dice: random.Random, path: Path) -> None:
        parts = LINK.split("&")
        dice.shuffle(parts)
        for _ in range(dice.choice((0, 1, 2, 4))):
            place = dice.randrange(len(parts))
            name = parts[place].partition("=")[0]
            parts[place] = f"{name}={dice.choice((*ABSURD, *ODD))}"
        raw = ("#" + "&".join([*parts, *dice.choice(MORE)])).encode()
        path.write_bytes(raw if dice.random() < 0.7 else dice.choice(DAMAGES)(bytearray(raw), dice))

    def use_link(path: Path, _: int) -> None:
        answer = page.asked("link", path.read_bytes().decode("utf-8", "replace"))
        if isinstance(answer, str):
            raise BadInput(answer.replace("\n", " "), where=path)
        if answer != [True]:
            raise ArithmeticError("a view that its own link does not give back")

    return [Kind("page-sky", put_sky, use_page_sky), Kind("link", put_link, use_link)]
