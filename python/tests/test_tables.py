"""Tables as users hold them: rows that belong together are taken, others refused."""

from __future__ import annotations

import pytest
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
