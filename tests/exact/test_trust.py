"""Which level is the answer; truth: half sines whose steps are counted by hand."""

import numpy as np
import pytest

from klack.analyses.impact.levels import deviations, level_result
from klack.analyses.impact.record import LevelResult
from klack.analyses.impact.trust import best_level, trust_notes
from klack.contact.history import BodyEnergy, EnergyLedger, ImpactHistory

TIME, MASS, SPEED = 40e-6, 3e-3, 0.3


def run(
    level: str,
    *,
    steps: float,
    peak: float = 100.0,
    time: float = TIME,
    duration: float = 2 * TIME,
    shape=lambda x: np.sin(np.pi * x),
    frequency: float = 0.0,
    ringing: float = 0.0,
) -> LevelResult:
    """A pulse of ``time`` in so many steps, and a mode that rings afterwards."""
    step = time / steps
    middle = (np.arange(round(duration / step)) + 0.5) * step - 0.1 * time
    inside = (middle > 0) & (middle < time)
    force = np.where(inside, peak * shape(middle / time), 0.0)
    velocity = -SPEED + np.concatenate([[0.0], np.cumsum(force) * step / MASS])
    initial = 0.5 * MASS * SPEED**2
    body = BodyEnergy(
        name="needle",
        translation=0.5 * MASS * velocity[-1] ** 2,
        vibration=ringing * initial,
        strain=0.0,
        frequency=np.array([frequency]),
        modal=np.array([ringing * initial]),
    )
    history = ImpactHistory(
        step=step,
        force=force,
        gap=np.zeros(len(force)),
        velocity_a=velocity,
        velocity_b=np.zeros(len(velocity)),
        speed=SPEED,
        mass_a=MASS,
        mass_b=np.inf,
        ledger=EnergyLedger(initial=initial, bodies=(body,)),
    )
    return level_result(
        history, level=level, label=level, dofs=1, step=step, wall_time=0.0, setup_time=0.0
    )


@pytest.mark.parametrize(
    ("level", "key"),
    [("full", "full_step"), ("interface", "interface_step"), ("reduced", "reduced_step")],
)
def test_fewer_than_a_hundred_steps_per_contact_are_told(level, key):
    """With the step that keeps half a per cent, and the key that gives it."""
    assert run(level, steps=110).doubts == ()
    (doubt,) = run(level, steps=80).doubts
    assert "80 steps of 500 ns in a contact of 40 us" in doubt
    assert f"Try: run.{key}: 400 ns." in doubt


def test_the_shortest_contact_that_carries_counts():
    """A first contact of a quarter of the time, with a tenth of the impulse."""

    def two(x):
        first, second = x / 0.2, (x - 0.25) / 0.75
        return np.where(
            x < 0.2,
            0.5 * np.sin(np.pi * np.clip(first, 0, 1)),
            np.sin(np.pi * np.clip(second, 0, 1)),
        )

    (doubt,) = run("reduced", steps=200, shape=two).doubts
    assert "40 steps" in doubt
    assert run("reduced", steps=600, shape=two).doubts == ()


def test_many_contacts_of_which_none_carries_a_share_count_all():
    """25 half sines in one impact, of 4 % of its impulse and 80 steps each."""
    many = run("interface", steps=4000, shape=lambda x: np.maximum(np.sin(50 * np.pi * x), 0.0))
    assert many.measures.sub_contacts == 25
    (doubt,) = many.doubts
    assert "80 steps" in doubt


def test_a_mode_that_rings_needs_its_steps_only_in_the_full_order():
    """(omega h)^2 / 12 = 0.5 % at 26 steps per period; modal levels take modes exactly."""
    mode = {"frequency": 250e3, "ringing": 0.05}  # 4 us, 20 steps of 200 ns
    (doubt,) = run("full", steps=200, **mode).doubts
    assert "20 steps of 200 ns in a vibration of 250 kHz" in doubt
    assert run("full", steps=400, **mode).doubts == ()
    assert run("interface", steps=200, **mode).doubts == ()
    assert run("full", steps=200, frequency=250e3, ringing=0.001).doubts == ()


def test_a_front_within_a_few_steps_is_told():
    (doubt,) = run("full", steps=400, shape=np.ones_like).doubts
    assert "flat faces" in doubt


def test_a_run_cut_off_in_contact_is_no_reference():
    cut = run("full", steps=400, duration=0.5 * TIME)
    assert cut.measures.cut_off
    assert "cut off" in cut.doubts[0]
    results = {"full": cut, "reduced": run("reduced", steps=400)}
    assert best_level(results) == "reduced"
    assert deviations(results, "reduced") == {}


def test_a_coarse_full_order_measures_nobody():
    """It was called the reference with 3 % less peak force, 17 % at a longer step."""
    coarse, fine = run("full", steps=20, peak=97.0), run("reduced", steps=2000)
    results = {"reduced": fine, "full": coarse}

    assert best_level(results) == "reduced"
    notes = trust_notes(results, "reduced", deviations(results, "reduced"))
    assert any(
        "the answer is that of level 'reduced'; level 'full' is not a reference" in n for n in notes
    )
    assert best_level({"full": coarse, "lumped": fine}) == "full"
    assert deviations({"full": coarse, "lumped": fine}, "full") == {}
    notes = trust_notes({"full": coarse, "lumped": fine}, "full", {})
    assert any("no level can be a reference" in note for note in notes)


def test_the_better_of_two_levels_that_disagree_is_the_answer():
    results = {
        "reduced": run("reduced", steps=500, peak=70.0),
        "interface": run("interface", steps=500, peak=110.0),
        "lumped": run("lumped", steps=500, peak=200.0),
    }
    assert best_level(results) == "interface"
    (note,) = trust_notes(results, "interface", deviations(results, "interface"))
    assert "level 'reduced' is off by -36.4 % in peak force" in note
    close = results | {"reduced": run("reduced", steps=500, peak=109.5)}
    assert trust_notes(close, "interface", deviations(close, "interface")) == ()
