"""Checks against measurements of others: struck bars, oblique impacts, bounces, rock, a magnet.

Recordings: case ``struck-bar``, see its README. End face of the strikers and low pass of the
amplifier are not known: one dome and one low pass for all shots, chosen once, and the same
comparison without the dome.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from klack.analyses.comparison.impacts import compare_impact
from klack.analyses.comparison.impacts_record import ComparedPulse, MeasuredImpactStudy
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import run_impact
from klack.case.reader import find_case, read_case, text_of
from klack.machine.stages import collected_warnings
from klack.verification.ball_on_rock import ball_on_rock
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.half_space import oblique_spheres
from klack.verification.pole_in_yoke import pole_in_yoke
from klack.verification.sphere_in_liquid import (
    GLASS,
    NYLON,
    REBOUNDS,
    STEEL,
    STOKES_NUMBERS,
    Sphere,
    measured_ratio,
    rebounds,
    restitution,
)

__all__ = ["checks", "struck_bar"]


_SOURCE = "shots of H. Yao (MIT licence), shipped with the case struck-bar"
_FITTED = (
    "speed, end faces and amplifier were not recorded: a factor and a shift per shot; a dome of "
    "0.12 mm and a low pass of 40 kHz for all"
)
_FLAT = "the same with flat faces: the difference is shown, not explained away"
_DOME = "{arc: [10, 0.12], centre: [0, 416.7267], name: end}"
_LINE = "{line: [10, 0], name: end}"


@dataclass(frozen=True, slots=True)
class Shot:
    """Recording, striker length [mm], and the speed that its plateau stands for."""

    name: str
    striker: int
    speed: float


SHOTS = (
    Shot("az42m_2", 300, 15.34),
    Shot("epoxy_2", 600, 4.72),
    Shot("steel945_s1", 200, 14.31),
    Shot("steel945_s2", 200, 21.25),
    Shot("steel945_b3", 200, 17.24),
    Shot("steel945_b6", 200, 14.48),
)
_WITH_RIPPLE = ("az42m_2", "steel945_s1")  # the others have no second crest of 1 %


def checks() -> list[Check]:
    """Return all checks against measurements."""
    found = {shot.name: struck_bar(shot) for shot in SHOTS}
    pulses = {name: study.pulses[0] for name, study in found.items()}
    flat = {shot.name: struck_bar(shot, flat=True).pulses[0] for shot in SHOTS}
    return [
        *(_length(shot, pulses[shot.name], found[shot.name]) for shot in SHOTS),
        check(
            "struck bar, six shots: largest rms difference, of the plateau [-]",
            expected=0.0,
            computed=max(pulse.rms for pulse in pulses.values()),
            tolerance=0.04,
            source=_SOURCE,
            reason=_FITTED,
        ),
        *(
            check(
                f"struck bar, {name}: period of the first ripple [us]",
                expected=1e6 * pulses[name].measured.ripple_period,
                computed=1e6 * pulses[name].computed.ripple_period,
                tolerance=0.05,
                source=_SOURCE,
                reason=_FITTED,
            )
            for name in _WITH_RIPPLE
        ),
        check(
            "struck bar, flat faces: worst length over the measured one, minus 1 [-]",
            expected=0.0,
            computed=min(pulse.length_difference for pulse in flat.values()),
            tolerance=0.03,
            source=_SOURCE,
            reason=_FLAT,
        ),
        check(
            "struck bar, flat faces: largest rms difference, of the plateau [-]",
            expected=0.0,
            computed=max(pulse.rms for pulse in flat.values()),
            tolerance=0.065,
            source=_SOURCE,
            reason=_FLAT,
        ),
        *_recorded_striker(),
        *oblique_spheres(),
        *bounces_in_liquid(),
        *rebounds_in_oil(),
        ball_on_rock(),
        *pole_in_yoke(),
    ]


def struck_bar(shot: Shot, *, flat: bool = False) -> MeasuredImpactStudy:
    """Compute one shot, perhaps with a flat striker, and compare it with its recording."""
    # a flat impact is linear: its speed is the factor
    study = _impact(shot.striker, 10.0 if flat else shot.speed, flat)
    return compare_impact(
        study, [find_case("struck-bar").parent / f"{shot.name}.csv"], level="full"
    )


@cache
def _impact(striker: int, speed: float, flat: bool) -> ImpactStudy:
    path = find_case("struck-bar")
    text = text_of(path)
    text = text.replace("[10, 200]", f"[10, {striker}]").replace("[0, 200]", f"[0, {striker}]")
    text = text.replace("speed: 14.4 m/s", f"speed: {speed} m/s")
    text = text.replace("duration: 400 us", f"duration: {310 + round(2 * striker / 5.125)} us")
    if flat:
        text = text.replace(_DOME, _LINE)
    with collected_warnings():  # flat faces on each other, many contacts: known here
        return run_impact(read_case(text, path), levels=["full"], certify=False)


_LANL = "shot 20061201_1148HE, Los Alamos (BSD-3-Clause), shipped with the case struck-bar"


def _recorded_striker() -> list[Check]:
    """A striker whose length was recorded: flat faces, a low pass by the rise."""
    path = find_case("struck-bar").parent / "titanium.yaml"
    with collected_warnings():  # flat faces on each other, many contacts: known here
        found = run_impact(read_case(text_of(path), path), levels=["full"], certify=False)
    pulse = compare_impact(found, [path.with_name("ti_127mm.csv")], level="full").pulses[0]
    return [
        check(
            f"titanium bars, striker of 127 mm as recorded, flat faces: {what}",
            expected=expected,
            computed=computed,
            tolerance=tolerance,
            source=_LANL,
            reason="c of the echoes to 0.06 %, length of the striker to 0.1 %; a factor, a shift, "
            "and a low pass of 100 kHz by the rise",
        )
        for what, expected, computed, tolerance in (
            (
                "length of the pulse [us]",
                1e6 * pulse.measured.length,
                1e6 * pulse.computed.length,
                5e-3,
            ),
            ("rms difference, of the plateau [-]", 0.0, pulse.rms, 0.045),
        )
    ]


def _length(shot: Shot, pulse: ComparedPulse, study: MeasuredImpactStudy) -> Check:
    time = 1e6 * study.time
    seen = slice(None, None, 4)
    return check(
        f"struck bar, {shot.name}, striker of {shot.striker} mm: length of the pulse [us]",
        expected=1e6 * pulse.measured.length,
        computed=1e6 * pulse.computed.length,
        tolerance=0.015,
        source=_SOURCE,
        reason=_FITTED,
        curve=ComparedCurve(
            x_label="time since the front [us]",
            y_label="strain [um/m]",
            expected=(time[seen], 1e6 * np.asarray(study.middle)[seen]),
            computed=(time[seen], 1e6 * np.asarray(study.computed)[seen]),
        ),
    )


_LEGENDRE = (
    "e/e_dry = exp(-35/St), Legendre, Daniel & Guiraud 2005, Phys. Fluids 17:097105: their fit of "
    "several experiments"
)
_FREE = "roughness 0.1 um for all, steady drag over half a radius, no history force"
_STEEP = 30.0  # below it the restitution rises from 0 to 0.3


_GONDRET = (
    "heights over time, Gondret, Lance & Petit 2002, Phys. Fluids 14:643; conditions of Biegert, "
    "Vowinckel & Meiburg 2017"
)
_MEMORY = "one cut-off for both, 5 um; Basset's memory is too strong, pictures are 2 ms apart"


def rebounds_in_oil() -> list[Check]:
    """First rebound of two steel spheres in silicone oil: film, drag, added mass, memory."""
    found = []
    for shot in REBOUNDS:
        course, heights, contacts = rebounds(shot)
        tops = zip(shot.tops, shot.heights, strict=True)
        points = sorted([*tops, *((time, 0.0) for time in (0.0, *shot.contacts))])
        measured = 1e3 * np.array(points).T
        curve = ComparedCurve(
            x_label="time since the first contact [ms]",
            y_label="height [mm]",
            expected=(measured[0], measured[1]),
            computed=(1e3 * course[0, ::20], 1e3 * course[1, ::20]),
        )
        found += [
            check(
                f"steel in silicone oil, St {shot.stokes:g}: first rebound over the measured "
                f"{1e3 * shot.heights[0]:g} mm [-]",
                expected=1.0,
                computed=heights[0] / shot.heights[0],
                tolerance=0.1,
                source=_GONDRET,
                reason=_MEMORY,
                curve=curve,
            ),
            check(
                f"steel in silicone oil, St {shot.stokes:g}: second contact [ms]",
                expected=1e3 * shot.contacts[0],
                computed=1e3 * contacts[0],
                tolerance=0.1,
                source=_GONDRET,
                reason=_MEMORY,
            ),
        ]
    return found


def bounces_in_liquid() -> list[Check]:
    """Steel, glass and nylon over Stokes numbers of 5 to 3000: film, Hertz contact, drag."""
    return [check for sphere in (STEEL, GLASS, NYLON) for check in _sphere(sphere)]


def _sphere(sphere: Sphere) -> list[Check]:
    stokes = np.array(STOKES_NUMBERS)
    computed = np.array([restitution(sphere, x, drag=True) for x in stokes])
    measured = np.array([measured_ratio(x) for x in stokes])
    fine = np.geomspace(stokes[0], stokes[-1], 60)
    off = np.abs(computed - measured)
    curve = ComparedCurve(
        x_label="Stokes number [-]",
        y_label="restitution, wet over dry [-]",
        expected=(fine, np.array([measured_ratio(x) for x in fine])),
        computed=(stokes, computed),
        x_log=True,
    )
    return [
        check(
            f"{sphere.name} on a wall in a liquid, St 30 to 3000: restitution, worst deviation [-]",
            expected=0.0,
            computed=float(off[stokes >= _STEEP].max()),
            tolerance=0.12,
            source=_LEGENDRE,
            reason=_FREE,
            curve=curve,
        ),
        check(
            f"{sphere.name} on a wall in a liquid, St 5 to 20: restitution, worst deviation [-]",
            expected=0.0,
            computed=float(off[stokes < _STEEP].max()),
            tolerance=0.2,
            source=_LEGENDRE,
            reason=f"{_FREE}; the restitution is steepest there",
        ),
    ]
