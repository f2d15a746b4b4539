import pytest

from hmpim.report.paper.rows import Row, agreement, cells, markdown_table, shown, table_dict


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (39478.4, "39480"), (999.96, "1000"), (-36.014, "−36.01"), (0.81149, "0.8115")],
)
def test_numbers_have_four_digits_and_no_exponent(value, text):
    assert shown(value) == text


def test_a_row_without_a_value_says_what_it_says():
    row = Row(figure=17, where="Fig. 17", quantity="f", text="none", truth=10.0, unit="Hz")
    assert cells(row)[3:5] == ("none", "10 Hz")


def test_error_bar_and_bound_are_shown_with_two_digits():
    row = Row(
        figure=17,
        where="Fig. 17",
        quantity="f",
        value=9.98765,
        std=0.02907,
        bound=0.02984,
        unit="Hz",
    )
    assert row.ours == "9.988 ± 0.029 Hz (bound ± 0.030)"


def test_a_bar_in_a_cell_does_not_split_the_table():
    row = Row(figure=3, where="Eq. (24)", quantity="|G|")
    assert r"| \|G\| |" in markdown_table([row])


def test_agreement_is_a_matter_of_numbers():
    assert agreement(6.02, 6.0, within=0.1, because="twice as many") == "Agrees: twice as many."
    assert agreement(6.2, 6.0, within=0.1) == "Does not agree."
    assert agreement(None, 6.0, within=0.1, otherwise="None found.") == "None found."


def test_json_keeps_the_number_and_the_text():
    row = Row(figure=12, where="Fig. 12", quantity="n", paper="0", value=0.0, why="Agrees.")
    data = table_dict([row])
    assert data["schema"] == "hmpim/paper/1"
    assert data["rows"][0] | {"value": 0.0, "ours": "0", "std": None} == data["rows"][0]
