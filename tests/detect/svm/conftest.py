"""The tests search as the pipeline does: libraries use a single thread."""

from collections.abc import Iterator

import pytest

from vdet.run.threads import single_threaded_libraries


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    with single_threaded_libraries():
        yield
