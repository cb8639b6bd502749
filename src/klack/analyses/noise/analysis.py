"""A noise study in words and numbers, and on disk.

``result.zarr/study/designs/0/sound/pressure/values`` is the sound pressure of one click.
"""

from collections.abc import Iterator
from dataclasses import replace
from operator import attrgetter, itemgetter

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.signal_statistics import PRESSURE_REFERENCE
from klack.acoustics.source_levels import FORCE_REFERENCE, VELOCITY_REFERENCE
from klack.acoustics.third_octave import ENERGY_REFERENCE, ThirdOctaves, nominal_label
from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.json_parts import (
    OWN_COMPONENTS,
    JsonForm,
    Key,
    Real,
    by_name,
    inherited,
    measured_keys,
    schema_key,
)
from klack.analyses.measures import text_table
from klack.analyses.noise.measures import (
    BODY_MEASURES,
    DESIGN_MEASURES,
    EAR_MEASURES,
    IN_SITU_MEASURES,
    INTERFACE_MEASURES,
    MOUNT_MEASURES,
    PATH_MEASURES,
    STOP_MEASURES,
)
from klack.analyses.noise.record import InMachine, NoiseDesign, NoiseStudy
from klack.analyses.store import RecordFormat
from klack.terminal.tables import TextTable

__all__ = ["NOISE"]

Floats = NDArray[np.float64]

_BAND = JsonForm(
    "BandJson",
    "Level in a third octave.",
    Key("center_Hz", float, of=itemgetter(0)),
    Key("nominal", str, of=itemgetter(1)),
    Key("level_dB", float, "re (1 uN)^2 s.", itemgetter(2)),
)
_STOP = JsonForm(
    "StopNoiseJson",
    "Force of one stop.",
    *measured_keys(STOP_MEASURES),
    Key("third_octave", [_BAND], of=lambda stop: _bands(stop.bands, stop.bands.energy)),
)
_BODY = JsonForm(
    "BodyNoiseJson",
    "Vibration and radiation of one body.",
    *measured_keys(BODY_MEASURES),
    Key(
        "injected_energy_J",
        dict[str, Real],
        "By port.",
        lambda body: dict(zip(body.ports, body.injected, strict=True)),
    ),
    Key(
        "radiated_energy_J",
        dict[str, Real],
        "By group of surfaces.",
        lambda body: dict(zip(body.groups, body.radiated.sum(axis=1), strict=True)),
    ),
)
_FREEDOM = JsonForm(
    "MountFreedomJson",
    "One degree of freedom of a mount; its curves are in the files of the source.",
    *measured_keys(MOUNT_MEASURES),
    Key(
        "free_velocity_dB",
        [float],
        "Third octaves re (1 nm/s)^2 s; empty where nothing moves.",
        lambda item: _levels(item.velocity_bands, VELOCITY_REFERENCE),
    ),
    Key(
        "blocked_force_dB",
        [float],
        "Third octaves re (1 uN)^2 s; empty where nothing acts.",
        lambda item: _levels(item.force_bands, FORCE_REFERENCE),
    ),
)
_MOUNTS = JsonForm(
    "MountSourceJson",
    "The valve as a source at its mounts.",
    Key("mass_kg", float, "Of the held bodies.", attrgetter("mass")),
    Key(
        "balance",
        Real,
        "Sum of forces and momentum minus the inflow, over the largest force; null for an impact.",
    ),
    Key("repaid", float, "Force that removes energy of macro steps, over the largest force."),
    Key(
        "entering_N",
        float,
        "Largest change of the force by fluid columns, mouths and outside components.",
        attrgetter("entering"),
    ),
    Key(
        "band_center_Hz",
        [float],
        of=lambda source: list(source.freedoms[0].velocity_bands.middle),
    ),
    Key(
        "freedoms",
        {str: _FREEDOM},
        "By name, flange.z.",
        by_name("freedoms"),
    ),
)
_INTERFACE = JsonForm(
    "InterfaceFreedomJson",
    "One degree of freedom between valve and machine.",
    *measured_keys(INTERFACE_MEASURES),
    Key("band_center_Hz", [float], of=lambda item: list(item.force_bands.middle)),
    Key(
        "force_dB",
        [float],
        "On the machine, third octaves re (1 uN)^2 s; empty where nothing acts.",
        lambda item: _levels(item.force_bands, FORCE_REFERENCE),
    ),
    Key(
        "energy_J",
        [float],
        "Energy into the machine by band.",
        lambda item: list(item.energy_bands.energy),
    ),
)
_PATH = JsonForm(
    "PathJson",
    "Contribution of one degree of freedom to an ear.",
    *measured_keys(PATH_MEASURES),
    Key(
        "third_octave_dB",
        [float],
        "Level of this path by itself, re (20 uPa)^2 s; empty where nothing acts.",
        lambda path: _levels(path.bands, PRESSURE_REFERENCE),
    ),
)
_EAR = JsonForm(
    "EarJson",
    "Sound of one click at an ear; measures over time are null where no signal is known.",
    *measured_keys(EAR_MEASURES),
    Key("band_center_Hz", [float], of=lambda ear: list(ear.bands.middle)),
    Key(
        "third_octave_dB",
        [float],
        "re (20 uPa)^2 s.",
        lambda ear: _levels(ear.bands, PRESSURE_REFERENCE),
    ),
    Key("paths", {str: _PATH}, "By freedom.", by_name("paths")),
)
_IN_SITU_FREEDOM = JsonForm(
    "InSituFreedomJson",
    "One degree of freedom of a virtual test.",
    *measured_keys(IN_SITU_MEASURES),
)
_IN_SITU = JsonForm(
    "InSituJson",
    "Blocked forces as a test in the machine would find them, without noise.",
    Key("indicators", list[str]),
    Key("deviation", float, "Largest over all lines, relative."),
    Key("condition", float, "Largest of the mobilities from the interface to the indicators."),
    Key("freedoms", {str: _IN_SITU_FREEDOM}, of=by_name("freedoms")),
)
_MACHINE = JsonForm(
    "MachineJson",
    "The valve in the machine of its case.",
    Key("receiver", str),
    Key("elements", str, "Empty where all mounts are joined rigidly."),
    Key(
        "energy_J",
        float,
        "Energy of one click into the machine through all degrees of freedom.",
        "energy",
    ),
    Key("element_loss_J", float, "Lost in the elements.", "element_loss"),
    Key("balance", float, "Sum of all powers over the largest of them, at the worst line."),
    Key(
        "motion_ratio",
        Real,
        "Highest velocity of the mounts along z over the highest velocity of the needle.",
        "motion",
    ),
    Key("freedoms", {str: _INTERFACE}, "By name.", by_name("freedoms")),
    Key("ears", {str: _EAR}, "By name.", by_name("ears")),
    Key("virtual_test", (_IN_SITU, None), "With --virtual-test.", "in_situ"),
)
_DESIGN = JsonForm(
    "DesignNoiseJson",
    "Noise of one design; measures of sound are null where nothing radiates.",
    Key("kind", str),
    Key("run", str),
    OWN_COMPONENTS,
    Key(
        "third_octave",
        [_BAND],
        "Of the force of all stops.",
        lambda design: _bands(design.stops[0].bands, design.band_energy),
    ),
    *measured_keys(DESIGN_MEASURES),
    Key("stops", {str: _STOP}, "By stop.", by_name("stops", "stop")),
    Key("bodies", {str: _BODY}, "By body.", by_name("bodies")),
    Key(
        "mounts",
        {str: _MOUNTS},
        "The valve as a source at its mounts; empty without noise.mounts.",
        lambda design: {} if design.at_mounts is None else {"source": design.at_mounts},
    ),
    Key("machine", (_MACHINE, None), "Null without noise.receiver."),
)
_STUDY = JsonForm(
    "NoiseJson",
    "``klack noise``: numbers of the first design, and of all.",
    schema_key("klack-noise/1"),
    Key("case", str),
    *inherited(_DESIGN, "reference"),
    Key(
        "designs",
        {str: _DESIGN},
        "All designs by name.",
        by_name("designs"),
    ),
    Key("warnings", list[str]),
)


def _bands(bands: ThirdOctaves, energy: Floats) -> list[tuple[float, str, float]]:
    """Middle and nominal frequency [Hz], and level [dB], of each band."""
    return [
        (
            middle,
            nominal_label(int(number)),
            float(10.0 * np.log10(max(float(value), 1e-300) / ENERGY_REFERENCE)),
        )
        for number, middle, value in zip(bands.number, bands.middle, energy, strict=True)
    ]


def _levels(bands: ThirdOctaves, reference: float) -> list[float]:
    return list(bands.level_re(reference**2)) if np.any(bands.energy > 0.0) else []


def _told(study: NoiseStudy) -> Iterator[TextTable | str]:
    """Show the designs side by side, then how far each is from the first.

    Differences are levels; those of loudness and sharpness are factors.  dBA: A-weighted, dBZ:
    unweighted (IEC 61672-1).
    """
    first, *others = study.designs
    table = text_table(study.title, "design", DESIGN_MEASURES, ((d.name, d) for d in study.designs))
    yield replace(table, rows=(*table.rows, *(_difference_row(other, first) for other in others)))
    mounted = [design for design in study.designs if design.at_mounts is not None]
    if mounted:
        yield text_table(
            "Source at its mounts, exposure of one click to 20 kHz, re 1 nm/s and 1 uN",
            "freedom",
            MOUNT_MEASURES,
            (
                (f"{design.name} {item.name}" if len(mounted) > 1 else item.name, item)
                for design in mounted
                if design.at_mounts is not None
                for item in design.at_mounts.freedoms
            ),
        )
    for design in mounted:
        if design.machine is not None:
            whose = f"{design.name}: " if len(study.designs) > 1 else ""
            yield from _told_of_machine(design.machine, whose)


def _told_of_machine(found: InMachine, whose: str) -> Iterator[TextTable | str]:
    """Freedoms, ears and paths; what is zero is left out."""
    below = f"{found.receiver}{'; ' if found.elements else ''}{found.elements}"
    yield text_table(
        f"{whose}On {below}: {1e6 * found.energy:.4g} uJ of one click",
        "freedom",
        INTERFACE_MEASURES,
        ((item.name, item) for item in found.freedoms if item.force.any()),
    )
    if found.ears:
        yield text_table(
            f"{whose}Sound of one click at the ears, re 20 uPa",
            "ear",
            EAR_MEASURES,
            ((ear.name, ear) for ear in found.ears),
        )
        yield text_table(
            f"{whose}Paths to the ears",
            "path",
            PATH_MEASURES,
            (
                (f"{path.name} to {ear.name}", path)
                for ear in found.ears
                for path in ear.paths
                if path.exposure_A > 0.0
            ),
        )
    if found.in_situ is not None:
        yield text_table(
            f"{whose}Virtual test with {', '.join(found.in_situ.indicators)}: largest deviation "
            f"{found.in_situ.deviation:.1g}, condition {found.in_situ.condition:.2g}",
            "freedom",
            IN_SITU_MEASURES,
            ((item.name, item) for item in found.in_situ.freedoms),
        )


def _measured(study: NoiseStudy) -> Iterator[Measured]:
    for design in study.designs:
        yield design.name, design, DESIGN_MEASURES
        for stop in design.stops:
            yield f"{design.name}, {stop.stop}", stop, STOP_MEASURES
        for body in design.bodies:
            yield f"{design.name}, {body.name}", body, BODY_MEASURES
        for freedom in design.at_mounts.freedoms if design.at_mounts else ():
            yield f"{design.name}, {freedom.name}", freedom, MOUNT_MEASURES
        machine = design.machine
        for item in machine.freedoms if machine else ():
            yield f"{design.name}, {item.name} in the machine", item, INTERFACE_MEASURES
        for ear in machine.ears if machine else ():
            yield f"{design.name}, {ear.name}", ear, EAR_MEASURES
            for path in ear.paths:
                yield f"{design.name}, {path.name} to {ear.name}", path, PATH_MEASURES
        for found in machine.in_situ.freedoms if machine and machine.in_situ else ():
            yield f"{design.name}, {found.name} in situ", found, IN_SITU_MEASURES


def _difference_row(design: NoiseDesign, first: NoiseDesign) -> tuple[str, ...]:
    return (
        f"{design.name} - {first.name}",
        *(
            measure.apart(design, first) if measure.deviation else ""
            for measure in DESIGN_MEASURES
            if measure.column is not None
        ),
    )


NOISE = StoredAnalysis(
    form=RecordFormat(
        name="klack noise study",
        version=1,
        kind=NoiseStudy,
        command="klack noise",
        units={
            "frequency": "Hz",
            "level": "dB re 1 uN s",
            "net_share": "1",
            "middle": "Hz",
            "low": "Hz",
            "high": "Hz",
            "injected": "J",
            "mobility": "m/(N s), of rotations and moments 1/(N s), 1/(N m s)",
            "position": "m",
            "free_velocity": "m/s/Hz, of rotations 1/Hz",
            "blocked_force": "N/Hz, of moments N m/Hz",
            "area": "m^2",
            "radiated": "J",
            "upper_bound": "J",
            "points": "m",
            "velocity": "m/s",
            "time": "s",
            "loudness": "sone",
            "energy": "N^2 s, Pa^2 s of a sound, J into a machine",
            "force": "N/Hz on a machine, of moments N m/Hz",
            "exposure_A": "Pa^2 s",
            "element_loss": "J",
            "angle": "rad",
            "exposure": "Pa^2 s",
        },
    ),
    page="noise.content:noise_content",
    json=_STUDY.type,
    to_json=_STUDY.json,
    told=_told,
    measures={
        "design and its noise": DESIGN_MEASURES,
        "stop and its force": STOP_MEASURES,
        "body that vibrates": BODY_MEASURES,
        "degree of freedom of a mount": MOUNT_MEASURES,
        "degree of freedom between valve and machine": INTERFACE_MEASURES,
        "ear in a machine": EAR_MEASURES,
        "path to an ear": PATH_MEASURES,
        "degree of freedom of a virtual test": IN_SITU_MEASURES,
    },
    measured=_measured,
)
