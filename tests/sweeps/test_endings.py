"""What becomes of Dask's answers, by a client that is none: what is given out, how often, and what is said of it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from sweep_stubs import stub_tasks

from homofact.errors import BadInput
from homofact.sweeps.cluster import DaskCluster
from homofact.sweeps.ledger import SweepLedger
from homofact.sweeps.local import TaskEnding
from homofact.sweeps.parcel import packed, unpacked
from homofact.sweeps.run import sweep_tasks
from homofact.sweeps.task import Task, task_of
from homofact.sweeps.work import put

distributed = pytest.importorskip("distributed", reason="distributed is not installed: pip install 'homofact[cluster]'")


class Future:
    """Done when it is made: with an answer, or with an error."""

    def __init__(self, found: Any, status: str = "finished") -> None:
        self.found, self.status = found, status
        self.released: Callable[[], object] = lambda: None

    def add_done_callback(self, told: Callable[["Future"], object]) -> None:
        told(self)

    def exception(self) -> BaseException | None:
        return self.found if isinstance(self.found, BaseException) else None

    def result(self) -> Any:
        return self.found

    def release(self) -> None:
        self.released()


class Client:
    """Answers each task, by the label, with the next of what it is given; remembers what was out."""

    def __init__(self, answers: dict[str, list[Any]], threads: dict[str, int]) -> None:
        self.answers, self.threads = answers, threads
        self.given: list[tuple[str, bytes | None]] = []

    def nthreads(self) -> dict[str, int]:
        return self.threads

    def submit(self, _: object, record: dict[str, Any], parcel: bytes | None, **__: object) -> Future:
        task = task_of(record)
        self.given.append((task.label, parcel))
        found = self.answers[task.label].pop(0)
        return found if isinstance(found, Future) else Future(found)


def killed(allowed: int) -> BaseException:
    from distributed.scheduler import KilledWorker

    last: Any = SimpleNamespace(address="tcp://a")
    return KilledWorker("a key", last, allowed)


def cluster(folder: Path, client: Client, monkeypatch: pytest.MonkeyPatch) -> DaskCluster:
    @contextmanager
    def connected(_: DaskCluster) -> Iterator[Client]:
        yield client

    monkeypatch.setattr(DaskCluster, "_client", connected)
    return DaskCluster(folder, "tcp://nowhere:8786", 7, lambda _: None)


def done(seconds: float = 1.0) -> dict[str, Any]:
    return {"seconds": seconds}


def run(
    folder: Path, answers: dict[str, list[Any]], monkeypatch: pytest.MonkeyPatch, tasks: list[Task] | None = None
) -> tuple[list[TaskEnding], Client]:
    client = Client(answers, {"a": 1, "b": 1})
    endings: list[TaskEnding] = []

    def ended(ending: TaskEnding) -> bool:
        endings.append(ending)
        return ending.died is not None and len(endings) < 10

    cluster(folder, client, monkeypatch).run(tasks or stub_tasks(list(answers)), ended)
    return endings, client


def test_a_source_that_is_missing_there_is_sent_and_has_not_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.brdf").write_text("measured")
    (task,) = stub_tasks(["a"])
    task = task_of({**task.record(), "source": str(tmp_path / "a.brdf")})
    endings, client = run(tmp_path, {"a": [{"missing": True}, done()]}, monkeypatch, [task])
    assert [each.seconds for each in endings] == [1.0]
    (_, nothing), (_, parcel) = client.given
    assert nothing is None
    assert parcel is not None
    assert unpacked(parcel, tmp_path / "there").read_text() == "measured"


def test_a_result_comes_into_the_sweeps_folder_and_one_that_is_there_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = stub_tasks(["a", "b"])
    made = tmp_path / "made"
    for task, text in ((first, "new"), (second, "new")):
        (made / task.key).mkdir(parents=True)
        (made / task.key / "factorization.npz").write_text(text)
    out = tmp_path / "out"
    there = SweepLedger(out).place(second)
    there.mkdir(parents=True)
    (there / "factorization.npz").write_text("old")
    parcels = [packed(made / task.key) for task in (first, second)]
    answers = {"a": [done() | {"result": parcels[0]}], "b": [done() | {"result": parcels[1]}]}
    endings, _ = run(out, answers, monkeypatch, [first, second])
    assert [each.seconds for each in endings] == [1.0, 1.0]
    assert [(SweepLedger(out).place(task) / "factorization.npz").read_text() for task in (first, second)] == [
        "new",
        "old",
    ]


def test_a_future_is_released_before_its_result_is_put_into_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else it is computed again where its worker dies while the client writes."""
    (task,) = stub_tasks(["a"])
    (tmp_path / "made" / task.key).mkdir(parents=True)
    (tmp_path / "made" / task.key / "factorization.npz").write_text("new")
    ledger, was_done = SweepLedger(tmp_path / "out"), []
    future = Future(done() | {"result": packed(tmp_path / "made" / task.key)})
    future.released = lambda: was_done.append(ledger.is_done(task))
    run(ledger.folder, {"a": [future]}, monkeypatch, [task])
    assert (was_done, ledger.is_done(task)) == ([False], True)


def test_what_a_worker_answers_is_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def one(answer: Any) -> TaskEnding:
        (ending, *_), _ = run(tmp_path, {"a": [answer, done(2.0)]}, monkeypatch)
        return ending

    assert one(done(0.0)).seconds == 0.0
    assert one({"refused": "log mean: found nan"}).refused == "log mean: found nan"
    assert one(ValueError("two\n lines")).refused == "ValueError: two lines"
    full = one(OSError(28, "No space left on device", "/there"))
    assert (full.died, full.refused) == ("/there: No space left on device", None)
    assert (one(killed(0)).died, one(killed(0)).deaths) == ("its worker died", 1)


def test_a_task_whose_worker_died_is_given_out_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    endings, client = run(tmp_path, {"a": [killed(0), done()], "b": [done()]}, monkeypatch)
    assert sorted(label for label, _ in client.given) == ["a", "a", "b"]
    assert len(endings) == 3


def test_what_somebody_elses_scheduler_has_tried_by_itself_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    client = Client({"a": [killed(3)]}, {"a": 1})
    engine = cluster(tmp_path, client, monkeypatch)
    state = sweep_tasks("stub", stub_tasks(["a"]), tmp_path, engine, lambda *_: None)
    assert [(each.deaths, each.final) for each in state.aside.values()] == [(4, True)]
    assert len(client.given) == 1


@pytest.mark.parametrize(("threads", "most"), [({}, 1), ({"a": 1, "b": 1}, 2), ({"a": 3}, 3)])
def test_no_more_is_out_than_there_are_threads(
    tmp_path: Path, threads: dict[str, int], most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A task that waited behind another on one worker would be lost with that, and blamed for it."""
    client = Client({f"{k}": [done()] for k in range(9)}, threads)
    out = []

    def ended(_: TaskEnding) -> bool:
        out.append(len(client.given) - len(out))
        return False

    cluster(tmp_path, client, monkeypatch).run(stub_tasks(list(client.answers)), ended)
    assert len(out) == 9
    assert max(out) == most
    assert [label for label, _ in client.given] == [f"{k}" for k in range(9)]


@pytest.mark.parametrize("status", ["cancelled", "lost"])
def test_a_scheduler_that_is_gone_is_one_line(tmp_path: Path, status: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadInput) as refusal:
        run(tmp_path, {"a": [Future(None, status)]}, monkeypatch)
    assert str(refusal.value) == "tcp://nowhere:8786: the scheduler is gone (the same command goes on)"


def test_a_disk_that_is_full_is_no_fault_of_the_task(tmp_path: Path) -> None:
    """Else the task would be set aside for it."""
    (task,) = stub_tasks(["a"])
    ledger = SweepLedger(tmp_path)

    def full(_: Path) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left on device"):
        put(ledger, task, full)
    assert not ledger.is_done(task)
    put(ledger, task, lambda place: (place / "factorization.npz").touch())
    assert ledger.is_done(task)

    def later(place: Path) -> None:
        (place / "factorization.npz").write_text("later")

    # Somebody else's result, done meanwhile, stays.
    put(ledger, task, later)
    assert (ledger.place(task) / "factorization.npz").read_text() == ""
