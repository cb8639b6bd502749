"""A made-up record of a study, of any size: nothing in it was computed."""

import numpy as np

from klack.analyses.study.record import Optimum, StudyColumn, StudyRecord
from klack.studies.fronts import find_front

__all__ = ["made_study"]


def made_study(count: int, *, failed: int = 0, doubtful: int = 0, word: str = "") -> StudyRecord:
    """Points of six parameters and four measures, the first two of which are minimised.

    Parameters
    ----------
    count : int
    failed, doubtful : int
        The first points have no measures, the next ones a doubt.
    word : str
        In every text.
    """
    draws = np.random.default_rng(1).random((count, 6))
    near = 1.0 + ((draws[:, 2:] - 0.5) ** 2).sum(axis=1)
    measures = np.column_stack(
        [
            1e-4 * near * (1.0 + draws[:, 0]),
            1e3 * near * (2.0 - draws[:, 0]),
            40.0 + 10.0 * draws[:, 1],
            draws.sum(axis=1),
        ]
    )
    measures[:failed] = np.nan
    front = find_front(measures[:, :2])
    order = front.points[np.argsort(measures[front.points, 0])]

    def column(name: str, unit: str, values: np.ndarray, spread: str = "") -> StudyColumn:
        return StudyColumn(
            name=f"{name}{word}",
            title=name,
            unit=unit,
            spread=spread,
            today=float(np.nanmean(values)),
            values=values,
        )

    names = (("opening_time", "s"), ("seat.peak_force", "N"), ("level", "dBA"), ("ratio", "1"))
    return StudyRecord(
        title=f"Made up{word}",
        description="",
        version="0",
        versions={},
        created="2026-01-01T00:00:00+00:00",
        wall_time=0.0,
        stage_times={},
        warnings=(f"a note{word}",),
        case="made",
        case_text=f"klack: 1  # {word}",
        study_text="",
        variant="dry",
        design=f"a design{word}",
        threads=1,
        computed=count,
        kept=0,
        point_time=1.0,
        parameters=tuple(
            column(f"network.components.part.p{k}", "m", 1e-4 * draws[:, k], "0 to 100 um")
            for k in range(6)
        ),
        linked=(),
        measures=tuple(column(name, unit, measures[:, k]) for k, (name, unit) in enumerate(names)),
        failures=tuple(f"no contact{word}" if k < failed else "" for k in range(count)),
        notes=tuple(
            f"a doubt{word}" if failed <= k < failed + doubtful else "" for k in range(count)
        ),
        optimum=Optimum(
            algorithm="made up",
            objectives=(f"opening_time{word}", f"seat.peak_force{word}"),
            ways=("minimise", "minimise"),
            bounds=(f"level{word} at most 48 dBA",),
            kept=measures[:, 2] <= 48.0,
            front=order,
            best=int(order[order.size // 2]),
            feasible=True,
        ),
    )
