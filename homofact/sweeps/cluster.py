"""Run tasks on other machines: Dask's scheduler distributes them, and the results come back as whole folders.

The scheduler is

    local                        Dask's own processes, their dashboard for this machine alone
    tcp://HOST:8786, FILE.json   a scheduler that runs, by its address or the file that it writes
    MODULE:CLASS                 a cluster class of Dask's, made with its own configuration (dask.config) and scaled:
                                 dask_jobqueue:SLURMCluster, dask_kubernetes.operator:KubeCluster

If a worker finds a file with the source's digest at its path, the worker opens this file. Otherwise the client sends
the file as bytes. The worker writes its result to a folder of its own, and sends this folder back packed; only the
client writes to the sweep's folder. The client submits at most as many tasks as the workers have threads. A worker that
dies therefore loses only its current tasks and no waiting ones, and the client's memory does not grow with the sweep.
"""

import asyncio
import importlib
import queue
import tempfile
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.files import extras
from homofact.files.fields import Fields
from homofact.files.folder import write_folder
from homofact.files.kinds import RESULT
from homofact.files.reading import read_json, split_member
from homofact.sweeps.ledger import SweepLedger
from homofact.sweeps.local import TaskEnding
from homofact.sweeps.parcel import packed, unpacked
from homofact.sweeps.task import Task, task_of

LOCAL = "local"
_PATIENCE = 30  # seconds that a scheduler has to answer
_DASHBOARD = "127.0.0.1:8787"  # or, where that is taken, another port
_LOOK = 1.0  # seconds after which workers that have come since are seen, though no task ends
_EXPECTED = "local, an address such as tcp://host:8786, a scheduler's .json file, or MODULE:CLASS of a cluster"


def do_elsewhere(record: dict[str, Any], parcel: bytes | None) -> dict[str, Any]:
    """Run a task on a machine that may not see the client's files; return `work.do`'s answer, "result" packed.

    Without a `parcel` of the source and without its file on this machine, the answer is "missing".
    """
    from homofact.sweeps.work import do

    task = task_of(record)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        words: str | None = None
        if parcel is not None:
            inner = split_member(task.source)[1]
            file = unpacked(parcel, folder / "source")
            words = str(file) if inner is None else f"{file}#{inner}"
        elif not task.is_here():
            return {"missing": True}
        answer = do(task, folder, words)
        if "seconds" in answer:
            answer["result"] = packed(SweepLedger(folder).place(task))
    return answer


class DaskCluster:
    """Dask's workers for the sweep in `folder`; `notify` receives a line with the address of Dask's dashboard."""

    def __init__(self, folder: Path, scheduler: str, count: int, notify: Callable[[str], object]) -> None:
        """Nothing is connected yet. Raises BadInput for no workers, no such scheduler, and where Dask is missing."""
        if count < 1:
            raise BadInput(where="workers", found=count, expected="1 or more")
        extras.library("distributed", "scheduler")
        self._folder, self._scheduler, self._count, self._notify = folder, scheduler, count, notify
        self._promised = 0  # workers that were ordered, and may be still to come

    def run(self, tasks: Iterable[Task], ended: Callable[[TaskEnding], bool]) -> None:
        """Run all tasks, as `local.Local.run`. Raises BadInput if the scheduler cannot be reached, or disappears."""
        from concurrent.futures import CancelledError

        from distributed.comm.core import CommClosedError

        waiting = list(reversed(list(tasks)))
        out: dict[Any, Task] = {}
        with self._client() as client:
            ready: queue.SimpleQueue[Any] = queue.SimpleQueue()

            def give(task: Task, parcel: bytes | None = None) -> None:
                future = client.submit(do_elsewhere, task.record(), parcel, pure=False, retries=0)
                out[future] = task
                future.add_done_callback(ready.put)

            try:
                while waiting or out:
                    room = max(1, self._promised, sum(client.nthreads().values()))
                    while waiting and len(out) < room:
                        give(waiting.pop())
                    try:
                        future = ready.get(timeout=_LOOK)
                    except queue.Empty:
                        continue
                    task = out.pop(future)
                    ending, missing = self._ending(task, future)
                    if missing:
                        give(task, packed(Path(split_member(task.source)[0])))
                    elif ended(ending):
                        waiting.append(task)
            except (CommClosedError, CancelledError, TimeoutError) as error:
                what = "the scheduler is gone"
                raise BadInput(what, where=self._scheduler, hint="the same command goes on") from error

    def _ending(self, task: Task, future: Any) -> tuple[TaskEnding, bool]:
        """How a task ended, and whether its source was missing there; a result is put into its place."""
        from concurrent.futures import CancelledError

        from distributed.scheduler import KilledWorker

        if future.status in ("cancelled", "lost"):
            raise CancelledError
        error = future.exception()
        if isinstance(error, KilledWorker):
            # A scheduler of somebody else's has tried it on several workers by itself.
            return TaskEnding(task, died="its worker died", deaths=1 + error.allowed_failures), False
        if isinstance(error, OSError):
            return TaskEnding(task, died=f"{error.filename or 'its worker'}: {error.strerror or error}"), False
        if error is not None:
            return TaskEnding(task, refused=f"{type(error).__name__}: {' '.join(str(error).split())}"), False
        answer = future.result()
        # Before the result is in its place: what a client still holds is computed again when its worker dies.
        future.release()
        if "result" in answer:
            self._put(task, answer["result"])
        return TaskEnding(task, answer.get("seconds"), answer.get("refused")), bool(answer.get("missing"))

    def _put(self, task: Task, parcel: bytes) -> None:
        """A packed result into its place, whole or not at all."""
        ledger = SweepLedger(self._folder)
        with tempfile.TemporaryDirectory() as place:
            result = unpacked(parcel, Path(place))

            def fill(folder: Path) -> None:
                for file in result.iterdir():
                    (folder / file.name).write_bytes(file.read_bytes())

            if not ledger.is_done(task):
                write_folder(ledger.place(task), RESULT, fill)

    @contextmanager
    def _client(self) -> Iterator[Any]:
        import distributed
        from dask import config

        with ExitStack() as stack:
            # A task that kills its worker is counted here, not tried again by a scheduler that is made here.
            stack.enter_context(config.set({"distributed.scheduler.allowed-failures": 0}))
            place = self._place(stack)
            try:
                client = stack.enter_context(distributed.Client(place, timeout=_PATIENCE))
            except (OSError, TimeoutError) as error:
                raise _unusable(f"{self._scheduler} cannot be reached", error) from error
            if client.dashboard_link:
                self._notify(f"homofact: the scheduler's dashboard: {client.dashboard_link}")
            yield client

    def _place(self, stack: ExitStack) -> Any:
        """What Dask's client connects to: an address, or a cluster that ends with the sweep."""
        import distributed
        from distributed.deploy.cluster import Cluster

        words = self._scheduler
        if words == LOCAL:
            workers = {"n_workers": self._count, "threads_per_worker": 1, "processes": True}
            return stack.enter_context(distributed.LocalCluster(**workers, dashboard_address=_DASHBOARD))
        if "://" in words:
            return _answering(words)
        if words.endswith(".json"):
            if not Path(words).is_file():
                raise BadInput(f"no file {words}", where="scheduler", expected=_EXPECTED)
            found = Fields(f"{words}: ", read_json(words, "a Dask scheduler's file"))
            return _answering(found.text("address"))
        module, colon, name = words.partition(":")
        if not colon:
            raise BadInput(where="scheduler", found=repr(words), expected=_EXPECTED)
        try:
            kind = getattr(importlib.import_module(module), name)
        except Exception as error:  # whatever another's module raises
            raise _unusable(f"found {words!r}", error) from error
        # Nothing but a cluster is called: a word such as subprocess:Popen names something else.
        if not (isinstance(kind, type) and issubclass(kind, Cluster)):
            raise BadInput(where="scheduler", found=f"{words!r}, which is no cluster", expected=_EXPECTED)
        try:
            cluster: Any = stack.enter_context(kind())
            cluster.scale(self._count)
        except Exception as error:  # whatever its own configuration leads to
            raise _unusable(f"{words} cannot be made", error) from error
        self._promised = self._count
        return cluster


def _answering(address: str) -> str:
    """Return the address if a scheduler answers there within `_PATIENCE` seconds; raise BadInput otherwise.

    This check comes before the client, since Dask's own client waits forever if a server accepts the connection and
    sends nothing.
    """
    from distributed import Security
    from distributed.core import rpc

    async def asked() -> str:
        given = Security().get_connection_args("client")
        async with rpc(address, timeout=_PATIENCE, connection_args=given) as scheduler:
            found: Any = await scheduler.identity()
            return str(found["type"])

    async def in_time() -> str:
        return await asyncio.wait_for(asked(), _PATIENCE)

    try:
        # In a thread of its own: a caller's (a notebook's) may have a loop that runs.
        with ThreadPoolExecutor(1) as pool:
            kind = pool.submit(asyncio.run, in_time()).result()
    except Exception as error:  # an address that is none, a refusal, silence, another protocol
        raise _unusable(f"{address} cannot be reached", error) from error
    if kind != "Scheduler":
        raise BadInput(where="scheduler", found=f"{address}, a {kind}", expected=_EXPECTED)
    return address


def _unusable(what: str, error: Exception) -> BadInput:
    reason = " ".join(str(error).split()) or f"no answer in {_PATIENCE} seconds"
    if isinstance(error, ImportError | OSError | TimeoutError | AttributeError):
        return BadInput(f"{what} ({reason})", where="scheduler", expected=_EXPECTED)
    return BadInput(f"{what} ({type(error).__name__}: {reason})", where="scheduler", expected=_EXPECTED)
