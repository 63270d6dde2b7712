"""The time that is left: how it follows the clock, and in words."""

import pytest

from homofact.evaluation.time_left import TimeLeft, about, between, spread


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.0, "under 10 s"), (10, "about 10 s"), (61, "about 60 s"), (90, "about 2 min"), (305, "about 5 min"),
        (3600, "about 60 min"), (9000, "about 2.5 h"), (4 * 86400, "about 4 days"), (2.6e12, "about many months"),
    ],
)  # fmt: skip
def test_words(seconds: float, words: str) -> None:
    assert about(seconds) == words


@pytest.mark.parametrize(
    ("least", "most", "words"),
    [
        (1, 9, "under 10 s"), (20, 40, "about 28 s"), (20, 60, "about 20 to 60 s"), (65, 200, "about 60 s to 4 min"),
        (100, 400, "about 1 to 7 min"), (50, 399, "about 50 s to 7 min"), (5, 25, "up to 30 s"), (0, 55, "up to 60 s"),
        (0, 65, ""), (50, 401, ""),
        (3600, 20000, "about 60 min to 6 h"), (86400 * 2, 86400 * 5, "about 2 to 5 days"),
    ],
)  # fmt: skip
def test_a_number_stands_alone_only_if_it_is_known_within_a_factor_of_2(least: float, most: float, words: str) -> None:
    expected = 28.0 if (least, most) == (20, 40) else (least + most) / 2
    assert between(expected, least, most) == words.replace("28 s", "30 s")


def test_a_step_says_that_its_time_is_of_the_step() -> None:
    assert TimeLeft(30, 25, 40, 40).words() == "about 30 s left in this step"
    assert TimeLeft(30, 25, 40, 40, whole=True).words() == "about 30 s left"


def test_the_time_runs_down_and_the_last_part_may_take_longer() -> None:
    left = TimeLeft.within(40)
    assert [left.after(passed).now for passed in (0, 10, 30, 60)] == [
        (40, 20, 80), (30, 10, 70), (10, 0, 50), (0, 0, 20),
    ]  # fmt: skip
    assert left.after(20).after(40) == left.after(60)
    assert left.after(90).words() == left.after(1000).words() == "takes longer than expected"


def test_a_part_that_takes_too_long_delays_the_rest_the_more_the_less_is_known() -> None:
    """Ten parts of 10 s, of which one takes 60 s: the range never promises less than before."""
    fresh, known = (TimeLeft(100, 50, 200, 20, seconds) for seconds in (1.0, 500.0))
    assert fresh.after(19).now == (81, 31, 181)
    assert fresh.after(60).now[2] > 2.9 * 200 - 60.0 - 1
    assert known.after(60).now[2] < 200
    mosts = [fresh.after(passed).now[2] for passed in range(20, 200)]
    assert mosts == sorted(mosts)


def test_nothing_is_said_where_nothing_is_left() -> None:
    assert TimeLeft.at_rate(4, 0, 10.0).words() == ""
    assert TimeLeft(0, 0, 0, 0).words() == ""


def test_nothing_passes_while_no_part_runs() -> None:
    left = TimeLeft(30, 10, 90, 0.0, whole=True)
    assert left.after(50).now == left.now == (30, 10, 90)


def test_the_rate_of_parts_is_surer_the_more_of_them_are_done() -> None:
    few, many = TimeLeft.at_rate(1, 9, 10.0), TimeLeft.at_rate(90, 10, 900.0)
    assert (few.seconds, many.seconds) == (90, 100)
    assert few.most / few.least > 2.5
    assert many.most / many.least < 1.3
    assert many.words() == "about 2 min left in this step"
    assert [spread(done) for done in (0, 3)] == [2, 1.5]
