"""What an error says of itself: fields that a program can read, and the line that is made of them."""

import pickle

import pytest

from homofact.errors import BadInput, HomofactError, MissingDependency


def test_bad_input_is_a_value_error_with_fields() -> None:
    error = BadInput(where="size", found=0, expected="a whole number of at least 1", hint="8 is common")
    assert isinstance(error, ValueError)
    assert isinstance(error, HomofactError)
    assert (error.where, error.found) == ("size", "0")
    assert (error.expected, error.hint) == ("a whole number of at least 1", "8 is common")
    assert str(error) == "size: found 0, expected a whole number of at least 1 (8 is common)"


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (BadInput("no such file", where="a.png", expected="a PNG file"), "a.png: no such file, expected a PNG file"),
        (BadInput(found="none or both", expected="one of the two"), "found none or both, expected one of the two"),
        (BadInput(found="", where="name", expected="a name"), "name: found , expected a name"),
        (BadInput("the disk is full"), "the disk is full"),
    ],
)
def test_the_message_is_made_of_the_fields_that_there_are(error: BadInput, message: str) -> None:
    assert str(error) == message


def test_an_error_is_given_the_place_that_its_reader_knows() -> None:
    error = BadInput(where="eye", found="[0]", expected="three numbers")
    placed = error.at("camera[0]", ".").at("scene.toml")
    assert (placed.where, placed.found, placed.expected) == ("scene.toml: camera[0].eye", "[0]", "three numbers")
    assert str(placed) == "scene.toml: camera[0].eye: found [0], expected three numbers"
    assert error.where == "eye", "the error itself stays as it is"
    assert BadInput(found="two", expected="one").at("object[0]").where == "object[0]"
    assert error.moved_to("view").where == "view"
    assert error.with_hint("y is up").with_hint("in metres").hint == "y is up; in metres"


def test_errors_survive_the_way_between_processes() -> None:
    error = MissingDependency("pypng is not installed", where="a.png", expected="it", hint="pip install pypng")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is MissingDependency
    assert (str(again), again.where, again.found, again.hint) == (str(error), error.where, error.found, error.hint)
    assert str(again.at("view")).startswith("view: a.png: pypng")
