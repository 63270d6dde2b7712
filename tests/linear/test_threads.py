"""Libraries stay on one thread for the whole of a fit, whatever numba starts meanwhile."""

import os
import subprocess
import sys

PROGRAM = """
import torch
from homofact.linear.threads import in_parallel, one_thread

@one_thread
def inside():
    in_parallel(lambda piece: piece, [1, 2])
    return torch.get_num_threads()

print(inside())
"""


def test_the_first_work_of_a_process_leaves_torch_on_one_thread() -> None:
    """numba starts its threads when it is first asked for them, and sets the number that torch reads."""
    environment = os.environ | {"NUMBA_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"}
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True, timeout=120
    )
    assert ended.stdout.split() == ["1"]
