"""The catalogue of messages about bad input; `refusals.refused` compares each where it is raised."""

import re

import pytest
import refusals

from homofact.errors import BadInput

MESSAGES = [message for messages in refusals.catalogue().values() for message in messages]


def test_it_has_every_message_once_and_in_order() -> None:
    assert len(MESSAGES) >= 150
    for messages in refusals.catalogue().values():
        assert messages == sorted(set(messages))


def test_messages_speak_of_settings_not_of_options_of_a_command() -> None:
    flags = [message for message in MESSAGES if re.search(r"(^|[\s(])--[a-z]", message)]
    # One is left: files/folder.py.
    assert [message for message in flags if not message.endswith("expected a new folder or --force")] == []


def test_what_is_not_in_the_catalogue_fails() -> None:
    with pytest.raises(AssertionError, match="not in tests/messages"):
        refusals.check("brdf", "a message that nobody has read")
    with pytest.raises(AssertionError, match="size"), refusals.refused(where="side"):
        raise BadInput(where="size", found=0)
    with pytest.raises(AssertionError, match="0"), refusals.refused(found="1"):
        raise BadInput(where="size", found=0)


def test_folders_of_the_machine_are_left_out() -> None:
    own = "/tmp/pytest-of-me/pytest-12/popen-gw1/test_a0"
    assert (
        refusals.plain(f"{own}/a.toml: found '{own}', expected {refusals.ROOT}/b")
        == "HERE/a.toml: found 'HERE', expected b"
    )
