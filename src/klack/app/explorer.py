"""Impacts and strokes of bodies that stay, computed again at each move of a slider.

An impact is that of ``klack impact --level reduced`` at the same values, bit for bit: the static
contact, the pattern of the port, the modes' share and the law are all made again.  A stroke is that
of ``klack stroke``, with the laws of its stops as they were built.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol, cast

import numpy as np
import scipy
from threadpoolctl import ThreadpoolController

from klack.acoustics.drive_pattern import drive_pattern
from klack.acoustics.force_bands import force_bands
from klack.acoustics.loudness import time_varying_loudness
from klack.acoustics.signal_statistics import sound_statistics
from klack.acoustics.third_octave import ENERGY_REFERENCE, ThirdOctaves
from klack.acoustics.wav import level_statement, wav_bytes
from klack.analyses.contact_doubts import contact_doubt
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import ImpactBodies, impact_bodies, impact_of_bodies
from klack.analyses.impact.wording import FAIR, GOOD, estimate_sentence, worst_error
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.run import click_sound
from klack.analyses.noise.source import NoiseSource, impact_sources, stroke_sources
from klack.analyses.stroke.missing import missing_notes
from klack.analyses.stroke.record import StrokeVariant
from klack.analyses.stroke.run import (
    body_summaries,
    one_variant,
    stop_summaries,
    stroke_notes,
    study_of_run,
)
from klack.app.answers import Answer, Curve, Floats, Hearing, Judgement, Number, Opened, Slider
from klack.app.curves import drawn, enveloped, impact_numbers, stroke_numbers, travelled
from klack.app.listening import common_scale
from klack.app.sliders import sliders_of, written
from klack.assembling.problem import contact_problem
from klack.assembling.valve import Valve, build_valve, filled_network
from klack.case.any_case import AnyCase, CaseTree, tree_of
from klack.case.points import case_at
from klack.case.rewriting import with_values
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.case.valve_roles import find_roles
from klack.elasticity.loads import NearLoads
from klack.errors import InputError, KlackError
from klack.progress import silent
from klack.signals import TimeSeries
from klack.stages import collected_warnings

__all__ = ["Explorer"]

Values = Mapping[str, float]
"""Of sliders, by their keys, in SI."""

_SHOWN = 0.05  # [s] of the spectrogram
_LONGEST = 5.0  # [s] of a drive pattern
_REFERENCE = 20e-6  # [Pa]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Computed:
    """One position.

    Parameters
    ----------
    source : NoiseSource
    bands : tuple of ThirdOctaves
        Of the forces of its stops.
    pressure : TimeSeries or None
    force, lift : tuple of Curve
    numbers : tuple of Number
    doubts : tuple of str
    """

    source: NoiseSource
    bands: tuple[ThirdOctaves, ...]
    pressure: TimeSeries | None
    force: tuple[Curve, ...]
    lift: tuple[Curve, ...]
    numbers: tuple[Number, ...]
    doubts: tuple[str, ...]


class _Design(Protocol):
    """Bodies of a case."""

    run: str
    time_unit: str

    def at(self, case: Any) -> _Computed:
        """Compute one position."""
        ...

    def judged(self, case: Any) -> tuple[str, str]:
        """Grade of the estimate, and words."""
        ...

    def close(self) -> None:
        """Free the bodies."""
        ...


class Explorer:
    """The object behind a slider page, in a process of its own."""

    def __init__(self) -> None:
        self._text = ""
        self._tree: CaseTree | None = None
        self._case: AnyCase | None = None
        self._design: _Design | None = None
        self._sliders: dict[str, Slider] = {}
        self._pinned: TimeSeries | None = None
        self._last: tuple[dict[str, float], _Computed] | None = None
        self._pinned_loudness: Number | None = None
        self._pools = ThreadpoolController()

    def open(self, text: str, path: str) -> Opened:
        """Build the bodies of a case and compute it as it stands.

        Raises
        ------
        InputError
            For a case that is not valid.
        """
        if self._design is not None:
            self._design.close()
            self._design = None
        self._text, self._tree = text, tree_of(text, Path(path))
        with collected_warnings():  # the first position tells them again
            self._case = case = self._tree.any_case()
            found = sliders_of(case, self._tree)
            self._sliders = {slider.key: slider for slider in found}
            if isinstance(case, ValveCase):
                self._design = _Strokes(case)
            else:
                self._design = _Impacts(case, self._hardest(found))
        self._pinned = self._last = None
        self._pools = ThreadpoolController()  # with libraries that came since
        first = self.move({}, pin=True)
        return Opened(
            title=case.title or case.name,
            kind="stroke" if isinstance(case, ValveCase) else "impact",
            sliders=found,
            run=self._design.run,
            first=first,
        )

    def move(self, values: Values, pin: bool = False) -> Answer:
        """Force, motion, bands and click at a position of the sliders.

        Parameters
        ----------
        values : mapping of str to float
            Of sliders that are off their place in the case.
        pin : bool
            Compare later positions with this one.
        """
        begin = perf_counter()
        design = self._require_open()
        with self._one_thread():
            found = self._computed(values)
        bands = found.bands
        energy = np.sum([band.energy for band in bands], axis=0)
        levels = 10.0 * np.log10(np.maximum(energy, 1e-30) / ENERGY_REFERENCE)
        if pin:
            self._pinned, self._pinned_loudness = found.pressure, None
        wav, ghost, scale = _sounds(found.pressure, self._pinned)
        return Answer(
            force=found.force,
            lift=found.lift,
            time_unit=design.time_unit,
            bands=bands[0].middle,
            levels=levels,
            numbers=(*found.numbers, *_level_numbers(found.pressure)),
            wav=wav,
            ghost_wav=ghost,
            scale=scale,
            doubts=found.doubts,
            seconds=perf_counter() - begin,
        )

    def judge(self, values: Values) -> Judgement:
        """Estimate of the error at a position of the sliders: once they rest."""
        design = self._require_open()
        with self._one_thread(), collected_warnings():  # the move has told them
            grade, words = design.judged(self._case_at(values))
        return Judgement(grade=grade, words=words)

    def listen(self, values: Values) -> Hearing | None:
        """Loudness, spectrogram and drive pattern of a position: once the sliders rest.

        None if nothing radiates.
        """
        with self._one_thread():
            found = self._computed(values)
            pressure, drive = found.pressure, found.source.noise.drive
            if pressure is None:
                return None
            pattern = drive_pattern(pressure, drive.rate, min(drive.duration, _LONGEST))
            now = _loudness(pressure)
            if self._pinned_loudness is None and self._pinned is not None:
                self._pinned_loudness = _loudness(self._pinned)
        return Hearing(
            number=now,
            pinned=self._pinned_loudness or now,
            spectrogram=_spectrogram(pressure),
            pattern_wav=wav_bytes(pattern, full_scale=common_scale(pattern, self._pinned)),
        )

    def text_at(self, values: Values) -> str:
        """Text of the case with these values, everything else as its author wrote it."""
        assert self._tree is not None
        places = {
            self._sliders[key].place: self._sliders[key].text(value)
            for key, value in values.items()
        }
        return with_values(self._tree, places) if places else self._text

    def _computed(self, values: Values) -> _Computed:
        """A position; the last one is kept, since what follows asks for it again."""
        if self._last is None or self._last[0] != values:
            with collected_warnings() as notes:  # of reading it, too
                found = self._require_open().at(self._case_at(values))
            doubts = tuple(filter(None, dict.fromkeys((*notes, *found.doubts))))
            self._last = dict(values), replace(found, doubts=doubts)
        return self._last[1]

    def _one_thread(self) -> Any:
        """Small matrices: threads would wait for each other."""
        return self._pools.limit(limits=1)

    def _case_at(self, values: Values) -> Any:
        assert self._tree is not None
        assert self._case is not None
        changes = {}
        for key, value in values.items():
            slider = self._sliders.get(key)
            if slider is None or slider.needs_mesh:
                raise InputError(
                    key,
                    got="a key that does not move here",
                    expected="one of the sliders",
                    hint="change it in the case, and open that.",
                )
            changes[slider.place] = written(slider, value)
        kind: Any = type(self._case)
        return case_at(kind, self._tree, self._tree, changes)

    def _hardest(self, sliders: Sequence[Slider]) -> Case | None:
        """Case with all sliders of the motion at their upper ends; None if it is refused."""
        highest = {
            slider.key: slider.high
            for slider in sliders
            if slider.place[0] == "motion" and not slider.needs_mesh
        }
        try:
            return cast(Case, self._case_at(highest))
        except InputError:
            return None

    def _require_open(self) -> _Design:
        if self._design is None:
            raise InputError("sliders", got="no case", expected="an open one", hint="reload.")
        return self._design


# --------------------------------------------------------------------------- impacts


class _Impacts:
    """Impacts of two bodies at the reduced level."""

    run, time_unit = "reduced", "us"

    def __init__(self, case: Case, hardest: Case | None) -> None:
        if not case.has_surfaces:
            raise InputError(
                f"case {case.name}",
                got="bodies given as models, without surfaces",
                expected="bodies with meshes",
                hint="run it, and compare results.",
            )
        self._bodies: ImpactBodies = impact_bodies(case, levels=(self.run,), certify=True)
        if hardest is not None:
            with suppress(KlackError):  # moves tell what is wrong there
                contact_problem(hardest, self._bodies.placed, silent)
        self._bodies.placed.keep_no_more()
        self._transfers = Transfers()
        self._near = {name: NearLoads() for name in self._bodies.pools}

    def close(self) -> None:
        """Free the factorisations."""
        self._bodies.close()

    def at(self, case: Case) -> _Computed:
        """One impact."""
        study = self._study(case, certify=False)
        level = study.levels[self.run]
        source = impact_sources(study, (self.run,), case)[0]
        history = level.history
        bands = tuple(force_bands(stop.force) for stop in source.stops)
        return _Computed(
            source=source,
            bands=bands,
            pressure=click_sound(source, self._transfers, bands),
            force=(Curve.scaled("contact force", *drawn(history.time, history.force), 1e6, 1.0),),
            lift=(Curve.scaled("needle", *drawn(*travelled(history)), 1e6, 1e6),),
            numbers=impact_numbers(level),
            doubts=(*study.warnings, contact_doubt(study.contact), *source.notes),
        )

    def judged(self, case: Case) -> tuple[str, str]:
        """Compare with one run at the interface level."""
        study = self._study(case, certify=True)
        if self.run not in study.estimates:
            return "none", study.estimate_doubt or "There is no estimate for this case."
        worst = worst_error(study, self.run)
        is_out = worst > FAIR or study.contact.doubts or study.reference != self.run
        grade = "out" if is_out else "good" if worst <= GOOD else "fair"
        return grade, estimate_sentence(study)

    def _study(self, case: Case, *, certify: bool) -> ImpactStudy:
        levels = case.require_levels((self.run,))
        return impact_of_bodies(case, self._bodies, levels=levels, certify=certify, near=self._near)


# --------------------------------------------------------------------------- strokes


class _Strokes:
    """Strokes of a valve in its first variant."""

    time_unit = "ms"

    def __init__(self, case: ValveCase) -> None:
        with collected_warnings() as notes:
            self._valve: Valve = build_valve(case, silent, threads=1)
            self._bodies, self._stops = body_summaries(self._valve), stop_summaries(self._valve)
        self.run = str(case.one_variant(None))
        self._notes = notes
        self._transfers = Transfers()

    def close(self) -> None:
        """Nothing has to be freed."""

    def at(self, case: ValveCase) -> _Computed:
        """One stroke."""
        network = filled_network(case, self._valve.reduced, self._valve.laws)
        valve = replace(self._valve, case=case, network=network)
        roles = find_roles(case, network)
        variant = case.one_variant(self.run)
        with collected_warnings() as caught:
            run = one_variant(valve, roles, variant, silent, check=False)
            study = study_of_run(valve, roles, variant, run, self._bodies, self._stops)
            source = stroke_sources(study, case=case)[0]
        found, time = run.variant, run.variant.result.time
        channel = found.channel(study.channels.lift)
        lift = (
            ()
            if channel is None
            else (Curve.scaled("lift", *drawn(time, channel.values), 1e3, 1e6),)
        )
        bands = tuple(force_bands(stop.force) for stop in source.stops)
        of_run: dict[str, StrokeVariant] = {variant: found}
        warned = tuple(dict.fromkeys((*self._notes, *caught)))
        return _Computed(
            source=source,
            bands=bands,
            pressure=click_sound(source, self._transfers, bands),
            force=tuple(
                Curve.scaled(stop.name, *enveloped(stop.force), 1e3, 1.0) for stop in source.stops
            ),
            lift=lift,
            numbers=stroke_numbers(found, study.channels),
            doubts=(
                *missing_notes(of_run, (), run.failure),
                *stroke_notes(case, of_run, roles.seat, warned),
                *study.warnings,  # of the text of the case
                *map(contact_doubt, self._stops),
                *source.notes,
            ),
        )

    def judged(self, case: ValveCase) -> tuple[str, str]:
        """No estimate is known for strokes."""
        return "none", (
            "klack has no error estimate for strokes; klack advise gives one for a step and a mesh."
        )


# --------------------------------------------------------------------------- sounds


def _level_numbers(pressure: TimeSeries | None) -> tuple[Number, ...]:
    if pressure is None:
        return ()
    level = sound_statistics(pressure).exposure_level_A
    return (
        Number(
            key="level", name="sound exposure level", unit="dB(A)", value=level, difference="dB"
        ),
    )


def _loudness(pressure: TimeSeries) -> Number:
    value = time_varying_loudness(pressure).maximum
    return Number(key="loudness", name="loudness, maximum", unit="sone", value=value)


def _sounds(now: TimeSeries | None, pinned: TimeSeries | None) -> tuple[bytes, bytes, str]:
    """Both clicks to one full scale: that of the pinned one with room above, or of the louder."""
    if now is None or pinned is None:
        return b"", b"", ""
    scale = common_scale(now, pinned)
    return (
        wav_bytes(now, full_scale=scale),
        wav_bytes(pinned, full_scale=scale),
        level_statement(scale),
    )


def _spectrogram(pressure: TimeSeries) -> tuple[Floats, Floats, Floats]:
    """Level over time [ms] and frequency [kHz], Hann windows of 5.3 ms."""
    first = pressure.values[: int(_SHOWN * pressure.rate)]
    f, t, power = scipy.signal.spectrogram(
        first, pressure.rate, window="hann", nperseg=256, noverlap=208, mode="psd"
    )
    level = 10.0 * np.log10(np.maximum(power, 1e-30) / _REFERENCE**2)
    start = pressure.start
    return 1e3 * (t + start), 1e-3 * f, np.asarray(level, dtype=float)
