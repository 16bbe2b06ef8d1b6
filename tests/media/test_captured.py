"""Standard error of the C libraries, caught."""

import os
import threading

import pytest

from vdet.media.captured import capture_stderr


def say(text: str) -> None:
    os.write(2, text.encode())


def test_what_is_said_in_the_block_is_kept_and_not_shown(capfd: pytest.CaptureFixture[str]) -> None:
    say("before\n")
    with capture_stderr() as lines:
        say("one\ntwo\n")
    say("after\n")
    assert lines == ["one", "two"]
    assert capfd.readouterr().err == "before\nafter\n"


def test_of_endless_talk_the_beginning_is_kept() -> None:
    with capture_stderr() as lines:
        for _ in range(1000):
            say("x" * 99 + "\n")
    assert 10 < len(lines) <= 100


def test_standard_error_is_there_again_after_an_error(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(KeyError), capture_stderr():
        raise KeyError
    say("after\n")
    assert capfd.readouterr().err == "after\n"


def test_threads_take_turns(capfd: pytest.CaptureFixture[str]) -> None:
    caught: list[list[str]] = []

    def listen(number: int) -> None:
        for _ in range(20):
            with capture_stderr() as lines:
                say(f"{number}\n" * 3)
            caught.append(lines)

    threads = [threading.Thread(target=listen, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(len(lines) == 3 and len(set(lines)) == 1 for lines in caught)
    assert len(caught) == 80
    say("still there\n")
    assert capfd.readouterr().err == "still there\n"
