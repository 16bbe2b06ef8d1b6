from vdet.evaluate.table import share, table


def test_the_first_column_is_to_the_left_and_the_others_to_the_right() -> None:
    assert table(("name", "n"), [["a", "100"], ["longer", "1"]]) == [
        "name      n",
        "a       100",
        "longer    1",
    ]


def test_a_table_without_rows_is_its_headings() -> None:
    assert table(("name", "n"), []) == ["name  n"]


def test_a_share_that_is_not_there_is_a_dash() -> None:
    assert (share(0.12345), share(None), share(0.5, 1)) == ("0.123", "–", "0.5")
