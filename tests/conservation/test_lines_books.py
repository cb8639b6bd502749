"""Truth: work in = change of store + losses, inflow = compression - cavities, losses >= 0."""

import numpy as np
import pytest
from draws import each

from klack.simulation.delay_line import (
    LineState,
    compile_lines,
    line_store,
    lines_commit,
    lines_incoming,
    start_lines,
)
from klack.verification.single_line import End, plain_line, run_line

STEP = 20e-9  # [s]
UNSTEADY = (1e9 * np.arange(1.0, 6.0) ** 2, 10.0 ** np.arange(4.0, 9.0))


def rough_line(steps, segments, vapour):
    return plain_line(
        delay=steps * STEP,
        segments=segments,
        resistance=2e10,
        unsteady=UNSTEADY,
        vapour_pressure=vapour,
    )


@pytest.mark.slow
@each("coarse", [1, 2, 16])
@each("segments", [1, 2, 5])
@each("steps", [80.0, 97.0, 130.37])
@each("vapour", [-1e9, -1e5])
def test_energy_and_volume_balance(coarse, segments, steps, vapour):
    rng = np.random.default_rng(11)
    lengths = np.where(rng.random(3000) < 0.5, 1, coarse)
    lengths[0] = coarse
    ends = 5e5 * rng.standard_normal((2, len(lengths)))

    run = run_line(
        rough_line(steps, segments, vapour),
        End(pressure=ends[0]),
        End(flow=ends[1] / 1.6e11),
        step=STEP,
        lengths=lengths,
        pressure=[2e5, -3e5],
        flow=1e-6,
    )

    assert abs(run.energy_residual) < 1e-13
    assert abs(run.volume_residual) < 1e-13
    assert np.all(run.losses >= 0.0)
    assert (run.cavity.max() > 0.0) == (vapour > -1e9 and segments > 1)
    assert run.losses[2] > 0.0 or run.cavity.max() == 0.0


def march(lines, state, ends, lengths, books):
    """Return what the line answers to prescribed pressures."""
    c, Z, flows = np.zeros(2), np.zeros(2), []
    for m, P in zip(lengths, ends.T, strict=True):
        lines_incoming(lines, state, m, c, Z)
        q = (P - c) / Z
        lines_commit(lines, state, m, q, books)
        flows.append(q)
    return np.array(flows)


def test_run_continues_to_the_same_bits():
    rng = np.random.default_rng(5)
    lengths = np.where(rng.random(800) < 0.5, 1, 4)
    ends = 5e5 * rng.standard_normal((2, 800))
    lines, state = compile_lines(
        [rough_line(33.3, 3, -1e5)], step=STEP, coarse=4, ambient_pressure=0.0
    )
    start_lines(lines, state, 0.0)
    whole = march(lines, state, ends, lengths, np.zeros((1, 3)))

    lines, state = compile_lines(
        [rough_line(33.3, 3, -1e5)], step=STEP, coarse=4, ambient_pressure=0.0
    )
    march(lines, state, ends[:, :500], lengths[:500], np.zeros((1, 3)))
    saved = LineState(*(np.copy(array) for array in state))
    saved.incoming[:], saved.scatter[:] = np.nan, np.nan  # scratch need not be kept
    rest = march(lines, saved, ends[:, 500:], lengths[500:], np.zeros((1, 3)))

    assert np.array_equal(rest, whole[500:])


def test_step_that_is_given_up_leaves_no_trace():
    ends = 5e5 * np.random.default_rng(6).standard_normal((2, 300))
    answers, books = [], np.zeros((2, 1, 3))
    for k, repeats in enumerate((0, 1)):
        lines, state = compile_lines(
            [rough_line(33.3, 3, -1e5)], step=STEP, coarse=4, ambient_pressure=0.0
        )
        c, Z, flows = np.zeros(2), np.zeros(2), []
        for P in ends.T:
            for _ in range(repeats):
                lines_incoming(lines, state, 4, c, Z)
            lines_incoming(lines, state, 1, c, Z)
            q = (P - c) / Z
            lines_commit(lines, state, 1, q, books[k])
            flows.append(q)
        answers.append(np.array(flows))

    assert np.array_equal(*answers)
    assert np.array_equal(*books)


def test_closed_line_only_loses_energy():
    lines, state = compile_lines(
        [rough_line(130.37, 4, -1e9)], step=STEP, coarse=1, ambient_pressure=0.0
    )
    start_lines(lines, state, [5e5, -5e5])
    c, Z, q, books = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros((1, 3))

    stores = [line_store(lines, state, 0)]
    for _ in range(3000):
        lines_incoming(lines, state, 1, c, Z)
        lines_commit(lines, state, 1, q, books)
        stores.append(line_store(lines, state, 0))

    assert np.all(np.diff(stores) <= 1e-14 * stores[0])
    assert stores[-1] < 0.2 * stores[0]
    assert stores[0] - stores[-1] == pytest.approx(books.sum(), rel=1e-12)
