"""The console script: it handles an interrupt while the commands load, and replaces closed streams."""

import contextlib
import gc
import os
import sys

# Objects that are made between two looks for cycles. Loading torch, numba and scipy makes half a million that all stay;
# at Python's own 700 four or five searches through everything take .3 s of each command and find nothing.
_BETWEEN_LOOKS = 7000


def run() -> int:
    """Run the command line that the process was given, and end the process with `main.main`'s exit code."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            # Closed by who started it: else the next file that is opened would take its place.
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))  # noqa: SIM115
    # Libraries on one thread, as in `linear.threads`: on small arrays two gain nothing, and on a busy machine a
    # spinning worker waits for a core that its partner holds. Whole pieces of work have threads of their own.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    gc.set_threshold(_BETWEEN_LOOKS)
    try:
        from homofact.cli.main import main
    except KeyboardInterrupt:
        sys.stderr.write("homofact: interrupted, nothing was written\n")
        return 130
    code = main()
    # All of ours is closed and written. What the libraries would do at the interpreter's end takes a second.
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)
