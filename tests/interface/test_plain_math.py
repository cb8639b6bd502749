"""Equations as text; truth: the equations themselves, written by hand."""

import pytest

from klack.network.catalogue import component_classes
from klack.network.described import described_type
from klack.terminal.tables import plain_math


@pytest.mark.parametrize(
    ("latex", "text"),
    [
        (r"m \ddot y = \sum_p F_p", "m y'' = Σ_p F_p"),
        (r"\frac{dm}{dt} = \sum \dot m, \qquad V \varrho(p) = m", "dm/dt = Σ m',  V ρ(p) = m"),
        (r"C_\infty \tanh\frac{2\lambda}{\lambda_c}", "C_∞ tanh(2λ/λ_c)"),
        (r"\frac{\pi d c^3}{12 \mu l}\,(1 + \tfrac32 e)", "(π d c^3)/(12 µ l) (1 + 3/2 e)"),
        (r"e^{-(v/v_s)^2}", "e^(-(v/v_s)^2)"),
        (r"\sqrt{\frac{2 |p|}{\varrho}}", "sqrt((2 |p|)/ρ)"),
        (r"y_\text{end} - y_\text{base}", "y_end - y_base"),
        (r"\frac{\partial p}{\partial t}", "∂p/∂t"),
    ],
)
def test_equations_read_as_they_are_spoken(latex, text):
    assert plain_math(latex) == text


def test_no_equation_of_a_component_keeps_a_mark_of_latex():
    found = [described_type(kind) for kind in component_classes()]

    assert sum(bool(item.equation) for item in found) >= 17
    for item in found:
        assert not set(plain_math(item.equation)) & set("\\{}$"), item.word
        assert item.summary.endswith("."), item.word
        assert "`" not in item.summary + item.source, item.word
