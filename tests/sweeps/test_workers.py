"""Workers may die, at any time and in any way: what is done stays done, what is not is done once more."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from sweep_stubs import STUB, done, log, run, stub_tasks

from homofact.errors import BadInput
from homofact.sweeps.ledger import SweepLedger
from homofact.sweeps.local import Local

TESTS = Path(__file__).parent.parent
# A worker that is waited for in vain fails the test in seconds, not after the suite's own limit.
pytestmark = pytest.mark.timeout(60)


def test_every_task_is_done_once_and_shared_by_the_workers(tmp_path: Path) -> None:
    tasks = stub_tasks(["sleep 0.05"] * 12)
    state, endings = run(tmp_path, tasks)
    assert state.left == 0
    assert sorted(done(tmp_path, tasks)) == list(range(12))
    assert sorted(number for _, number in log(tmp_path)) == list(range(12))
    assert len({process for process, _ in log(tmp_path)}) == 2
    assert len(endings) == 12


def test_what_is_done_is_not_done_again(tmp_path: Path) -> None:
    tasks = stub_tasks(["ok"] * 4)
    run(tmp_path, tasks[:3])
    state, endings = run(tmp_path, tasks)
    assert (state.before, state.done) == (3, 4)
    assert [ending.task.settings["number"] for ending in endings] == [3]
    assert len(log(tmp_path)) == 4


def test_a_task_whose_worker_died_is_tried_once_more(tmp_path: Path) -> None:
    tasks = stub_tasks(["ok", "once", "ok", "ok"])
    state, endings = run(tmp_path, tasks)
    assert sorted(done(tmp_path, tasks)) == [0, 1, 2, 3]
    assert [each.died for each in endings if each.died] == ["its worker ended by signal 9"]
    assert state.aside == {}
    assert list((tmp_path / "aside").iterdir()) == []
    # The dead worker took its own task with it and no other.
    assert sorted(number for _, number in log(tmp_path)) == [0, 1, 1, 2, 3]


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("die", "its worker ended by signal 9"),
        ("exit", "its worker ended with exit code 3"),
    ],
)
def test_a_task_that_kills_two_workers_is_set_aside_and_named(tmp_path: Path, how: str, words: str) -> None:
    tasks = stub_tasks(["ok", how, "ok"])
    state, _ = run(tmp_path, tasks)
    assert sorted(done(tmp_path, tasks)) == [0, 2]
    assert [(each.task.label, each.reason, each.deaths, each.final) for each in state.aside.values()] == [
        (how, words, 2, True)
    ]
    assert state.left == 0
    again, endings = run(tmp_path, tasks)
    assert endings == []
    assert list(again.aside) == list(state.aside)
    _, endings = run(tmp_path, tasks, retry=True)
    assert len(endings) == 2


def test_a_death_counts_after_a_restart_too(tmp_path: Path) -> None:
    tasks = stub_tasks(["die"])
    ledger = SweepLedger(tmp_path)
    ledger.begin("stub", tasks)
    ledger.set_aside(tasks[0], "its worker ended by signal 9", 1)
    state, endings = run(tmp_path, tasks)
    assert len(endings) == 1
    assert next(iter(state.aside.values())).deaths == 2


def test_a_worker_that_answers_nonsense_is_as_one_that_died(tmp_path: Path) -> None:
    tasks = stub_tasks(["ok", "garbage"])
    state, _ = run(tmp_path, tasks)
    assert sorted(done(tmp_path, tasks)) == [0]
    assert [each.final for each in state.aside.values()] == [True]


def test_a_refused_task_is_set_aside_at_once(tmp_path: Path) -> None:
    tasks = stub_tasks(["refuse", "ok"])
    state, endings = run(tmp_path, tasks)
    assert sorted(done(tmp_path, tasks)) == [1]
    assert [each.reason for each in state.aside.values()] == ["log mean: found nan"]
    assert len(endings) == 2


def test_a_full_disk_ends_all_and_the_same_command_goes_on(tmp_path: Path) -> None:
    tasks = stub_tasks(["ok", "full", "ok", "ok", "ok"])
    with pytest.raises(BadInput, match=r"No space left on device$"):
        run(tmp_path, tasks, workers=1)
    assert sorted(done(tmp_path, tasks)) == [0]
    later = [*tasks[:1], *tasks[2:]]
    assert run(tmp_path, later)[0].done == 4


def test_an_error_of_the_clients_own_ends_the_workers(tmp_path: Path) -> None:
    def broken(_: object) -> bool:
        raise RuntimeError("told")

    SweepLedger(tmp_path).begin("stub", [])
    with pytest.raises(RuntimeError, match=r"^told$"):
        Local(tmp_path, 2, STUB).run(stub_tasks(["ok", "sleep 60", "ok"]), broken)
    assert not _alive({process for process, _ in log(tmp_path)})


@pytest.mark.slow
def test_a_killed_client_leaves_no_workers_and_nothing_is_redone(tmp_path: Path) -> None:
    code = f"""
import sys
sys.path.insert(0, {str(TESTS)!r})
from pathlib import Path
from sweep_stubs import run, stub_tasks
run(Path({str(tmp_path)!r}), stub_tasks(["sleep 0.2"] * 40))
"""
    client = subprocess.Popen([sys.executable, "-c", code])
    _until(lambda: (tmp_path / "log").exists() and len(log(tmp_path)) >= 6)
    client.send_signal(signal.SIGKILL)
    client.wait()
    workers = {process for process, _ in log(tmp_path)}
    # Each ends when it has finished the task that it was at.
    _until(lambda: not _alive(workers))
    tasks = stub_tasks(["sleep 0.2"] * 40)
    before = done(tmp_path, tasks)
    assert 4 <= len(before) < 40
    begun = [number for _, number in log(tmp_path)]
    assert sorted(before) == sorted(begun), "a worker finishes the task that it is at"
    quick = stub_tasks(["ok"] * 40)
    state, _ = run(tmp_path, quick)
    assert state.done == 40
    assert sorted(number for _, number in log(tmp_path)) == list(range(40))


@pytest.mark.slow
def test_a_worker_whose_client_has_gone_ends_without_a_word(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "homofact.sweeps.worker", str(tmp_path)]
    ended = subprocess.run(command, input=b"{}\n{}\n", stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (0, b"")


@pytest.mark.slow
def test_two_sweeps_at_once_in_one_folder_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "sweep"
    code = f"""
import sys
sys.path.insert(0, {str(TESTS)!r})
from pathlib import Path
from sweep_stubs import run, stub_tasks
run(Path({str(folder)!r}), stub_tasks(["sleep 20"]))
"""
    client = subprocess.Popen([sys.executable, "-c", code])
    try:
        _until(lambda: (folder / "log").exists())
        with pytest.raises(BadInput, match="another run of homofact"):
            run(folder, stub_tasks(["ok"]))
    finally:
        client.kill()
        client.wait()
        for process, _ in log(folder):
            os.kill(process, signal.SIGKILL)


def test_no_workers_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"^workers: found 0, expected 1 or more$"):
        Local(tmp_path, 0)


def _alive(processes: set[int]) -> bool:
    def lives(process: int) -> bool:
        try:
            return (Path("/proc") / str(process) / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
        except OSError:
            return False

    return any(map(lives, processes))


def _until(true: object, patience: float = 60.0) -> None:
    assert callable(true)
    begun = time.monotonic()
    while not true():
        assert time.monotonic() - begun < patience
        time.sleep(0.05)
