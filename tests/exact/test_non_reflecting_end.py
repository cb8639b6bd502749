"""A long bar with a non-reflecting end.

Truth: exact, the wave of St Venant.  In a bar without lateral strain a dashpot of rho c A at the
end takes the whole wave; with lateral strain the front, which is short, comes back in part.
Conservation: what leaves is booked, and the balance closes.
"""

import warnings
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.run import run_impact
from klack.case.reader import read_case
from klack.cli.main import main
from klack.errors import InputError

ROD = (Path(__file__).parents[1] / "data" / "struck_rod.yaml").read_text(encoding="utf-8")
OPEN = ROD.replace("\n  bar:\n", "\n  bar:\n    non_reflecting: far\n")
LONG = OPEN.replace("duration: 32 us", "duration: 60 us")
SPEED_OF_WAVES = np.sqrt(210e9 / 7850.0)


def full(text: str):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        study = run_impact(read_case(text, Path("case.yaml")), levels=["full"], certify=False)
    return study.levels["full"]


def echo(level) -> float:
    """Energy of the wave that comes back over that of the wave that went."""
    gauge = level.gauges[0]
    c = SPEED_OF_WAVES
    # past the gauge at 60 mm until 140 mm / c; the echo from 120 mm passes it from 180 mm / c on
    gone = gauge.time < 160e-3 / c
    back = (gauge.time > 162e-3 / c) & (gauge.time < 265e-3 / c)
    return float(np.sum(gauge.exact[back] ** 2) / np.sum(gauge.exact[gone] ** 2))


@pytest.mark.slow
def test_a_wave_in_a_bar_leaves_through_the_end():
    closed, open_end = full(LONG.replace("    non_reflecting: far\n", "")), full(LONG)

    assert echo(closed) > 0.9  # the free end returns it all
    assert echo(open_end) < 1e-4
    ledger = open_end.history.ledger
    given = 0.5 * open_end.history.mass_a * 1.0**2
    # equal bars: the striker stops and all of its energy is in the wave; the mesh keeps a ripple
    assert ledger.radiated == pytest.approx(given, rel=0.01)
    assert open_end.energies["through non-reflecting ends"] == ledger.radiated
    assert abs(ledger.residual) < 1e-9
    assert closed.history.ledger.radiated == 0.0


@pytest.mark.slow
def test_with_lateral_strain_a_long_pulse_leaves():
    """Pulse of 80 mm in a bar of 4 mm: its length over the radius is 40."""
    assert echo(full(LONG.replace("poisson: 0.0", "poisson: 0.3"))) < 1e-3


@pytest.mark.slow
def test_a_bar_without_end_does_not_move_as_a_whole():
    level = full(OPEN)

    assert level.history.mass_b == np.inf
    assert np.all(level.history.velocity_b == 0.0)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("levels: [full]", "levels: [reduced, full]", "the level full alone"),
        ("non_reflecting: far", "non_reflecting: end", "another surface"),
        ("non_reflecting: far", "non_reflecting: tip", "surface of bar"),
        ("  striker:\n", "  striker:\n    non_reflecting: far\n", "the body that is hit"),
    ],
)
def test_ends_that_cannot_be(old, new, text):
    with pytest.raises(InputError, match=text):
        read_case(OPEN.replace(old, new, 1), Path("case.yaml"))


@pytest.mark.parametrize(
    "command", [["impact", "--level", "reduced"], ["reduce"], ["advise"], ["noise"]]
)
def test_what_has_only_modes_says_which_level_to_use(tmp_path, capsys, command):
    case = tmp_path / "case.yaml"
    case.write_text(OPEN, encoding="utf-8")

    assert main([command[0], str(case), *command[1:]]) == 2
    assert "klack impact with --level full" in " ".join(capsys.readouterr().err.split())
