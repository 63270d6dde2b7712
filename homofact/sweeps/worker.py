"""A worker process: it reads tasks as lines of JSON from stdin, and writes their outcomes as lines to stdout.

    python -m homofact.sweeps.worker FOLDER

The worker ends when its stdin ends, so it ends with the client that started it, however that client ended. Before it
ends, it finishes its current task and writes the result.
"""

import json
import os
import sys
from pathlib import Path


def main() -> int:
    """Serve until there are no more tasks."""
    folder = Path(sys.argv[1])
    # What a library prints must not be taken for an answer.
    answers = os.dup(1)
    os.dup2(2, 1)
    from homofact.linear.normal import warm_up
    from homofact.sweeps.task import task_of
    from homofact.sweeps.work import do

    warm_up()
    for line in sys.stdin:
        try:
            answer = do(task_of(json.loads(line)), folder)
        except OSError as error:
            answer = {"stop": f"{error.filename or folder}: {error.strerror or error}"}
        except Exception as error:
            answer = {"refused": f"{type(error).__name__}: {' '.join(str(error).split())}"}
        try:
            os.write(answers, f"{json.dumps(answer)}\n".encode())
        except BrokenPipeError:
            break  # the client has gone; the result is there
    return 0


if __name__ == "__main__":
    sys.exit(main())
