"""Truth: limits of notched spool edges, and what is refused; areas are checks of `klack verify`."""

from math import pi, sqrt

import numpy as np
import pytest

from klack.errors import InputError
from klack.hydraulics.notch import Notch, notch_opening
from klack.hydraulics.spool_edge import SpoolEdge
from klack.verification.benches import RHO_OIL as RHO
from klack.verification.benches import branch_of, branch_step

EDGE = {"diameter": 6e-3, "radial_clearance": 4e-6, "overlap": 1e-3, "cavitation": None}
SIZES = {
    "rectangular": {"width": 1e-3, "length": 0.8e-3, "depth": 0.3e-3},
    "triangular": {"width": 1e-3, "length": 0.8e-3, "depth": 0.3e-3},
    "round": {"width": 1e-3, "length": 0.8e-3, "depth": 0.3e-3},
    "hole": {"width": 0.6e-3, "length": 0.8e-3},
}


def notch(shape, **changed):
    return {"shape": shape, "count": 4, **SIZES[shape], **changed}


def edge(*notches, **changed):
    return SpoolEdge(**{**EDGE, "direction": "opening", "notches": notches, **changed})


def steps(part, displacements, p_a=50e5, p_b=20e5):
    row = branch_of(part)
    return np.array([branch_step(row, p_a, p_b, ports=(y, y, 0.0, 0.0)) for y in displacements])


@pytest.mark.parametrize("shape", SIZES)
def test_flow_rises_without_a_jump_from_covered_to_open(shape):
    y = np.linspace(-0.2e-3, 1.4e-3, 4001)
    flow = steps(edge(notch(shape)), y)[:, 0]

    assert np.all(np.diff(flow) > 0.0)
    # 0.4 um more opens 0.4 um of the whole edge at most
    fully = 0.7 * pi * 6e-3 * 0.4e-6 * sqrt(2 * RHO * 30e5)
    assert np.max(np.diff(flow)) < 1.01 * fully


@pytest.mark.parametrize("shape", SIZES)
def test_slopes_are_those_of_the_flow(shape):
    part, h = edge(notch(shape), cavitation=0.62), 10.0
    for y in (0.1e-3, 0.4e-3, 1.1e-3):
        for p_a, p_b in ((50e5, 20e5), (20e5, 50e5)):
            out = steps(part, [y], p_a, p_b)[0]
            by_a = (steps(part, [y], p_a + h, p_b)[0][0] - steps(part, [y], p_a - h, p_b)[0][0]) / (
                2 * h
            )
            by_b = (steps(part, [y], p_a, p_b + h)[0][0] - steps(part, [y], p_a, p_b - h)[0][0]) / (
                2 * h
            )
            assert out[1] == pytest.approx(by_a, rel=1e-5, abs=0.0)  # round-off over 10 Pa
            assert out[2] == pytest.approx(by_b, rel=1e-5, abs=0.0)


@pytest.mark.parametrize("length", [0.2e-3, 0.5e-3])
def test_a_round_notch_cut_by_the_edge_is_a_segment_of_its_circle(length):
    numbers = np.array(Notch(**notch("round", length=length, depth=2e-3)).numbers)
    area, r = notch_opening(numbers, 0, 0.0, 4e-6, 4e-6)[1], 0.5e-3
    half = np.arccos((r - length) / r)

    assert area == pytest.approx(r * r * (half - np.sin(half) * np.cos(half)), rel=1e-13, abs=0.0)
    assert numbers[5] == pytest.approx(2 * r * np.sin(half), rel=1e-13, abs=0.0)


def test_holes_alone_open_no_edge():
    out = steps(edge(notch("hole"), width=0.0), [5e-3])[0]

    assert out[6] == pytest.approx(4 * pi / 4 * 0.36e-6, rel=1e-12, abs=0.0)


def test_a_port_limits_notches_and_edge_together():
    part = edge(notch("rectangular"), notch("hole"), largest_area=1e-6)

    assert steps(part, [3e-3])[0][6] == pytest.approx(1e-6, rel=1e-15, abs=0.0)


def test_the_length_of_the_column_counts_the_flow_of_the_notches():
    part = edge(
        notch("rectangular"), flow_force={"velocity_coefficient": 0.0, "damping_length": 1e-2}
    )
    row = branch_of(part)
    ports = (0.8e-3, 0.8e-3, 0.0, 0.0)
    known = branch_step(row, 50e5, 20e5, ports=ports)[8] - 1e-4
    state = [0.0, 0.0, 0.0, known, 1.0]
    out = branch_step(row, 50e5, 20e5, h=1e-6, state=state, ports=ports)

    assert out[3] == pytest.approx(-1e-2 * 1e-4 / 1e-6, rel=1e-9)
    assert out[4] == -out[3]


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (lambda: edge(notch("rectangular", depth=3e-6)), "between the clearance of 0.004 mm"),
        (lambda: edge(notch("rectangular", depth=4e-3)), "the radius of the spool, 3 mm"),
        (lambda: edge(notch("triangular", count=40)), "notches of 40 mm in all"),
        (lambda: edge(notch("hole", count=40)), "notches of 24 mm in all"),
        (lambda: edge(notch("round"), width=3e-3), "at most the 3 mm of the edge"),
        (lambda: edge(notch("hole", length=0.5e-3)), "at least its diameter"),
        (lambda: edge(notch("hole", depth=1e-3)), "it goes through"),
        (lambda: edge({"shape": "round", "count": 1, "width": 1e-3, "length": 1e-3}), "depth"),
        (lambda: edge(width=0.0), "0 mm without notches"),
        (lambda: edge(notch("rectangular", count=0)), "count"),
    ],
)
def test_wrong_notches_are_refused_in_words(build, text):
    with pytest.raises(InputError, match=r"(?s)Try: ") as caught:
        build()

    assert text in str(caught.value)
