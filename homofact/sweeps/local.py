"""Workers on this machine: separate processes, each of which runs one task at a time.

If a worker dies, only its current task is lost. Another worker tries the task once more; if that worker dies too, the
task is set aside. One thread waits for each worker; the threads compute nothing.
"""

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.sweeps.task import Task

COMMAND = (sys.executable, "-m", "homofact.sweeps.worker")
_PATIENCE = 5.0  # seconds that a worker has to end by itself


@dataclass(frozen=True)
class TaskEnding:
    """How a task ended: done in `seconds`, `refused` for this reason, or how its worker `died`.

    `deaths` is the number of workers that died of it this time.
    """

    task: Task
    seconds: float | None = None
    refused: str | None = None
    died: str | None = None
    deaths: int = 1


class Local:
    """`count` workers for the sweep in `folder`; each has its share of the processors."""

    def __init__(self, folder: Path, count: int, command: Sequence[str] = COMMAND) -> None:
        """Nothing is started yet; `command` with the folder behind it is a worker. Raises BadInput for no workers."""
        if count < 1:
            raise BadInput(where="workers", found=count, expected="1 or more")
        self._folder, self._count, self._command = folder, count, command
        self._waiting: deque[Task] = deque()
        self._running = 0
        self._changed = threading.Condition()
        self._stop: str | None = None
        self._failure: BaseException | None = None
        self._processes: set[subprocess.Popen[str]] = set()

    def run(self, tasks: Iterable[Task], ended: Callable[[TaskEnding], bool]) -> None:
        """Run all tasks; `ended` is called for each and returns whether to retry it.

        Raises BadInput if a worker cannot write (a full disk), which ends all of them, and any exception that `ended`
        raises. No worker is left behind in any case.
        """
        self._waiting.extend(tasks)
        threads = [threading.Thread(target=self._serve, args=(ended,), daemon=True) for _ in range(self._count)]
        try:
            for thread in threads:
                thread.start()
            for thread in threads:
                while thread.is_alive() and self._stop is None and self._failure is None:
                    thread.join(0.2)
        finally:
            self._end()
            for thread in threads:
                thread.join()
        if self._failure is not None:
            raise self._failure
        if self._stop is not None:
            raise BadInput(self._stop)

    def _serve(self, ended: Callable[[TaskEnding], bool]) -> None:
        worker: subprocess.Popen[str] | None = None
        try:
            while (task := self._next()) is not None:
                if worker is None or worker.poll() is not None:
                    worker = self._started()
                ending = self._asked(worker, task)
                again = False
                with self._changed:
                    if ending is not None and self._stop is None and self._failure is None:
                        again = ended(ending)
                    self._running -= 1
                    if again:
                        self._waiting.append(task)
                    self._changed.notify_all()
        except BaseException as error:
            with self._changed:
                self._failure = self._failure or error
                self._running -= 1
                self._changed.notify_all()
        finally:
            if worker is not None and worker.stdin is not None:
                worker.stdin.close()

    def _next(self) -> Task | None:
        """A task; waits while one that runs may come back. None where there is nothing left to do."""
        with self._changed:
            while self._stop is None and self._failure is None:
                if self._waiting:
                    self._running += 1
                    return self._waiting.popleft()
                if not self._running:
                    return None
                self._changed.wait(0.5)
        return None

    def _started(self) -> "subprocess.Popen[str]":
        share = str(max(1, (os.cpu_count() or 1) // self._count))
        environment = {"OMP_NUM_THREADS": share, "NUMBA_NUM_THREADS": share} | dict(os.environ)
        worker = subprocess.Popen(
            [*self._command, str(self._folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            text=True,
            encoding="utf-8",
            start_new_session=True,
        )
        with self._changed:
            self._processes.add(worker)
        return worker

    def _asked(self, worker: "subprocess.Popen[str]", task: Task) -> TaskEnding | None:
        """How a worker ended a task; None where all workers are to stop."""
        assert worker.stdin is not None
        assert worker.stdout is not None
        try:
            worker.stdin.write(json.dumps(task.record()) + "\n")
            worker.stdin.flush()
            line = worker.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line.endswith("\n"):
            code = worker.wait()
            how = f"by signal {-code}" if code < 0 else f"with exit code {code}"
            return TaskEnding(task, died=f"its worker ended {how}")
        try:
            answer: dict[str, Any] = json.loads(line)
        except ValueError:
            worker.kill()
            worker.wait()
            return TaskEnding(task, died="its worker gave no answer that can be read")
        if "stop" in answer:
            with self._changed:
                self._stop = self._stop or str(answer["stop"])
            return None
        return TaskEnding(task, answer.get("seconds"), answer.get("refused"))

    def _end(self) -> None:
        """End what is left of the workers: nothing of theirs is half-written whenever they end."""
        with self._changed:
            self._waiting.clear()
            self._stop = self._stop if self._stop is not None or not self._running else ""
            all_of_them = list(self._processes)
        for worker in all_of_them:
            if worker.poll() is None:
                worker.terminate()
        for worker in all_of_them:
            try:
                worker.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                worker.kill()
                worker.wait()
            for pipe in (worker.stdin, worker.stdout):
                with contextlib.suppress(BrokenPipeError):
                    assert pipe is not None
                    pipe.close()
