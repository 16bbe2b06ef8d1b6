"""The warnings of a run, as a fixture."""

from collections.abc import Callable

import pytest


@pytest.fixture
def warnings(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    """Returns the warnings logged so far."""
    return lambda: [record.getMessage() for record in caplog.records if record.name == "vdet"]
