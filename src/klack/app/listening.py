"""The clicks of the points of a study, in a process of its own."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from klack.acoustics.signal_statistics import sound_statistics
from klack.acoustics.wav import full_scale_of, level_statement, wav_bytes
from klack.analyses.study.asked_points import AskedPoints
from klack.analyses.study.computing import Builds, compute_alone, sounds_of
from klack.analyses.study.kinds import ask
from klack.analyses.study.point_case import written_of_point
from klack.analyses.study.record import StudyRecord
from klack.app.answers import Heard
from klack.app.study_points import StudyPoints
from klack.case.any_case import tree_of
from klack.errors import InputError
from klack.progress import silent
from klack.signals import TimeSeries

__all__ = ["Listener", "common_scale"]

_LEVEL = "noise.sound_exposure_level_weighted"
_HEADROOM = 12.0  # [dB] of the click that others are compared with, for what they add
_CASE = -1  # the case as it is, among the points
_MOST = 64  # clicks that are kept


class Listener:
    """The object behind the players of a study."""

    def __init__(self) -> None:
        self._points = StudyPoints()
        self._record: StudyRecord | None = None
        self._sounds: dict[int, TimeSeries] = {}

    def listen(self, folder: str, near: str, point: int) -> Heard:
        """Click of a point and of the case as it is, to one full scale.

        Parameters
        ----------
        folder : str
            Of the result.
        near : str
            Folder of the case, for the files that it names.
        point : int

        Raises
        ------
        InputError
            For a point that is not there, and where nothing radiates, with the reason.
        """
        record = self._points.record(folder)
        if not 0 <= point < record.count:
            raise InputError(
                "point",
                got=str(point),
                expected=f"0 to {record.count - 1}",
                hint="choose a point of the chart or of the table.",
            )
        if self._record is not record:
            if self._record is None or not _same_points(self._record, record):
                self._sounds = {}
            self._sounds |= {item.point: item.pressure for item in record.sounds}
            self._record = record
        base = self._sound(record, near, _CASE)
        own = self._sound(record, near, point)
        scale = common_scale(own, base)
        return Heard(
            point=point,
            wav=wav_bytes(own, full_scale=scale),
            base_wav=wav_bytes(base, full_scale=scale),
            scale=level_statement(scale),
            level=sound_statistics(own).exposure_level_A,
            base_level=sound_statistics(base).exposure_level_A,
        )

    def _sound(self, record: StudyRecord, near: str, point: int) -> TimeSeries:
        if point not in self._sounds:
            asked = _asked(record, near, point)
            (found,) = sounds_of(asked, silent)
            if found is None:
                raise _silent(asked, point)
            while len(self._sounds) >= _MOST:
                self._sounds.pop(next(key for key in self._sounds if key != _CASE))
            self._sounds[point] = found
        return self._sounds[point]


def common_scale(now: TimeSeries, base: TimeSeries | None) -> float:
    """Full scale [Pa] of two clicks: that of the base with room above, or of the louder one."""
    louder = full_scale_of(now, headroom=0.1)
    return louder if base is None else max(full_scale_of(base, headroom=_HEADROOM), louder)


def _same_points(one: StudyRecord, other: StudyRecord) -> bool:
    """Whether a number means the same point in both: in the record of a study that runs, too."""

    def told(record: StudyRecord) -> tuple[str, ...]:
        return record.case_text, record.study_text, record.variant, record.design

    return told(one) == told(other)


def _asked(record: StudyRecord, near: str, point: int) -> AskedPoints:
    tree = tree_of(record.case_text, Path(near) / f"{record.case}.yaml")
    written: dict[str, Any] = {} if point == _CASE else written_of_point(record, point)
    return ask(tree.any_case(), tree, [written], (_LEVEL,), _variant(record))


def _variant(record: StudyRecord) -> str | None:
    """Variant of a stroke, or level of an impact; shots are judged by their level of its own."""
    if not record.model:
        return record.variant
    level = record.variant.partition(" + ")[0]
    return None if level == "shots" else level


def _silent(asked: AskedPoints, point: int) -> InputError:
    """Why a point has no sound, in the words of its row."""
    with Builds() as builds:
        row = compute_alone(asked, builds)[0]
    words: Sequence[str] = [row.failure] if row.failure else row.notes
    which = "the case as it is" if point == _CASE else f"point {point}"
    reason = " ".join(words).replace("\n", " ") or "nothing that radiates"
    return InputError(
        f"click of {which}",
        got=reason.rstrip("."),
        expected="a section 'noise', and bodies with surfaces",
        hint="klack noise tells what is missing.",
    )
