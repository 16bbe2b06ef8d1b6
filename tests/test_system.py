"""Signals."""

import signal
import subprocess
import sys

import pytest

from vdet.system import blocked_interrupts


def test_ctrl_c_comes_after_the_block_and_never_in_processes_that_start_in_it() -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    shows_blocked = "import signal; print(signal.pthread_sigmask(signal.SIG_BLOCK, []))"
    blocked = ""

    def start() -> None:
        nonlocal blocked
        with blocked_interrupts():
            signal.raise_signal(signal.SIGINT)
            blocked = subprocess.check_output([sys.executable, "-c", shows_blocked], text=True)

    try:
        with pytest.raises(KeyboardInterrupt):
            start()
    finally:
        signal.signal(signal.SIGINT, before)
    assert "SIGINT" in blocked
