"""Contact force and energies that CalculiX (ccx) printed into its ``.dat`` file.

Read are the resultant of ``*CONTACT PRINT ... CF``, the spring energy of ``*CONTACT PRINT ...
CELS`` and the totals of ``*EL PRINT ... ELSE, ELKE`` (internal and kinetic energy of a set); the
rest is ignored. If there, ``NAME.sta`` gives the number of iterations, ``NAME.log`` (terminal
output) the wall time.

Units mm, t, s, N, mJ are assumed.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.analyses.comparison.calculix import OtherRun
from klack.contact.history import BodyEnergy, EnergyLedger, ImpactHistory
from klack.errors import InputError, refuse_if
from klack.exchange.calculix_deck import LOWER, UPPER
from klack.input.section import instead_of_file

__all__ = ["CalculixResult", "other_run", "read_calculix"]

_MILLIJOULE = 1e-3
_LARGEST = 2_000_000_000  # bytes
_LONGEST_LINE = 400
_FORCE = re.compile(
    r" statistics for slave set (\S+), master set (\S+) and time +(\S+)$", re.IGNORECASE
)
_CONTACT = re.compile(r" total contact spring energy for time +(\S+)$", re.IGNORECASE)
_ENERGY = re.compile(
    r" total (internal|kinetic) energy for set (\S+) and time +(\S+)$", re.IGNORECASE
)
_WALL = re.compile(r"Total CalculiX Time: *(\d+(?:\.\d*)?)")
_SAME_TIME = 1e-6  # ccx prints seven digits
_SAME_ENERGY = 2e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class CalculixResult:
    """Output of ccx, one entry per increment; SI.

    Parameters
    ----------
    time (n,) [s]
        Ends of increments.
    force (n,) [N]
        Axial, pressing the bodies apart above zero.
    sideways (n,) [N]
        Normal to the axis.
    contact_energy (n,) [J] or empty
        In the penalty.
    internal, kinetic : mapping of set name to array, shape (n,) [J]
        Strain and kinetic energy of the element sets that were printed.
    iterations
        Total.
    wall_time [s]
    """

    source: str
    time: NDArray[np.float64]
    force: NDArray[np.float64]
    sideways: NDArray[np.float64]
    contact_energy: NDArray[np.float64]
    internal: Mapping[str, NDArray[np.float64]]
    kinetic: Mapping[str, NDArray[np.float64]]
    iterations: int | None = None
    wall_time: float | None = None

    @property
    def total_energy(self) -> NDArray[np.float64]:
        """Kinetic, strain and contact energy of both bodies, shape (n,) [J].

        Empty if the run did not print all of them.
        """
        sets = (self.kinetic, self.internal)
        if not (len(self.contact_energy) and all({UPPER, LOWER} <= set(part) for part in sets)):
            return np.zeros(0)
        parts = [part[role] for part in sets for role in (UPPER, LOWER)]
        return np.asarray(np.sum([*parts, self.contact_energy], axis=0))

    @property
    def impulse(self) -> NDArray[np.float64]:
        """Impulse to each time, shape (n,) [N s], by the trapezoidal rule, as ccx integrates."""
        time, force = np.append(0.0, self.time), np.append(0.0, self.force)
        return np.cumsum(np.diff(time) * (force[1:] + force[:-1]) / 2.0)


@dataclass
class _Table:
    """One printed quantity over time."""

    time: list[float] = field(default_factory=list)
    value: list[float] = field(default_factory=list)

    def add(self, time: float, value: float) -> None:
        self.time.append(time)
        self.value.append(value)


@dataclass
class _Tables:
    """Everything found in a file."""

    force: dict[tuple[str, str], tuple[_Table, _Table]] = field(default_factory=dict)
    contact: _Table = field(default_factory=_Table)
    energy: dict[tuple[str, str], _Table] = field(default_factory=dict)


def read_calculix(path: Path) -> CalculixResult:
    """Read the ``.dat`` file of a run, with the contact force of one pair."""
    path = Path(path)
    _require_file(path)
    tables = _Tables()
    try:
        with path.open(encoding="ascii") as stream:
            _read(path, stream, tables)
    except UnicodeDecodeError as error:
        raise _refuse(path, "bytes that are not text", "the .dat file of a run of CalculiX") from (
            error
        )
    time, axial, sideways = _force(path, tables)
    energies = {
        kind: {
            name: _series(path, f"{kind} energy of {name}", table, time) * _MILLIJOULE
            for (which, name), table in tables.energy.items()
            if which == kind
        }
        for kind in ("internal", "kinetic")
    }
    contact = np.zeros(0)
    if tables.contact.time:
        contact = _series(path, "contact energy", tables.contact, time) * _MILLIJOULE
    return CalculixResult(
        source=str(path),
        time=time,
        force=axial if np.sum(axial) >= 0.0 else -axial,
        sideways=sideways,
        contact_energy=contact,
        internal=energies["internal"],
        kinetic=energies["kinetic"],
        iterations=_iterations(path.with_suffix(".sta")),
        wall_time=_wall_time(path.with_suffix(".log")),
    )


def _require_file(path: Path) -> None:
    if got := instead_of_file(path):
        raise _refuse(path, got, "the .dat file of a run of CalculiX")
    size = path.stat().st_size
    if size > _LARGEST:
        raise _refuse(path, f"{size / 1e9:.1f} GB", f"at most {_LARGEST / 1e9:.0f} GB of totals")


def _refuse(path: Path, got: str, expected: str, hint: str = "") -> InputError:
    return InputError(
        str(path),
        got=got,
        expected=expected,
        hint=hint or "run the deck written by `klack export CASE --to calculix`.",
    )


def _read(path: Path, stream: Iterator[str], tables: _Tables) -> None:
    """Collect tables: heading, empty line, numbers."""
    for line in stream:
        if len(line) > _LONGEST_LINE:
            raise _refuse(path, f"a line of {len(line)} characters", "a .dat file of CalculiX")
        line = line.rstrip()
        if not line.startswith((" total", " statistics")):
            continue
        if match := _FORCE.match(line):
            _skip_to(path, stream, "total surface force")
            pair, time = (match[1], match[2]), _number(path, match[3])
            x, y, z, *_ = _numbers(path, stream, 6)
            axial, sideways = tables.force.setdefault(pair, (_Table(), _Table()))
            axial.add(time, z)
            sideways.add(time, float(np.hypot(x, y)))
        elif match := _CONTACT.match(line):
            tables.contact.add(_number(path, match[1]), _numbers(path, stream, 1)[0])
        elif match := _ENERGY.match(line):
            table = tables.energy.setdefault((match[1].lower(), match[2].upper()), _Table())
            table.add(_number(path, match[3]), _numbers(path, stream, 1)[0])


def _skip_to(path: Path, stream: Iterator[str], words: str) -> None:
    for _ in range(4):
        if words in next(stream, ""):
            return
    raise _cut(path)


def _numbers(path: Path, stream: Iterator[str], count: int) -> list[float]:
    """Return the numbers of the next line that is not empty."""
    for _ in range(3):
        words = next(stream, "").split()
        if words:
            break
    if len(words) != count:
        raise _cut(path)
    return [_number(path, word) for word in words]


def _number(path: Path, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise _refuse(path, f"'{word[:40]}' instead of a number", "numbers") from None
    if not np.isfinite(value):
        hint = "the run diverged: use a shorter step, or a smaller penalty."
        raise _refuse(path, f"'{word[:40]}'", "finite forces and energies", hint)
    return value


def _cut(path: Path) -> InputError:
    hint = "let the run finish, or copy the file again."
    return _refuse(path, "a truncated table", "complete tables", hint)


def _force(
    path: Path, tables: _Tables
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    if len(tables.force) != 1:
        pairs = ", ".join(f"{slave} on {master}" for slave, master in tables.force)
        raise _refuse(
            path,
            f"the forces of {len(tables.force)} pairs ({pairs})" if pairs else "no contact force",
            "the force of one contact pair",
            "print *CONTACT PRINT, SLAVE=..., MASTER=... with CF of one pair in every increment.",
        )
    axial, sideways = next(iter(tables.force.values()))
    time = np.array(axial.time)
    if not (time[0] > 0 and np.all(np.diff(time) > 0)):
        raise _refuse(path, "times that do not increase", "one step of one run")
    if len(time) < 4:
        raise _refuse(path, f"{len(time)} increments", "a whole impact")
    return time, np.array(axial.value), np.array(sideways.value)


def _series(path: Path, name: str, table: _Table, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values at the times of the contact force."""
    own = np.array(table.time)
    if len(own) != len(time) or np.any(np.abs(own - time) > _SAME_TIME * time[-1]):
        raise _refuse(
            path,
            f"{len(own)} entries of the {name}, {len(time)} of the contact force",
            "all of them at the same times",
            "print every quantity in every increment, and let the run finish.",
        )
    return np.array(table.value)


def _iterations(path: Path) -> int | None:
    """Sum of the fourth column of the status file, if any."""
    if not path.is_file() or path.stat().st_size > _LARGEST:
        return None
    total = 0
    with path.open(encoding="ascii", errors="replace") as stream:
        for line in stream:
            words = line.split()
            if len(words) == 7 and words[3].isdecimal():
                total += int(words[3])
    return total or None


def _wall_time(path: Path) -> float | None:
    """Time in the last lines of the terminal output, if any."""
    if not path.is_file():
        return None
    with path.open("rb") as stream:
        stream.seek(max(0, path.stat().st_size - 4096))
        found = _WALL.findall(stream.read().decode("ascii", "replace"))
    return float(found[-1]) if found else None


def other_run(result: CalculixResult, reference: ImpactHistory) -> OtherRun:
    """Impact of ccx in the form in which klack compares.

    Rejects another kinetic energy at the start: the file is of another case, or in other units.

    Parameters
    ----------
    reference
        For masses, names, speed and outside force.
    """
    motion = _motion(result, reference)
    return OtherRun(
        program="CalculiX",
        history=_history(result, reference, motion),
        energy_swing=_swing(result, motion),
        steps=len(result.time),
        iterations=result.iterations,
        wall_time=result.wall_time,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Motion:
    """Momentum balance of the upper body.

    Parameters
    ----------
    force [N]
        From outside, along +z.
    velocity (n,) [m/s]
        Of the centre of mass.
    work (n,) [J]
        Of the outside force.
    """

    force: float
    velocity: NDArray[np.float64]
    work: NDArray[np.float64]


def _motion(result: CalculixResult, reference: ImpactHistory) -> _Motion:
    force = float(reference.external_force[0])
    speed = _flight_speed(result, reference, force)
    time, mass = result.time, reference.mass_a
    gained = result.impulse - result.impulse[0] + force * (time - time[0])
    velocity = gained / mass - speed
    way = np.cumsum(np.diff(time) * (velocity[1:] + velocity[:-1]) / 2.0)
    return _Motion(force=force, velocity=velocity, work=force * np.append(0.0, way))


def _flight_speed(result: CalculixResult, reference: ImpactHistory, force: float) -> float:
    """Speed at the first time [m/s], in flight without strain."""
    if UPPER not in result.kinetic:
        return reference.speed
    start, expected = float(result.kinetic[UPPER][0]), 0.5 * reference.mass_a * reference.speed**2
    # a force changes the speed a little on the way to the first record
    allowed = _SAME_ENERGY * expected + abs(force) * reference.speed * 4.0 * result.time[0]
    refuse_if(
        not abs(start - expected) <= allowed,
        result.source,
        got=f"a kinetic energy of {start:.5g} J of set {UPPER} at the start",
        expected=f"{expected:.5g} J: {reference.mass_a * 1e3:.5g} g at {reference.speed:g} m/s",
        hint="compare with the result of the same case on the same mesh; the units of the "
        "deck are mm, t, s.",
    )
    return float(np.sqrt(2.0 * start / reference.mass_a))


def _history(result: CalculixResult, reference: ImpactHistory, motion: _Motion) -> ImpactHistory:
    """Records of the median length, keeping the impulse; the gap is unknown."""
    step = float(np.median(np.diff(result.time, prepend=0.0)))
    count = int(np.floor(result.time[-1] / step * (1.0 + 1e-6)))
    edges = np.arange(count + 1) * step
    time = np.append(0.0, result.time)
    gathered = np.interp(edges, time, np.append(0.0, result.impulse))
    start = motion.velocity[0] - motion.force / reference.mass_a * result.time[0]
    return ImpactHistory(
        step=step,
        force=np.diff(gathered) / step,
        gap=np.full(count, np.nan),
        velocity_a=start + (gathered + motion.force * edges) / reference.mass_a,
        velocity_b=-gathered / reference.mass_b,
        speed=reference.speed,
        mass_a=reference.mass_a,
        mass_b=reference.mass_b,
        ledger=_ledger(result, reference, motion),
        external_force=np.full(count, motion.force),
        longest_period=reference.longest_period,
        solver="CalculiX",
    )


def _ledger(result: CalculixResult, reference: ImpactHistory, motion: _Motion) -> EnergyLedger:
    """Energies at the end; empty where not all printed.

    ccx prints no work of friction: with friction the balance is unknown.
    """
    if not len(result.total_energy) or reference.ledger.friction:
        return EnergyLedger(initial=0.0, bodies=())
    bodies = []
    end = (float(motion.velocity[-1]), -float(result.impulse[-1]) / reference.mass_b)
    masses = (reference.mass_a, reference.mass_b)
    names = [body.name for body in reference.ledger.bodies]
    for i, role in enumerate((UPPER, LOWER)):
        strain, kinetic = float(result.internal[role][-1]), float(result.kinetic[role][-1])
        translation = 0.5 * masses[i] * end[i] ** 2 if np.isfinite(masses[i]) else 0.0
        bodies.append(
            BodyEnergy(
                name=names[i] if i < len(names) else role,
                translation=translation,
                vibration=kinetic + strain - translation,
                strain=strain,
            )
        )
    return EnergyLedger(
        initial=float(result.total_energy[0]),
        bodies=tuple(bodies),
        contact=float(result.contact_energy[-1]),
        work=float(motion.work[-1]),
    )


def _swing(result: CalculixResult, motion: _Motion) -> float | None:
    """Largest deviation from the energy balance, over the initial energy."""
    total = result.total_energy
    if not len(total):
        return None
    return float(np.max(np.abs(total - total[0] - motion.work)) / total[0])
