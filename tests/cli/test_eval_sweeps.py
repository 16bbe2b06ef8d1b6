import pytest

from vdet.cli.evaluate import grid
from vdet.errors import ConfigError


def test_every_combination_of_the_values_in_their_order() -> None:
    assert grid(()) == [()]
    assert grid(("a=4,1, 2",)) == [("a=4",), ("a=1",), ("a=2",)]
    assert grid(("a=1,2", "b=3,4")) == [
        *(("a=1", "b=3"), ("a=1", "b=4")),
        *(("a=2", "b=3"), ("a=2", "b=4")),
    ]


@pytest.mark.parametrize("text", ["heat.threshold", "=1,2", "a=", "a=1,,2", "a=1,"])
def test_other_text_than_a_sweep_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="expected KEY=VALUE,VALUE"):
        grid((text,))
