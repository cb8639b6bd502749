"""Record of ``klack shots``."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.record import PressureRecord
from klack.analyses.measures import Measure, described_in
from klack.analyses.record import CaseRecord
from klack.analyses.run_columns import Columns, with_columns

__all__ = [
    "DRAWN",
    "FIRST_IMPACT",
    "FRICTION_LOSS",
    "PLASTIC_LOSS",
    "RESULTS",
    "ROCKING",
    "RULE_MEASURES",
    "SHOT_MEASURES",
    "RuleVerdict",
    "Shot",
    "ShotColumns",
    "ShotTraces",
    "ShotsStudy",
]


Column = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class RuleVerdict:
    """Whether the highest rebound of all shots is the one of a centred impact.

    Parameters
    ----------
    restitution_bias [-]
        Of the shot with the highest rebound, minus the centred one.
    rebound_height_bias [m]
        The same of the rebound height.
    relative_restitution_bias, relative_rebound_height_bias [-]
        Over the centred values.
    rank
        Shots that rebound at least as high as the centred one.
    holds
        Whether the relative bias of the restitution is below 1 %.
    """

    restitution_bias: float
    rebound_height_bias: float
    relative_restitution_bias: float
    relative_rebound_height_bias: float
    rank: int
    holds: bool
    sentence: str


Shot = Mapping[str, float]
"""Numbers of one shot by the name of their column; see :class:`ShotColumns`."""

_THEORY = "theory/interface"

DRAWN: tuple[Measure[Shot], ...] = described_in(
    _THEORY,
    Measure(
        key="eccentricity",
        symbol="e_0",
        unit="m",
        definition="Distance between the axes of moving body and seat at the height of first "
        "touch, at the start of the drop.",
    ),
    Measure(
        key="direction",
        symbol="phi_e",
        unit="rad",
        definition="Direction of the eccentricity, from x to y.",
    ),
    Measure(
        key="tilt",
        symbol="theta",
        unit="rad",
        definition="Angle between both axes at the start of the drop.",
    ),
    Measure(
        key="tilt_direction",
        symbol="phi_t",
        unit="rad",
        definition="Direction in which the upper end is tilted, from x to y.",
    ),
    Measure(
        key="force",
        name="closing force",
        symbol="F_0",
        unit="N",
        definition="Force that closes the valve at first touch.",
    ),
    Measure(
        key="friction",
        name="friction in the guide",
        symbol="mu",
        definition="Coefficient of Coulomb friction in the guide.",
        form="fixed",
    ),
    Measure(
        key="contact_friction",
        name="friction between the faces",
        symbol="mu_f",
        definition="Coefficient of Coulomb friction between the faces in contact, while they slip.",
        form="fixed",
    ),
    Measure(
        key="waviness",
        name="out-of-roundness, rms",
        symbol="w",
        unit="m",
        definition="Root mean square deviation of the ring from a circle.",
    ),
)
"""What differs from shot to shot."""

FIRST_IMPACT: tuple[Measure[Shot], ...] = described_in(
    _THEORY,
    Measure(
        key="restitution",
        symbol="e",
        definition="Velocity of the centre of mass along the axis after the first impact over "
        "its velocity before.",
        form="fixed",
        note="It is a result, never an input. A closing force also works during "
        "the contact: a strong one raises the restitution of an eccentric impact, even "
        "above one.",
    ),
    Measure(
        key="rebound_height",
        symbol="h",
        unit="m",
        definition="Highest position of the centre of mass between the first and the second "
        "impact, above its position at first touch.",
    ),
    Measure(
        key="peak_force",
        symbol="F_max",
        unit="N",
        definition="Largest contact force of any time step of the first impact.",
    ),
    Measure(
        key="contact_time",
        symbol="t_c",
        unit="s",
        definition="From first touch to the end of the first uninterrupted contact.",
    ),
    Measure(
        key="impulse",
        symbol="J",
        unit="N s",
        definition="Integral of the contact force over the first impact, with all its contacts.",
    ),
)
"""Of the first impact; the first two tell the rebound."""

ROCKING = Measure[Shot](
    key="rocking",
    name="lateral motion after it",
    symbol="E_r/E_0",
    definition="Kinetic energy of rotation and lateral motion right after the first impact, "
    "over the energy of approach.",
    form="share",
    digits=2,
    note="This is the rebound lost by an eccentric or tilted impact.",
)

FRICTION_LOSS = Measure[Shot](
    key="friction_loss",
    name="lost in friction between the faces",
    symbol="E_f/E_0",
    definition="Energy dissipated by friction between the faces in the first impact, over the "
    "energy of approach.",
    form="share",
    digits=2,
)
"""0 for faces without friction."""

PLASTIC_LOSS = Measure[Shot](
    key="plastic_loss",
    name="lost in yield of the faces",
    symbol="E_p/E_0",
    definition="Energy dissipated by yielding faces in the whole shot, over the energy of "
    "approach.",
    form="share",
    digits=2,
)
"""0 for elastic faces."""

SHOT_MEASURES: tuple[Measure[Shot], ...] = described_in(
    _THEORY,
    *DRAWN,
    Measure(
        key="approach_speed",
        symbol="v_0",
        unit="m/s",
        definition="Speed of the centre of mass along the axis before the first impact.",
    ),
    *FIRST_IMPACT,
    Measure(
        key="sub_contacts",
        symbol="n_c",
        definition="Number of contacts in the first impact.",
        kind="whole",
    ),
    ROCKING,
    FRICTION_LOSS,
    PLASTIC_LOSS,
    Measure(
        key="deepest_set",
        symbol="w_max",
        unit="m",
        definition="Deepest set of a contact point after the shot; every shot meets the faces "
        "as left by the previous shots.",
    ),
    Measure(
        key="second_impact",
        symbol="t_2",
        unit="s",
        definition="Time from the first touch of the first impact to that of the second.",
    ),
    Measure(key="impacts", symbol="n", definition="Impacts until the shot ended.", kind="whole"),
    Measure(
        key="energy_residual",
        symbol="r_E",
        definition="Residual of the energy balance over the initial energy, of the whole shot: "
        "round-off in a correct run.",
        form="power",
    ),
)

RESULTS = tuple(item for item in SHOT_MEASURES if item not in DRAWN)
"""What a shot ends with."""

RULE_MEASURES: tuple[Measure[RuleVerdict], ...] = described_in(
    "theory/measurement",
    Measure(
        key="restitution_bias",
        symbol="e_h - e_0",
        definition="Restitution of the shot with the highest rebound minus that of the centred "
        "shot.",
        form="signed",
    ),
    Measure(
        key="rebound_height_bias",
        symbol="h_h - h_0",
        unit="m",
        definition="Highest rebound minus that of the centred shot.",
        json_name="rebound_height_bias",
    ),
    Measure(
        key="relative_restitution_bias",
        symbol="e_h/e_0 - 1",
        definition="Restitution of the shot with the highest rebound over that of the centred "
        "shot, minus 1.",
        form="signed share",
        digits=2,
    ),
    Measure(
        key="relative_rebound_height_bias",
        symbol="h_h/h_0 - 1",
        definition="Highest rebound over that of the centred shot, minus 1.",
        form="signed share",
        digits=2,
    ),
    Measure(
        key="rank",
        symbol="n_h",
        definition="Number of shots that rebound at least as high as the centred one.",
        kind="whole",
        json_name="shots_at_least_as_high_as_centric",
    ),
)
"""Of the rule that the highest rebound is the centred one."""


@with_columns(
    SHOT_MEASURES,
    later=("contact_friction", "friction_loss", "plastic_loss", "deepest_set"),
    filled=0.0,
)
class ShotColumns(Columns):
    """Shots in rows: drawn quantities and results; results of klack up to 0.1 lack some columns.

    The rebound height is nan if the shot ended on the way up, the second impact if there was none.
    """


@dataclass(frozen=True, kw_only=True, eq=False)
class ShotTraces:
    """Motion and first impact over time, one row per shot, on grids that all rows share.

    Parameters
    ----------
    time (k,), force_time (m,) [s]
        From the first touch.
    height (n, k) [m]
        Of the centre of mass, above that at first touch; nan after the end of the shot.
    force (n, m) [N]
        Axial contact force of the first impact.
    """

    time: Column
    height: NDArray[np.float32]
    force_time: Column
    force: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class ShotsStudy(CaseRecord):
    """All shots of one valve, side by side.

    Parameters
    ----------
    shot_time [s]
        Wall time, on ``workers`` processes.
    resumed
        Shots of an interrupted run.
    speed [m/s]
        At the start, ``start_height`` [m] above first touch.
    step [s]
        Of all shots: that of the case, ``halvings`` times halved.
    step_change
        Of shots in steps twice as long, over what is promised; nan in results up to klack 0.2.
    distributions, guide, faces, layer
        In words, or empty: guide, friction of the faces, and asperities.
    surfaces
        For example ``"needle.tip on housing.seat"``.
    mass [kg]
        Of the moving body.
    modes
        Kept elastic modes of both bodies.
    approach [m]
        Largest approach of any shot.
    centric
        One row, see :func:`~klack.analyses.shots.draw.centric_draw`.
    highest
        Row of the shot with the highest rebound.
    pressures
        Point forces of the first impact: ``"centric"``, ``"highest"``, and ``"lowest"`` by
        restitution.
    """

    shot_time: float
    seed: int
    workers: int
    resumed: int
    speed: float
    start_height: float
    step: float
    distributions: Mapping[str, str]
    surfaces: str
    guide: str
    mass: float
    modes: tuple[int, ...]
    points: int
    approach: float
    shots: ShotColumns
    centric: ShotColumns
    shot_traces: ShotTraces
    centric_traces: ShotTraces
    highest: int
    rule: RuleVerdict
    pressures: Mapping[str, PressureRecord]
    faces: str = ""
    layer: str = ""
    halvings: int = 0
    step_change: float = float("nan")
