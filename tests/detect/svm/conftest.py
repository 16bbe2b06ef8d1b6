"""The tests search as the pipeline does: one thread, and the libraries start no others."""

from collections.abc import Iterator

import pytest

from vdet.pipeline.threads import single_threaded_libraries


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    with single_threaded_libraries():
        yield
