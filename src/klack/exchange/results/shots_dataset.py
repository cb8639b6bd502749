"""Shots as named arrays over the shots and over time."""

import numpy as np

from klack.analyses.shots.record import SHOT_MEASURES, ShotsStudy
from klack.exchange.results.variables import Variable, about_measure

__all__ = ["shots_variables"]


def shots_variables(study: ShotsStudy) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """Variables and coordinates of all shots and of the centred one.

    Numbers of a shot are of shape (n + 1,) over ``shot``; height and force of shape (n + 1, k)
    over ``shot`` and time.  Shots are counted from 1; the last row, shot 0, is the centred one.

    Parameters
    ----------
    study : ShotsStudy
    """
    shots, centred = study.shot_traces, study.centric_traces
    count = study.shots.count
    rows = [*(study.shots.row(index) for index in range(count)), study.centric.row(0)]
    variables = {
        measure.key: Variable(
            ("shot",), np.array([row[measure.key] for row in rows]), about_measure(measure)
        )
        for measure in SHOT_MEASURES
    }
    variables["height"] = Variable(
        ("shot", "time"),
        np.vstack([shots.height, centred.height]),
        {"units": "m", "long_name": "height of the centre of mass above that at first touch"},
    )
    variables["contact_force"] = Variable(
        ("shot", "force_time"),
        np.vstack([shots.force, centred.force]),
        {"units": "N", "long_name": "axial contact force of the first impact"},
    )
    after = {"units": "s", "long_name": "time after the first touch"}
    coordinates = {
        "shot": Variable(
            ("shot",),
            np.append(np.arange(1, count + 1), 0),
            {"long_name": "number of the shot; 0 is the centred one"},
        ),
        "time": Variable(("time",), shots.time, after),
        "force_time": Variable(("force_time",), shots.force_time, after),
    }
    return variables, coordinates
