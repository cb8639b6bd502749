"""What CalculiX printed, read and compared.

Truth: ``calculix_bars.dat`` and ``.sta`` are what CalculiX 2.20 (Debian 12) wrote for the two small
bars of ``tests/reference/test_calculix_impact.py``, unchanged; single numbers below were looked up
in them by eye.  Momentum and energy must balance in them.  Damaged copies must be refused.
"""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.comparison.calculix import (
    CALCULIX,
    COMPARISON_COLUMNS,
    compare_with,
    comparison_rows,
    energy_balance,
    with_other,
)
from klack.analyses.impact.record import ImpactStudy
from klack.contact.history import BodyEnergy, EnergyLedger, ImpactHistory
from klack.errors import InputError
from klack.exchange.calculix_result import CalculixResult, other_run, read_calculix

BARS = Path(__file__).parents[1] / "data" / "calculix_bars.dat"
MASS, SPEED = 1.5667291666666663e-05, 0.5


def reference(mass: float = MASS) -> ImpactHistory:
    """Half a sine with the impulse of a full rebound of the bar; only masses and speed matter."""
    step, n = 100e-9, 40
    t = (np.arange(n) + 0.5) * step - 0.2e-6
    force = np.where((t > 0) & (t < 2.4e-6), np.sin(np.pi * t / 2.4e-6), 0.0)
    force *= 2 * mass * SPEED / (force.sum() * step)
    velocity = -SPEED + np.concatenate([[0.0], np.cumsum(force) * step / mass])
    energy = 0.5 * mass * SPEED**2
    bodies = tuple(
        BodyEnergy(name=name, translation=value, vibration=0.0, strain=0.0)
        for name, value in (("needle", energy), ("block", 0.0))
    )
    return ImpactHistory(
        step=step,
        force=force,
        gap=np.zeros(n),
        velocity_a=velocity,
        velocity_b=np.zeros(n + 1),
        speed=SPEED,
        mass_a=mass,
        mass_b=np.inf,
        ledger=EnergyLedger(initial=energy, bodies=bodies),
    )


@pytest.fixture(scope="module")
def bars() -> CalculixResult:
    return read_calculix(BARS)


def test_numbers_are_those_of_the_file(bars):
    assert bars.time.shape == (36,)
    np.testing.assert_allclose(bars.time, 1e-7 * np.arange(1, 37), rtol=1e-7)
    assert bars.force[2] == 0.8318758
    assert bars.force.max() == 10.21255
    assert bars.kinetic["UPPER"][0] == pytest.approx(1.958411e-6, rel=1e-12)  # mJ in the file
    assert set(bars.internal) == {"UPPER", "LOWER"}
    assert bars.iterations == 81
    assert bars.wall_time is None  # no .log beside it
    assert np.all(bars.sideways <= 1e-3 * bars.force.max())


def test_momentum_of_the_printed_forces_is_that_of_the_bar(bars):
    """The kinetic energy after the impact is that of the rebound and of a little vibration."""
    rebound = bars.impulse[-1] / MASS - SPEED
    rigid = 0.5 * MASS * rebound**2

    assert rigid < bars.kinetic["UPPER"][-1] < 1.002 * rigid
    assert rebound == pytest.approx(0.4972, rel=1e-3)


def test_history_keeps_the_impulse_and_books_the_energy(bars):
    run = other_run(bars, reference())
    history, ledger = run.history, run.history.ledger

    assert history.impulse == pytest.approx(bars.impulse[-1], rel=1e-12)
    assert history.velocity_a[0] == pytest.approx(-SPEED, rel=1e-6)
    assert history.velocity_a[-1] == pytest.approx(bars.impulse[-1] / MASS - SPEED, rel=1e-6)
    assert ledger.initial == pytest.approx(0.5 * MASS * SPEED**2, rel=1e-6)
    total = bars.total_energy
    assert energy_balance(ledger) == pytest.approx(total[-1] / total[0] - 1, rel=1e-9)
    assert run.energy_swing == pytest.approx(np.abs(total / total[0] - 1).max(), rel=1e-9)
    assert run.energy_swing < 0.01
    assert [body.name for body in ledger.bodies] == ["needle", "block"]


def test_an_outside_force_is_part_of_the_balance(bars):
    """With a force of 2 N the same record means 2 N t less momentum, and its work is booked."""
    pushed = replace(reference(), external_force=np.full(40, -2.0))

    plain, run = other_run(bars, reference()).history, other_run(bars, pushed)
    history = run.history

    lost = plain.velocity_a - history.velocity_a
    assert lost[-1] - lost[0] == pytest.approx(2.0 * 3.6e-6 / MASS, rel=1e-9)
    way = np.sum(history.velocity_a[1:-1]) * 1e-7 + 0.5e-7 * (history.velocity_a[-1])
    # counted from the first record on, 0.1 us after the start
    way -= 0.5e-7 * history.velocity_a[1]
    assert history.ledger.work == pytest.approx(-2.0 * way, rel=1e-6)
    # this record knows nothing of the force: its work is missing in the energies
    missing = history.ledger.work / history.ledger.initial
    assert abs(missing) > 0.1
    assert run.energy_swing >= abs(missing) - 0.01


def test_unequal_records_keep_their_impulse(bars):
    kept = np.delete(np.arange(36), [5, 11, 12, 20])
    thinned = replace(
        bars,
        time=bars.time[kept],
        force=bars.force[kept],
        contact_energy=np.zeros(0),
        internal={},
        kinetic={},
    )

    run = other_run(thinned, reference())

    assert run.history.step == pytest.approx(1e-7, rel=1e-6)
    assert run.history.impulse == pytest.approx(thinned.impulse[-1], rel=1e-9)
    assert (run.energy_swing, energy_balance(run.history.ledger)) == (None, None)


def test_status_and_log_tell_effort(tmp_path):
    data = tmp_path / "run.dat"
    shutil.copy(BARS, data)
    (tmp_path / "run.log").write_text(" Job finished\n\nTotal CalculiX Time: 3.597988\n____\n")

    result = read_calculix(data)

    assert (result.wall_time, result.iterations) == (3.597988, None)


def test_the_sign_does_not_depend_on_the_slave(tmp_path):
    other = tmp_path / "run.dat"
    text = BARS.read_text()
    axial = re.compile(r"(moment about the origin \(mx,my,mz\)\n\n(?:\s+\S+){2}\s+)(\d)")
    flipped = axial.sub(r"\1-\2", text)
    assert flipped.count("-1.021255E+01") == text.count("-1.021255E+01") + 1
    other.write_text(flipped)

    assert read_calculix(other).force.max() == 10.21255


DAMAGE = {
    "cut off": (lambda text: text[: len(text) // 2 + 300], "entries|truncated|number"),
    "cut in a table": (lambda text: text[: text.rindex("statistics") + 130], "truncated table"),
    "no force": (
        lambda text: text.replace("statistics for slave", "something"),
        "no contact force",
    ),
    "two pairs": (
        lambda text: text.replace("set UPPER_CONTACT,", "set THIRD,", 1),
        "forces of 2 pairs",
    ),
    "diverged": (lambda text: text.replace("1.021255E+01", "NaN"), "shorter step"),
    "words": (lambda text: text.replace("1.021255E+01", "ten"), "'ten'"),
    "two runs": (lambda text: text + text, "do not increase"),
    "less energies": (
        lambda text: text.replace("total kinetic energy for set UPPER", "skipped", 1),
        "35 entries of the kinetic energy of UPPER, 36",
    ),
    "empty": (lambda text: "", "no contact force"),
    "other text": (lambda text: "hello\n" * 50, "no contact force"),
    "a very long line": (lambda text: " total" + "x" * 5000, "a line of 500"),
    "a long field": (
        lambda text: text.replace("time  0.2000000E-06", "time  " + "9" * 200, 1),
        "at the same times",
    ),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damaged_files_are_refused(name, tmp_path):
    change, words = DAMAGE[name]
    data = tmp_path / "run.dat"
    data.write_text(change(BARS.read_text()))

    with pytest.raises(InputError, match=words) as caught:
        read_calculix(data)
    assert str(caught.value).startswith(str(data))
    assert len(str(caught.value)) < 1000


def test_files_that_are_none(tmp_path):
    for path, words in ((tmp_path, "a folder"), (tmp_path / "x.dat", "does not exist")):
        with pytest.raises(InputError, match=words):
            read_calculix(path)
    binary = tmp_path / "b.dat"
    binary.write_bytes(bytes(range(256)) * 10)
    with pytest.raises(InputError, match="not text"):
        read_calculix(binary)


def test_a_file_of_another_case_is_refused(bars):
    with pytest.raises(InputError, match="kinetic energy"):
        other_run(bars, reference(mass=1.01 * MASS))


def study_of_bars(study: ImpactStudy) -> ImpactStudy:
    """A stored study whose full order is the half sine above."""
    full = study.levels["full"]
    return replace(study, levels={"full": replace(full, history=reference())}, deviations={})


def test_comparison_in_a_table_and_in_numbers(bars, impact_study):
    study = study_of_bars(impact_study)
    run = replace(other_run(bars, reference()), wall_time=1066.0)

    comparison = compare_with(study, "full", run)
    rows, numbers = comparison_rows(comparison), CALCULIX.to_json(comparison)

    assert all(len(row) == len(COMPARISON_COLUMNS) for row in rows)
    assert [row[0] for row in rows] == ["CalculiX", "klack, full", "klack from it"]
    assert numbers["wall_time_ratio"] == pytest.approx(1066.0 / 53.3, rel=1e-12)  # 12 + 41.3 s
    assert numbers["other"]["peak_force_N"] == pytest.approx(10.14, rel=1e-3)  # mean of records
    ratio = numbers["klack"]["peak_force_N"] / numbers["other"]["peak_force_N"]
    # the level of the fixture keeps its own measures, the history is compared
    assert numbers["deviation"]["peak_force"] != pytest.approx(ratio - 1)
    assert numbers["other"]["iterations"] == 81
    assert numbers["other"]["energy_balance"] == pytest.approx(-5.9e-3, rel=0.02)
    guest = with_other(study, comparison)
    assert list(guest.levels) == ["calculix", "full"]
    assert guest.reference == "calculix"


def test_a_run_equal_to_the_reference_deviates_by_nothing(impact_study):
    study = study_of_bars(impact_study)
    history = reference()
    same = CalculixResult(
        source="x",
        time=history.edges[1:],
        force=np.zeros(40),
        sideways=np.zeros(40),
        contact_energy=np.zeros(0),
        internal={},
        kinetic={},
    )
    run = replace(other_run(same, history), history=history)

    deviation = compare_with(study, "full", run).deviation

    assert deviation.history_l2 == 0.0
    assert deviation.peak_force == deviation.contact_time == deviation.restitution == 0.0


def test_a_level_that_is_not_there(impact_study, bars):
    only = replace(impact_study, levels={"reduced": impact_study.levels["reduced"]})
    run = other_run(bars, reference())
    with pytest.raises(InputError, match="no level 'full'"):
        compare_with(only, "full", run)
