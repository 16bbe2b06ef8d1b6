"""The tests search as the program does: libraries use a single thread."""

import pytest

from vdet.workers import limit_library_threads


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> None:
    limit_library_threads()
