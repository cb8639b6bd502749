"""Macro steps: first impacts over phases of the grid against fine steps alone, and their sizes."""

from collections.abc import Mapping

import numpy as np
import pytest

from klack.errors import InputError
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.simulation.step_sizes import step_sizes
from klack.verification.network import peak_and_hold, whole_valve

MACRO = 1.28e-6


def stroke(kind: str, shift: float, **steps) -> NetworkResult:
    """Open, rebound from the stop, and fall onto the seat; the driver starts a little later."""
    start = 2e-6 + shift
    valve = whole_valve(driver=peak_and_hold(start=start, end=start + 0.45e-3))
    valve = valve if kind == "wet" else valve.dry()
    return simulate_network(valve.rows(), duration=0.9e-3, record=1.28e-6, **steps)


def first_impacts(result: NetworkResult, shift: float) -> Mapping[str, tuple[float, float]]:
    """Peak [N] and time since the start of the driver [s] at each stop, once it has opened."""
    found: dict[str, tuple[float, float]] = {}
    for event in result.events:
        if event.time > 50e-6:
            found.setdefault(event.stop, (event.peak_force, event.time - shift))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["wet", "dry"])
def test_first_impacts_do_not_depend_on_the_phase_of_the_grid(kind):
    """Truth: convergence, fine steps of 2.5 ns alone.  One run at one phase would be luck."""
    exact = first_impacts(stroke(kind, 0.0, step=2.5e-9, coarse=1), 0.0)
    shifts = (MACRO + 20e-9) * np.arange(8) / 8
    runs = [stroke(kind, shift) for shift in shifts]
    found = [first_impacts(run, shift) for run, shift in zip(runs, shifts, strict=True)]

    for stop, (peak, time) in exact.items():
        peaks = np.array([impacts[stop][0] for impacts in found]) / peak - 1.0
        times = np.array([impacts[stop][1] for impacts in found]) - time
        # the same scheme with backward Euler, the lift at the end of a step, or uncut steps: 0.2 us
        assert np.abs(peaks).max() < 5e-4, stop
        # wet: a film ceases to pull in steps of 20 ns; seven of the eight are below 0.02 us
        assert np.abs(times).max() < (0.08e-6 if kind == "wet" else 0.05e-6), stop
    for run in runs:
        assert run.steps.fine == 0
        assert run.steps.flight > 300
        assert run.steps.near > 100
        assert run.steps.repeats < 0.2 * run.coarse_steps
        assert run.books.relative_residual < 1e-11


@pytest.mark.slow
def test_fine_accuracy_is_finer():
    exact = first_impacts(stroke("wet", 0.0, step=2.5e-9, coarse=1), 0.0)
    normal, fine = (
        first_impacts(stroke("wet", 0.0, accuracy=accuracy), 0.0) for accuracy in ("normal", "fine")
    )

    peak, time = exact["opening"]
    assert abs(fine["opening"][0] / peak - 1.0) < 0.3 * abs(normal["opening"][0] / peak - 1.0)
    assert abs(fine["seat"][1] - exact["seat"][1]) < 0.02e-6
    assert abs(fine["opening"][1] - time) < 2.6e-9  # a part of a step


def with_line(delay: float, segments: int) -> Rows:
    rows = valve().rows()
    rows.lines.clear()
    rows.line(a=0, b=1, delay=delay, impedance=1e9, segments=segments)
    return rows


def valve() -> Network:
    return whole_valve(modes=(2, 2, 2)).dry()


def test_macro_steps_are_as_long_as_lines_and_exchanges_allow():
    def sizes(rows: Rows, **more) -> tuple[int, int]:
        found = step_sizes(rows, "normal", **more)
        return found.coarse, found.near

    assert sizes(valve().rows()) == (64, 16)
    assert sizes(valve().rows(), step=50e-9) == (16, 4)
    assert sizes(valve().rows(), step=5e-6) == (1, 1)
    assert sizes(valve().rows(), coarse=10) == (10, 2)
    assert sizes(with_line(1e-6, 3)) == (16, 4)  # 333 ns
    assert sizes(with_line(30e-9, 1)) == (1, 1)
    rows = valve().rows()
    rows.element(rows.elements[0].step, ports=(0,), parameters=(0.0,), interval=0.5e-6)
    assert sizes(rows) == (25, 5)  # one exchange in each macro step


@pytest.mark.parametrize(
    ("more", "expected"),
    [({"accuracy": "better"}, "normal, fine"), ({"coarse": 0}, "1 or more")],
)
def test_what_is_no_size_is_refused(more, expected):
    with pytest.raises(InputError, match=expected):
        simulate_network(valve().rows(), duration=1e-5, **more)
