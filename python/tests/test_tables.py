"""Tables as users hold them: rows that belong together are taken, others refused."""

from __future__ import annotations

import numpy as np
import pytest
from genu._arrays import arrays_of
from genu._errors import InputError
from genu._tables import table_text

TEXT = "trial,ap_mm\na,1.5\nb,-2.5\n"


def test_series_with_other_indexes_are_refused_and_with_the_same_taken():
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"trial": ["a", "b"], "ap_mm": [1.5, -2.5]})
    assert table_text({"trial": frame.trial, "ap_mm": frame.ap_mm}) == TEXT
    assert table_text({"trial": ["a", "b"], "ap_mm": frame.ap_mm}) == TEXT
    # sorted alone: by position its rows are another's
    with pytest.raises(InputError, match="trial and ap_mm have different indexes"):
        table_text({"trial": frame.trial, "ap_mm": frame.ap_mm.sort_values()})


def test_a_lazy_frame_is_collected():
    class Lazy:
        def collect(self):
            return Collected()

    class Collected:
        def write_csv(self):
            return TEXT

    assert table_text(Lazy()) == TEXT


def test_a_structured_array_is_a_table_and_one_without_names_is_told_what_to_give():
    rows = np.array([("a", 1.5), ("b", -2.5)], dtype=[("trial", "U1"), ("ap_mm", ">f8")])
    assert table_text(rows) == TEXT
    with pytest.raises(InputError, match="a dict of columns"):
        table_text(np.zeros((2, 3)))


def test_masked_numbers_of_a_surface_are_refused():
    vertices, faces = np.eye(3), [[0, 1, 2]]
    arrays_of("femur", (np.ma.masked_array(vertices), faces))
    with pytest.raises(InputError, match="femur: 2 masked numbers"):
        arrays_of("femur", (masked(vertices, 2), faces))


def masked(numbers, count):
    """The numbers with so many of them masked."""
    mask = np.zeros(numbers.shape, dtype=bool)
    mask.flat[:count] = True
    return np.ma.masked_array(numbers, mask=mask)


def test_a_masked_cell_is_an_empty_one():
    table = {"trial": ["a", "b"], "ap_mm": np.ma.masked_array([1.5, 2.0], mask=[0, 1])}
    assert table_text(table) == "trial,ap_mm\na,1.5\nb,\n"
