import pytest

from vdet.cli.evaluate import grid
from vdet.errors import ConfigError


def test_the_values_of_a_key_in_their_order() -> None:
    assert grid(("detector.heat.threshold=4,1, 2",)) == [
        ("detector.heat.threshold=4",),
        ("detector.heat.threshold=1",),
        ("detector.heat.threshold=2",),
    ]


def test_several_keys_make_a_grid() -> None:
    assert grid(("a=1,2", "b=x,y")) == [
        *(("a=1", "b=x"), ("a=1", "b=y")),
        *(("a=2", "b=x"), ("a=2", "b=y")),
    ]


def test_a_comma_in_brackets_belongs_to_the_value() -> None:
    values = "detector.search.windows=[{size: 64, top: 1}],[{size: 96, top: 2}]"
    assert grid((values,)) == [
        ("detector.search.windows=[{size: 64, top: 1}]",),
        ("detector.search.windows=[{size: 96, top: 2}]",),
    ]


@pytest.mark.parametrize("text", ["heat.threshold", "=1,2", "a=", "a=1,,2", "a=1,"])
def test_other_text_than_a_sweep_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="expected KEY=VALUE,VALUE"):
        grid((text,))


def test_a_key_swept_twice_is_refused() -> None:
    with pytest.raises(ConfigError, match="--sweep a: is given twice"):
        grid(("a=1,2", "b=1", "a=3"))
