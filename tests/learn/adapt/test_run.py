"""Which of the models that `vdet adapt` tries is taken."""

import pytest

from vdet.learn.adapt.report import CheckReport
from vdet.learn.adapt.run import choose


@pytest.mark.parametrize(
    ("base", "f1", "taken"),
    [
        (0.5, {"a": 0.80, "b": 0.90}, "b"),
        (0.5, {"a": 0.895, "b": 0.90}, "a"),  # the difference may be chance
        (0.897, {"a": 0.895, "b": 0.90}, "b"),  # a is no better than the base
        (0.95, {"a": 0.80, "b": 0.90}, "b"),  # none is
    ],
)
def test_the_first_model_that_is_about_the_best_is_taken(
    base: float, f1: dict[str, float], taken: str
) -> None:
    checks = [
        CheckReport(name, "teacher", value, 1, 1, 1, 0)
        for name, value in {"base": base, **f1}.items()
    ]
    assert choose(checks, tuple(f1), tolerance=0.01) == taken
