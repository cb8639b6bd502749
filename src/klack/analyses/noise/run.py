"""``klack noise``: from stop forces to sound."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.boundary.over_frequency import SurfaceRadiation, surface_radiation
from klack.acoustics.drive_pattern import drive_pattern
from klack.acoustics.force_bands import force_bands
from klack.acoustics.force_response import port_forces
from klack.acoustics.impulsive import impulsive_prominence
from klack.acoustics.loudness import time_varying_loudness
from klack.acoustics.mount import Mount
from klack.acoustics.plate import Air, Plate
from klack.acoustics.radiation import radiation_loss
from klack.acoustics.signal_statistics import (
    pressure_third_octaves,
    sound_statistics,
)
from klack.acoustics.sound import click_pressure
from klack.acoustics.spectrum import force_spectrum, impulse_level
from klack.acoustics.third_octave import ThirdOctaves
from klack.analyses.noise.body import (
    ASSUMED_DAMPING,
    Elements,
    Surroundings,
    Transfers,
    body_noise,
    damped,
    net_share,
    port_transfers,
)
from klack.analyses.noise.in_machine import in_machine, installed
from klack.analyses.noise.mount_source import mount_source
from klack.analyses.noise.own_sound import own_sound
from klack.analyses.noise.reactions import acting_forces
from klack.analyses.noise.record import (
    BodyNoise,
    ClickSound,
    InMachine,
    NoiseDesign,
    NoiseSettings,
    NoiseStudy,
    StopForce,
)
from klack.analyses.noise.source import NoiseSource, SourceStop
from klack.analyses.record import run_fields
from klack.errors import ConvergenceError, InputError, refuse_if
from klack.input.problem import one_of
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings
from klack.materials.material import Material
from klack.signals.sampled import TimeSeries
from klack.units import format_si

__all__ = ["click_sound", "click_sounds", "noise_design", "run_noise"]

_LOWEST, _HIGHEST, _POINTS = 20.0, 200e3, 600  # [Hz] of spectra that are drawn
_UNBALANCED = 1e-4  # of the largest force; round-off leaves below 1e-9
_HEARING = 20e3  # [Hz]
_ENDS_ALIKE = 1e-3  # of the peak
_DAMPED_BY_SOUND = 0.1  # 0.4 dB


def run_noise(
    sources: Sequence[NoiseSource],
    *,
    names: Sequence[str] = (),
    virtual_test: bool = False,
    progress: Progress = silent,
) -> NoiseStudy:
    """Follow the noise of some runs from force to ear, and compare them with the first.

    ``names`` of the designs differ; by default case and run, and a number where they repeat. A
    ``virtual_test`` finds the blocked forces as a bench would, in the machine of each case.
    """
    begin = perf_counter()
    names = _design_names(sources, names)
    clock = StageClock(progress)
    if virtual_test:
        _require_machines(sources)
    with collected_warnings() as caught:
        designs = tuple(
            _design(source, name, several=len(sources) > 1, clock=clock, in_situ=virtual_test)
            for source, name in zip(sources, names, strict=True)
        )
    notes = dict.fromkeys([*_settings_differ(designs), *_notes(designs), *caught])
    return NoiseStudy(
        title=" and ".join(dict.fromkeys(source.title for source in sources)),
        description="",
        **run_fields(begin, clock, "mosqito"),
        designs=designs,
        warnings=tuple(notes),
    )


def click_sound(
    source: NoiseSource, transfers: Transfers, bands: Sequence[ThirdOctaves] | None = None
) -> TimeSeries | None:
    """Sound pressure of one click, if anything radiates: at the first ear of a machine."""
    return next(iter(click_sounds(source, transfers, bands).values()), None)


def click_sounds(
    source: NoiseSource, transfers: Transfers, bands: Sequence[ThirdOctaves] | None = None
) -> dict[str, TimeSeries]:
    """Sound pressure of one click at each ear of a machine; estimated without a name.

    A part of :func:`noise_design`, in a fifth of its time; ``transfers`` of its structures, its
    machine, and ``bands`` of the forces of its stops are used where known.
    """
    found = installed(source, transfers.machine)
    if found is not None:
        return dict(zip(source.noise.ears or (), found.pressures()[0], strict=False))
    if bands is None:
        bands = [force_bands(stop.force) for stop in source.stops]
    around = _surroundings(
        source, net_share(source.net, bands), bands[0], _boundary_elements(source, transfers)
    )
    pressure = _pressure(source, _acting(source), around, transfers)
    return {} if pressure is None else {"": pressure}


def noise_design(source: NoiseSource) -> NoiseDesign:
    """Noise of one run, by itself."""
    return _design(source, source.run, several=False, clock=StageClock(silent))


def _design_names(sources: Sequence[NoiseSource], names: Sequence[str]) -> tuple[str, ...]:
    refuse_if(
        not sources,
        "noise",
        got="no result",
        expected="at least one impact or stroke",
        hint="run one first, for example klack.run_stroke(case).",
    )
    if not names:
        plain = [f"{source.case} {source.run}" for source in sources]
        before = [plain[:i].count(name) for i, name in enumerate(plain)]
        return tuple(
            f"{name} {n + 1}" if n else name for name, n in zip(plain, before, strict=True)
        )
    refuse_if(
        len(names) != len(sources) or len(set(names)) != len(names),
        "noise: names",
        got=", ".join(names),
        expected=f"{len(sources)} different names, one for each design",
        hint="a result with several variants or levels counts as one design for each of them.",
    )
    return tuple(names)


def _require_machines(sources: Sequence[NoiseSource]) -> None:
    for source in sources:
        if source.noise.receiver is None:
            raise InputError(
                f"case {source.case}: noise",
                got="a virtual test without a machine",
                expected="noise.mounts and noise.receiver",
                hint="describe the machine that carries the valve, or leave out --virtual-test.",
            )


def _design(
    source: NoiseSource, name: str, *, several: bool, clock: StageClock, in_situ: bool = False
) -> NoiseDesign:
    clock("force spectra", 0.0)
    stops = tuple(_stop_force(stop) for stop in source.stops)
    share = net_share(source.net, [stop.bands for stop in stops])
    transfers = Transfers()
    elements = _boundary_elements(source, transfers)
    around = _surroundings(source, share, stops[0].bands, elements)
    clock("vibration and radiation", 0.0)
    acting = _acting(source)
    bodies = tuple(_bodies(source, acting, around))
    clock("sound", 0.0)
    at_mounts = None if source.held is None else mount_source(source.structures, source.held)
    machine = _in_machine(source, clock, in_situ)
    if machine is not None:
        sound = machine.ears[0].sound if machine.ears else None
    else:
        pressure = _pressure(source, acting, around, transfers)
        sound = _heard(pressure, source, clock) if pressure is not None else None
    return NoiseDesign(
        name=name,
        label=name if several else source.label,
        detail=source.label,
        kind=source.kind,
        case=source.case,
        case_text=source.case_text,
        run=source.run,
        valid_from=_valid_from(source.stops),
        valid_up_to=source.kept_up_to,
        stops=stops,
        net_share=share,
        bodies=bodies,
        sound=sound,
        settings=_settings(source, elements[0], machine),
        notes=(
            *source.notes,
            *_design_notes(source, bodies, sound, elements),
            *_radiation_notes(source, around),
            *(machine.notes if machine is not None else ()),
        ),
        own_components=source.own_components,
        at_mounts=at_mounts,
        machine=machine,
        own_sound=own_sound(source, acting, around, source.noise.distance),
    )


def _in_machine(source: NoiseSource, clock: StageClock, in_situ: bool) -> InMachine | None:
    """The valve in the machine of its case, with the sound at each ear."""
    found = installed(source)
    if found is None:
        return None
    record, pressures = in_machine(found, source.speed, in_situ=in_situ)
    ears = tuple(
        replace(ear, sound=_heard(pressure, source, clock))
        for ear, pressure in zip(record.ears, pressures or [None] * len(record.ears), strict=True)
        if pressure is not None
    )
    return replace(record, ears=ears or record.ears)


# --------------------------------------------------------------------------- force


def _stop_force(stop: SourceStop) -> StopForce:
    force = stop.force
    frequency = np.geomspace(_LOWEST, min(_HIGHEST, 0.1 / force.step), _POINTS)
    return StopForce(
        stop=stop.name,
        impacts=stop.impacts,
        peak_force=float(force.values.max()),
        impulse=float(force.values.sum() * force.step),
        force=force,
        first=stop.strongest,
        frequency=frequency,
        level=_level_at(stop.strongest, frequency),
        bands=force_bands(force),
    )


def _valid_from(stops: Sequence[SourceStop]) -> float:
    """One over the record [Hz], unless every force ends as it began."""
    for stop in stops:
        values = stop.force.values
        if abs(values[-1] - values[0]) > _ENDS_ALIKE * np.abs(values).max():
            return 1.0 / (values.size * stop.force.step)
    return 0.0


def _level_at(force: TimeSeries, frequency: np.ndarray) -> np.ndarray:
    """Level of the spectrum [dB re 1 uN s] at some frequencies."""
    span = force.values.size * force.step
    spectrum = force_spectrum(
        force, high=1.01 * float(frequency[-1]), resolution=min(1.0 / (20.0 * span), 500.0)
    )
    return np.asarray(np.interp(frequency, spectrum.frequency, impulse_level(spectrum)))


# --------------------------------------------------------------------------- surroundings


def _surroundings(
    source: NoiseSource, share: NDArray[np.float64], octaves: ThirdOctaves, elements: Elements
) -> Surroundings:
    noise = source.noise
    mount, plate = noise.mount, noise.plate
    return Surroundings(
        mount=None
        if mount is None
        else Mount(
            stiffness=mount.stiffness,
            loss_factor=mount.loss_factor,
            # one mount carries all held bodies
            mass=mount.mass or sum(structure.mass for structure in source.structures),
        ),
        plate=None
        if plate is None
        else Plate(
            thickness=plate.thickness,
            area=plate.area,
            material=_material(source, plate.material),
            loss_factor=plate.loss_factor,
        ),
        air=Air(density=noise.air_density, sound_speed=noise.sound_speed),
        efficiency="piston" if noise.radiation == "elements" else noise.radiation,
        elements=elements[0],
        period=1.0 / noise.drive.rate,
        share=share if source.held is None else np.ones_like(share),
        octaves=octaves,
    )


def _boundary_elements(source: NoiseSource, transfers: Transfers) -> Elements:
    structures, sound_speed = source.structures, source.noise.sound_speed

    def compute() -> Elements:
        try:
            found = surface_radiation(structures, sound_speed, result_cache())
        except (InputError, ConvergenceError) as error:
            why = " ".join(str(error).split())
            return {}, f"The bodies radiate as pistons, which is an estimate: {why}"
        return {own.name: way for own, way in zip(structures, found, strict=True)}, ""

    if source.noise.radiation != "elements" or not structures:
        return {}, ""
    return transfers.elements(structures, sound_speed, compute)


def _outside(elements: Mapping[str, SurfaceRadiation]) -> str:
    found = next(iter(elements.values()), None)
    if found is None:
        return ""
    return (
        f" ({found.elements} on the outside of all bodies, {100 * found.covered:.2g} % of it "
        "over openings, mounting faces and unnamed faces)"
    )


def _material(source: NoiseSource, name: str) -> Material:
    refuse_if(
        name not in source.materials,
        f"case {source.case}: noise.plate.material",
        got=f"'{name}'",
        expected=f"one of the materials of the case: {one_of(source.materials)}",
        hint="add it to 'materials'.",
    )
    given = source.materials[name]
    return Material(name=name, young=given.young, poisson=given.poisson, density=given.density)


def _settings(
    source: NoiseSource, elements: Mapping[str, SurfaceRadiation], machine: InMachine | None
) -> NoiseSettings:
    noise = source.noise
    mount, plate = noise.mount, noise.plate
    below, carried, outside = "", "", _outside(elements)
    if mount is not None:
        mass = f", {format_si(1e3 * mount.mass, 'g')} on it" if mount.mass is not None else ""
        below = (
            f"{format_si(mount.stiffness, 'N/m')}, loss factor {100 * mount.loss_factor:.3g} %"
            f"{mass}"
        )
    if plate is not None:
        carried = (
            f"{format_si(plate.thickness, 'm')} of {plate.material}, {plate.area:.3g} m², loss "
            f"factor {100 * plate.loss_factor:.3g} %"
        )
    return NoiseSettings(
        mount=below,
        plate=carried,
        radiation="piston" if noise.radiation == "elements" and not outside else noise.radiation,
        outside=outside,
        distance=noise.distance,
        air_density=noise.air_density,
        sound_speed=noise.sound_speed,
        rate=noise.drive.rate,
        duration=noise.drive.duration,
        given=source.given,
        background=noise.background,
        machine=""
        if machine is None
        else "; ".join(filter(None, [machine.receiver, machine.elements])),
        ear=next(iter(noise.ears or {}), ""),
    )


# --------------------------------------------------------------------------- sound


def _acting(source: NoiseSource) -> dict[str, dict[str, TimeSeries]]:
    """Forces by body and port: with mounts all of them, else those of the stops."""
    forces = {stop.name: stop.force for stop in source.stops}
    return {
        own.name: port_forces(own, forces)
        if source.held is None
        else acting_forces(own, source.held, forces)
        for own in source.structures
    }


def _bodies(
    source: NoiseSource, acting: Mapping[str, Mapping[str, TimeSeries]], around: Surroundings
) -> Iterator[BodyNoise]:
    """Of each body that a stop pushes; with mounts all move on one support, under all forces."""
    forces = {stop.name: stop.force for stop in source.stops}
    together = source.held is not None
    carried = False
    for own in source.structures:
        others = [(damped(x), acting[x.name]) for x in source.structures if x is not own]
        found = body_noise(
            own,
            forces,
            around,
            acting[own.name],
            others=others if together else (),
            alone=not (together and carried),
        )
        if found is not None:
            carried = True
            yield found


def _pressure(
    source: NoiseSource,
    acting: Mapping[str, Mapping[str, TimeSeries]],
    around: Surroundings,
    transfers: Transfers,
) -> TimeSeries | None:
    """Estimated at the distance of the case."""
    parts = [
        click_pressure(
            force,
            frequency,
            transfer,
            distance=source.noise.distance,
            density=source.noise.air_density,
            sound_speed=source.noise.sound_speed,
        )
        for structure in source.structures
        for force, frequency, transfer in port_transfers(
            structure, acting[structure.name], around, transfers
        )
        if np.any(transfer > 0.0)
    ]
    if not parts:
        return None
    return TimeSeries(
        step=parts[0].step,
        values=np.sum([part.values for part in parts], axis=0),
        unit="Pa",
        start=parts[0].start,
        name="click",
    )


def _heard(pressure: TimeSeries, source: NoiseSource, clock: StageClock) -> ClickSound:
    rate = source.noise.drive.rate
    periods = max(1.0, np.floor(source.noise.drive.duration * rate + 1e-9))
    pattern = drive_pattern(pressure, rate, periods / rate)
    statistics, of_pattern = sound_statistics(pressure), sound_statistics(pattern)
    bands: ThirdOctaves = pressure_third_octaves(pressure)
    clock("loudness", 0.0)
    return ClickSound(
        pressure=pressure,
        statistics=statistics,
        bands=bands,
        pattern=of_pattern,
        loudness=time_varying_loudness(pressure),
        prominence=impulsive_prominence(pattern, source.noise.background),
    )


# --------------------------------------------------------------------------- notes


def _design_notes(
    source: NoiseSource,
    bodies: Sequence[BodyNoise],
    sound: ClickSound | None,
    elements: Elements,
) -> tuple[str, ...]:
    found = []
    if not bodies:
        found.append("There is no elastic held body: only the spectra of the force are known.")
    ways, why_none = elements
    if why_none:
        found.append(why_none)
    for way in list(ways.values())[:1]:
        if way.holds_up_to < _HEARING:
            found.append(
                f"The boundary elements are valid up to {format_si(way.holds_up_to, 'Hz')}, "
                "where the largest is a sixth of the wavelength; above, the surface is assumed "
                "to radiate plane waves, an estimate."
            )
    if source.noise.receiver is not None and not source.noise.ears:
        found.append(
            "The case names no ears: the response of the machine is known only at its mounts."
        )
    if bodies and not source.given:
        found.append(
            f"Case {source.case} has no section 'noise': rigid hold, no plate. A small, rigidly "
            "held body radiates almost no audible sound."
        )
    assumed = [body.name for body in bodies if body.assumed]
    if assumed:
        found.append(
            f"The case specifies no damping of {' and '.join(assumed)}; for mobility and "
            f"radiation {100 * ASSUMED_DAMPING:g} % of critical damping is assumed."
        )
    if np.isfinite(source.kept_up_to) and source.kept_up_to < _HEARING:
        found.append(
            f"Modes are kept only up to {format_si(source.kept_up_to, 'Hz')}, which is audible: "
            "keep more modes."
        )
    if bodies and not np.isfinite(source.kept_up_to):
        found.append(
            f"The force of '{source.run}' is that of rigid bodies: it contains no waves, and no "
            "limit of validity is known."
        )
    held = source.held
    if held is not None and held.unbalanced > _UNBALANCED * held.largest:
        found.append(
            "The forces on the held bodies and the momentum of what moves differ by up to "
            f"{format_si(held.unbalanced, 'N', 2)}: a reaction is missing, for example that of "
            "the pivot of a lever, and so is its part in the forces at the mounts."
        )
    if sound is not None and sound.loudness.note:
        found.append(f"The click is {sound.loudness.note}.")
    return tuple(found)


def _radiation_notes(source: NoiseSource, around: Surroundings) -> Iterator[str]:
    """Where sound damps an audible mode by more than a tenth of what its body does."""
    for own in map(damped, source.structures):
        loss = radiation_loss(own, around.radiation_of(own), around.air)
        share = np.where(own.omega < 2.0 * np.pi * _HEARING, loss / (2.0 * own.damping), 0.0)
        worst = int(np.argmax(share)) if share.size else 0
        if share.size and share[worst] > _DAMPED_BY_SOUND:
            at = format_si(float(own.omega[worst]) / (2.0 * np.pi), "Hz")
            yield (
                f"Sound radiation dissipates {100 * share[worst]:.2g} % of the energy that the "
                f"damping of '{own.name}' takes from its mode at {at}, and is not part of the "
                "damping: the level of the mode is up to "
                f"{10 * np.log10(1.0 + share[worst]):.1f} dB too high. Add the radiation loss, "
                f"{50 * loss[worst]:.2g} % of critical damping, to the damping of the body."
            )


def _notes(designs: Sequence[NoiseDesign]) -> list[str]:
    return [
        f"{design.name}: {note}" if len(designs) > 1 else note
        for design in designs
        for note in design.notes
    ]


def _settings_differ(designs: Sequence[NoiseDesign]) -> list[str]:
    first = designs[0].settings
    words = {
        "distance": "the distance",
        "mount": "the mount",
        "plate": "the plate",
        "radiation": "the model of radiation",
        "rate": "the rate of the drive pattern",
        "machine": "the machine",
        "ear": "the ear",
    }
    found = [
        word
        for key, word in words.items()
        if any(getattr(design.settings, key) != getattr(first, key) for design in designs)
    ]
    if not found:
        return []
    return [f"The designs differ in more than their valves: {', '.join(found)}."]
