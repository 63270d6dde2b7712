"""A sweep on Dask's own processes: the same results, also where a worker or the scheduler is killed."""

import contextlib
import gc
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from ipaddress import ip_address
from pathlib import Path

import pytest

from homofact.errors import BadInput
from homofact.sweeps import cluster
from homofact.sweeps.cluster import DaskCluster
from homofact.sweeps.ledger import SweepLedger
from homofact.sweeps.local import TaskEnding
from homofact.sweeps.parcel import packed, unpacked
from homofact.sweeps.run import State, sweep
from homofact.sweeps.sweep_file import read_sweep

pytest.importorskip("distributed", reason="distributed is not installed: pip install 'homofact[cluster]'")

FILE = """
sources = ["material:phong-*", "material:lafortune-*"]
[source]
count = 400
[[method]]
method = "mccool"
size = 4
"""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # Dask's own sockets, of processes that were killed
def test_workers_that_are_killed_and_a_scheduler_that_is_gone(tmp_path: Path) -> None:
    (tmp_path / "small.toml").write_text(FILE, encoding="utf-8")
    asked = read_sweep(tmp_path / "small.toml")
    out, file = tmp_path / "out", tmp_path / "scheduler.json"
    scheduler = _start("scheduler", "--scheduler-file", str(file), "--port", "0", "--no-dashboard")
    workers = [_start("worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-nanny") for _ in range(2)]
    try:
        _until(file.is_file)
        killed: list[int] = []

        def told(_: State, ending: TaskEnding | None) -> None:
            if ending is not None and ending.seconds is not None and not killed:
                killed.append(workers[0].pid)
                os.kill(workers[0].pid, signal.SIGKILL)

        state = sweep(asked, out, DaskCluster(out, str(file), 2, lambda _: None), told)
        assert (state.done, state.left, state.aside) == (len(asked.sources), 0, {})
        times = {each.key: (each.folder / "report.json").stat().st_mtime_ns for each in _results(out)}
        assert len(times) == len(asked.sources)
        more = FILE.replace("size = 4", "size = 5")
        (tmp_path / "small.toml").write_text(more, encoding="utf-8")

        def kill_scheduler(_: State, ending: TaskEnding | None) -> None:
            if ending is not None:
                os.kill(scheduler.pid, signal.SIGKILL)

        with pytest.raises(BadInput, match=r"the scheduler is gone \(the same command goes on"):
            sweep(
                read_sweep(tmp_path / "small.toml"), out, DaskCluster(out, str(file), 2, lambda _: None), kill_scheduler
            )
    finally:
        for process in (scheduler, *workers):
            process.kill()
            process.wait()
    ledger = SweepLedger(out)
    assert 1 <= sum(map(ledger.is_done, ledger.asked())) < len(asked.sources)


# What no scheduler is, and a place in a folder of the test's own for a scheduler's file of that text.
NO_SCHEDULERS = (
    "", "://", "tcp://", "foo://x", "tcp://127.0.0.1", "tcp://127.0.0.1:x", "tcp://[::1", "tcp://127.0.0.1:99999",
    "tcp://127.0.0.1:1", "tcp://\0:1", "inproc://x", "ucx://127.0.0.1:1", "tls://127.0.0.1:1", "gone.json",
    "os:getcwd", "os:abort", "math:pi", "os:", ":x", "a.b:c", "1:2", ".x:y", "..:", "json:JSONDecoder",
    "subprocess:Popen", "distributed:Client", "distributed:Scheduler", "x\0:y",
)  # fmt: skip
NO_FILES = ("{}", '{"address": 3}', '{"address": null}', '{"address": "x"}', '{"address": ""}', "[]", "x")


@pytest.fixture
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_PATIENCE", 0.5)


def connected(folder: Path, scheduler: str) -> None:
    """Connect as a sweep does, in a thread that is given up after some seconds: what waits for ever fails the test."""
    ended: list[BaseException | None] = []

    def connect() -> None:
        try:
            with DaskCluster(folder, scheduler, 1, lambda _: None)._client():
                ended.append(None)
        except BaseException as error:
            ended.append(error)

    thread = threading.Thread(target=connect, daemon=True)
    thread.start()
    thread.join(20)
    assert ended, "it waits for ever"
    if ended[0] is not None:
        raise ended[0]


@pytest.mark.usefixtures("patience")
@pytest.mark.parametrize("words", NO_SCHEDULERS)
def test_what_is_no_scheduler_is_refused_in_a_line(words: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        connected(tmp_path, words)
    assert caught.value.where == "scheduler"
    assert "\n" not in str(caught.value)
    assert caught.value.expected


@pytest.mark.usefixtures("patience")
@pytest.mark.parametrize("text", NO_FILES)
def test_a_schedulers_file_without_an_address_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "scheduler.json").write_text(text)
    with pytest.raises(BadInput):
        connected(tmp_path, str(tmp_path / "scheduler.json"))


@pytest.mark.usefixtures("patience")
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # Dask's own sockets, of connections that were given up
@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", bytes(64)])
@pytest.mark.parametrize("scheme", ["tcp", "ws"])
def test_what_answers_otherwise_or_never_is_given_up(scheme: str, answer: bytes, tmp_path: Path) -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        kept: list[socket.socket] = []

        def serve() -> None:
            with contextlib.suppress(OSError):
                while True:
                    kept.append(silent.accept()[0])
                    kept[-1].sendall(answer)

        threading.Thread(target=serve, daemon=True).start()
        with pytest.raises(BadInput) as caught:
            connected(tmp_path, f"{scheme}://127.0.0.1:{silent.getsockname()[1]}")
        _close_other_ends(kept)
    assert caught.value.where == "scheduler"


@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_cluster_of_this_machine_listens_for_this_machine_alone(tmp_path: Path) -> None:
    psutil = pytest.importorskip("psutil")
    with DaskCluster(tmp_path, "local", 1, lambda _: None)._client():
        here = psutil.Process()
        places = {
            each.laddr.ip
            for process in (here, *here.children(recursive=True))
            for each in process.net_connections(kind="inet")
            if each.status == psutil.CONN_LISTEN
        }
    assert places
    assert all(ip_address(place).is_loopback for place in places), places


def test_a_file_and_a_folder_come_out_of_a_parcel_as_they_were(tmp_path: Path) -> None:
    place = tmp_path / "from" / "paint"
    (place / "below").mkdir(parents=True)
    (place / "fit.npz").write_bytes(bytes(range(256)))
    (place / "below" / "picture.png").write_bytes(b"a picture")
    assert packed(place) == packed(place)
    for number, what in enumerate((place, place / "fit.npz")):
        found = unpacked(packed(what), tmp_path / f"to-{number}")
        assert found == tmp_path / f"to-{number}" / what.name
        assert found.is_dir() == what.is_dir()
    assert (tmp_path / "to-0" / "paint" / "below" / "picture.png").read_bytes() == b"a picture"
    assert (tmp_path / "to-0" / "paint" / "fit.npz").read_bytes() == bytes(range(256))
    assert (tmp_path / "to-1" / "fit.npz").read_bytes() == bytes(range(256))


def _close_other_ends(kept: list[socket.socket]) -> None:
    """Close the connections and the clients' sockets, which Dask leaves open: a later test would be warned of them."""
    clients = set()
    for each in kept:
        with contextlib.suppress(OSError):  # of a client that has closed
            clients.add(each.getpeername())
        each.close()
    for found in gc.get_objects():
        if type(found) is socket.socket and found.fileno() >= 0 and found.getsockname() in clients:
            found.close()


def _results(folder: Path) -> list:
    return [type("Found", (), {"key": each.task.key, "folder": each.folder}) for each in SweepLedger(folder).results()]


def _start(*words: str) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _until(true: object, patience: float = 60.0) -> None:
    assert callable(true)
    begun = time.monotonic()
    while not true():
        assert time.monotonic() - begun < patience
        time.sleep(0.05)
