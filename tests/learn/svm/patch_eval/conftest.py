import pytest


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw few resamples, which takes less time; tests of the intervals ask for more."""
    monkeypatch.setattr("vdet.learn.svm.patch_eval.metrics.RESAMPLES", 40)
