"""The comparison of pages with what is printed notices what is wrong."""

import pytest
from quoted_output import compare


def test_the_comparison_sees_a_wrong_number_a_wrong_word_and_a_missing_line() -> None:
    printed = "  level     force [N]   wall time [s]\n ─────\n  reduced   123.4    0.1\nall done\n"
    compare("level   force [N]   wall time [s]\nreduced   123.9   9.9\nall done\n", printed, "")
    for wrong in ("reduced  125.6  0.1", "full  123.4  0.1", "all done\nreduced  123.4  0.1"):
        with pytest.raises(AssertionError, match="not printed"):
            compare(wrong, printed, "")
