"""A worker that fits nothing: what it does with a task is written in the task's label. For tests of engines."""

import hashlib
import json
import os
import signal
import sys
import time
from pathlib import Path

folder = Path(sys.argv[1])
for line in sys.stdin:
    task = json.loads(line)
    what, _, more = task["label"].partition(" ")
    key = task["settings"]["number"]
    with (folder / "log").open("a") as log:
        log.write(f"{os.getpid()} {key}\n")
    answer: dict = {"seconds": 0.01}
    if what == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    elif what == "exit":
        sys.exit(3)
    elif what == "garbage":
        print("no JSON", flush=True)
        continue
    elif what == "once" and not (folder / f"died-{key}").exists():
        (folder / f"died-{key}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    elif what == "refuse":
        answer = {"refused": "log mean: found nan"}
    elif what == "full":
        answer = {"stop": f"{folder}: No space left on device"}
    elif what == "sleep":
        time.sleep(float(more))
    if "seconds" in answer:
        told = {name: value for name, value in task.items() if name not in ("source", "label")}
        digest = hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()
        place = folder / "results" / digest[:32]
        place.mkdir(parents=True, exist_ok=True)
        (place / "factorization.npz").touch()
    print(json.dumps(answer), flush=True)
