"""The console script: the commands are loaded where an interrupt is no fault, and a closed stream is there."""

import os
import sys


def run() -> int:
    """Run the command line that the process was given; its exit code, as `main.main` says."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            # Closed by who started it: else the next file that is opened would take its place.
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))  # noqa: SIM115
    try:
        from homofact.cli.main import main
    except KeyboardInterrupt:
        sys.stderr.write("homofact: interrupted, nothing was written\n")
        return 130
    return main()
