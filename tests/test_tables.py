"""Tables for people: whole numbers, in the room there is."""

from __future__ import annotations

import pytest

from contbreather.tables import Column, Sheet

THIRD, NAMES = Column("third", [1 / 3, 200 / 3]), Column("label", ["LP1", "a longer word"])
SPARE = Column("spare", [2.0, None], spare=True)


def cells(sheet: Sheet, width: int | None = None) -> dict[str, list[str]]:
    return {column.header: list(column.cells) for column in sheet.table(width).columns}


def test_where_there_is_room_numbers_have_twelve_digits() -> None:
    found = cells(Sheet([NAMES, THIRD, SPARE]))
    assert found["third"] == ["0.333333333333", "66.6666666667"]
    assert found["spare"] == ["2", "–"]
    assert found["label"] == ["LP1", "a longer word"]


def test_what_is_spare_goes_first_then_digits_down_to_four() -> None:
    sheet = Sheet([NAMES, THIRD, SPARE])
    whole = 1 + (13 + 3) + (14 + 3) + (5 + 3)
    assert list(cells(sheet, whole)) == ["label", "third", "spare"]
    assert list(cells(sheet, whole - 1)) == ["label", "third"]
    assert cells(sheet, whole - 1)["third"][0] == "0.333333333333"
    assert cells(sheet, whole - 8 - 3)["third"] == ["0.333333333", "66.6666667"]
    assert cells(sheet, 5)["third"] == ["0.3333", "66.67"]


def test_where_four_digits_are_too_many_columns_go_from_the_right_and_the_caption_says_so() -> None:
    names, numbers = Column("label", ["LP1"]), [Column(name, [-1 / 3]) for name in "abc"]
    table = Sheet([names, *numbers]).table(8 + 2 * 10 + 1)
    assert [column.header for column in table.columns] == ["label", "a", "b"]
    assert table.caption == "No room for c."


def test_a_column_may_ask_for_fewer_digits() -> None:
    few = Column("few", [1 / 3], digits=5)
    assert cells(Sheet([few]))["few"] == ["0.33333"]
    assert cells(Sheet([few]), 3)["few"] == ["0.3333"]


def test_numbers_lean_to_the_right_and_words_to_the_left() -> None:
    assert (THIRD.leaning, NAMES.leaning, SPARE.leaning) == ("right", "left", "right")
    assert Column("x", [1.0], right=False).leaning == "left"
    justified = {c.header: c.justify for c in Sheet([NAMES, THIRD]).table().columns}
    assert justified == {"label": "left", "third": "right"}


@pytest.mark.parametrize("width", [None, 30])
def test_title_and_caption_are_those_given(width: int | None) -> None:
    made = Sheet([THIRD], "above", "below").table(width)
    assert (made.title, made.caption) == ("above", "below")
    assert Sheet([THIRD]).table().title is None


def test_complex_numbers_keep_both_parts() -> None:
    assert cells(Sheet([Column("mu", [0.5 - 0.25j])]))["mu"] == ["0.5-0.25j"]
