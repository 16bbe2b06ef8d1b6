import pytest

from vdet.cli.evaluate import grid
from vdet.errors import ConfigError


def test_every_combination_of_the_values_in_their_order() -> None:
    assert grid(()) == [()]
    assert grid(("a=4,1, 2,4",)) == [("a=4",), ("a=1",), ("a=2",)]
    assert grid(("a=1,2", "b=[{c: 6, d: 1}],[{c: 9, d: 2}]")) == [
        *(("a=1", "b=[{c: 6, d: 1}]"), ("a=1", "b=[{c: 9, d: 2}]")),
        *(("a=2", "b=[{c: 6, d: 1}]"), ("a=2", "b=[{c: 9, d: 2}]")),
    ]


@pytest.mark.parametrize("text", ["heat.threshold", "=1,2", "a=", "a=1,,2", "a=1,"])
def test_other_text_than_a_sweep_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="expected KEY=VALUE,VALUE"):
        grid((text,))


def test_a_key_swept_twice_is_refused() -> None:
    with pytest.raises(ConfigError, match="--sweep a: is given twice"):
        grid(("a=1,2", "b=1", "a=3"))
