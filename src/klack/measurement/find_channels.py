"""Which channel of a recording is the lift, which the current.

Channels not named in the section ``measurement`` are found by their names in English and German
with their units, then by units alone. Names that differ only in numbers (``lift_01``, ``lift_02``,
...) are the strokes of a series.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from klack.errors import InputError, refuse_if
from klack.measurement.channels import ROLES, ChannelChoice, Role
from klack.measurement.recording import ChannelInfo, Recording, some_names
from klack.measurement.unit_text import no_unit, roles_of_unit, unit_factor

__all__ = ["FoundChannel", "find_channels"]

_WORDS: Mapping[Role, str] = {
    "velocity": r"velocity|speed|geschwindigkeit|schnelle|v(el)?|v_?needle|v_?nadel|v_?armature|"
    r"v_?anker",
    "acceleration": r"acc\w*|beschl\w*|vibration|körperschall|koerperschall|a_\w+",
    "lift": r"lift|\w*hub|weg|displacement|position|travel|stroke|x|x_?needle|x_?nadel|"
    r"x_?armature|x_?anker|s_?needle|s_?nadel",
    "current": r"current|\w*strom|ampere|i|i_?\w{1,10}",
    "voltage": r"voltage|\w*spannung|volt|u|u_?\w{1,10}",
    "pressure": r"pressure|\w*druck|p|p_?\w{1,10}",
    "force": r"force|\w*kraft|load|f|f_?\w{1,10}",
}
_SHORT = re.compile(r"[a-z](_\w+)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundChannel:
    """Known channel: SI value = ``factor * value + offset``.

    Parameters
    ----------
    unit
        In the file.
    factor [SI unit per unit of the file]
        With the scale of the section.
    offset [SI unit]
    note
        What was assumed; empty if the channel was named.
    """

    name: str
    unit: str
    factor: float
    offset: float = 0.0
    note: str = ""


def find_channels(
    recording: Recording,
    channels: Mapping[Role, ChannelChoice] | None = None,
    *,
    needed: Collection[Role] = (),
    roles: Collection[Role] = tuple(ROLES),
) -> list[dict[Role, FoundChannel]]:
    """Roles of the channels, one mapping for each stroke-record.

    Usually a single one; one per stroke if a role matches several channels. A role that matches
    one channel is shared by all. Rejects missing and ambiguous channels, units that do not fit,
    and series of different length.

    Parameters
    ----------
    channels
        By role, from the section ``measurement``; patterns may match several.
    needed
        What the recording must have.
    roles
        What is looked for; others are ignored, even if named.
    """
    named: dict[Role, Sequence[ChannelInfo]] = {
        role: _matching(recording, role, choice)
        for role, choice in (channels or {}).items()
        if role in roles
    }
    taken = {info.name for infos in named.values() for info in infos}
    free = [info for info in recording.channels if info.name not in taken]
    series: dict[Role, list[FoundChannel]] = {}
    for role in (role for role in ROLES if role in roles):
        if role in named:
            choice = (channels or {})[role]
            series[role] = [_as_named(recording, role, choice, info) for info in named[role]]
        elif infos := _guess(recording, role, free, role in needed or role == "lift"):
            note = _guess_note(recording, role, infos)
            series[role] = [_as_guessed(recording, role, info, note) for info in infos]
        elif role in needed:
            raise _not_found(recording, role)
    if not series:
        raise _not_found(recording, "lift")
    return _pair(recording, series)


def matches(pattern: str, text: str) -> bool:
    """Compare with ``*`` and ``?`` as only special signs.

    Examples
    --------
    >>> matches("lift_?? [um]", "lift_01 [um]"), matches("lift*", "current")
    (True, False)
    """
    parts = (".*" if c == "*" else "." if c == "?" else re.escape(c) for c in pattern)
    return re.fullmatch("".join(parts), text, re.DOTALL) is not None


def _matching(recording: Recording, role: Role, choice: ChannelChoice) -> list[ChannelInfo]:
    """Channels of a name or pattern, numbered ones too; the part after ``/`` is enough."""
    found = [info for info in recording.channels if matches(choice.name, info.name)]
    found = found or [
        info
        for info in recording.channels
        if matches(choice.name, info.label) or matches(choice.name, _last_part(info.name))
    ]
    refuse_if(
        not found,
        f"{recording.path.name}: measurement.channels.{role}",
        got=f"no channel '{choice.name}'",
        expected=f"one of: {some_names(recording.channels)}",
        hint="correct the name; * and ? are wildcards.",
    )
    numbered = {re.sub(r" #\d+$", "", info.name) for info in found} == {choice.name}
    if len(found) > 1 and not (numbered or re.search(r"[*?]", choice.name)):
        raise _ambiguous(recording, role, found)
    return found


def _last_part(name: str) -> str:
    """Name without group and without the number of a repeated name."""
    return re.sub(r" #\d+$", "", name.rsplit("/", 1)[-1])


def _as_named(
    recording: Recording, role: Role, choice: ChannelChoice, info: ChannelInfo
) -> FoundChannel:
    unit = info.unit if choice.unit is None else choice.unit
    if choice.unit is None:
        _require_known_scale(recording, role, info)
    where = f"{recording.path.name}: channel '{info.name}' ({role})"
    si = unit_factor(unit, role, where)
    return FoundChannel(
        name=info.name,
        unit=unit,
        factor=choice.scale * si.factor,
        offset=choice.scale * si.offset,
    )


def _guess_note(recording: Recording, role: Role, infos: Sequence[ChannelInfo]) -> str:
    """One sentence for a whole series."""
    first, last = infos[0], infos[-1]
    which = f"'{first.name}'" if first is last else f"{len(infos)} channels, '{first.name}' to "
    which += "" if first is last else f"'{last.name}'"
    return f"{recording.path.name}: {which} [{first.unit}] taken as {role}."


def _as_guessed(recording: Recording, role: Role, info: ChannelInfo, note: str) -> FoundChannel:
    where = f"{recording.path.name}: channel '{info.name}' ({role})"
    _require_known_scale(recording, role, info)
    si = unit_factor(info.unit, role, where)
    return FoundChannel(
        name=info.name, unit=info.unit, factor=si.factor, offset=si.offset, note=note
    )


def _require_known_scale(recording: Recording, role: Role, info: ChannelInfo) -> None:
    """Reject numbers beside which the file states an unknown scale."""
    if not info.unapplied:
        return
    unit = info.unit if role in roles_of_unit(info.unit) else ROLES[role].common[0]
    choice = f"{{name: {_as_yaml(info.name)}, unit: {unit}, scale: 1}}"
    raise InputError(
        f"{recording.path.name}: channel '{info.name}' ({role})",
        got=f"a scale that klack does not know: {info.unapplied}",
        expected="values in the unit of the channel, or packed by scale_factor and add_offset",
        hint=f"state in the case what the stored numbers are, with the {unit} per stored 1 as "
        f"scale: measurement: {{channels: {{{role}: {choice}}}}}.",
    )


def _guess(
    recording: Recording, role: Role, free: Sequence[ChannelInfo], must: bool
) -> Sequence[ChannelInfo]:
    """Channels by name and unit; none if several and none is a must."""
    by_name = [info for info in free if _named_like(role, info)]
    by_unit = [info for info in free if roles_of_unit(info.unit) == (role,)]
    others = [info for info in by_unit if not any(_named_like(r, info) for r in ROLES if r != role)]
    found = by_name or others
    if len(found) > 1:
        whole = [info for info in found if _last_part(info.name).lower() == role]
        found = whole if len(whole) == 1 else found
    if len(found) > 1 and len({re.sub(r"\d+", "#", info.name) for info in found}) > 1:
        if must:
            raise _ambiguous(recording, role, found)
        return ()
    return found


def _named_like(role: Role, info: ChannelInfo) -> bool:
    """True if the name means this role and the unit does not contradict."""
    name = re.sub(r"[\s.\-]+", "_", _last_part(info.name).strip().lower())
    if no_unit(info.unit):
        if _SHORT.fullmatch(name):
            return False  # a letter without a unit says nothing
    elif role not in roles_of_unit(info.unit):
        return False
    word = rf"(\w*_)?({_WORDS[role]})(_?\d+)?(_\w*)?"
    return re.fullmatch(word, name) is not None


def _pair(
    recording: Recording, series: Mapping[Role, Sequence[FoundChannel]]
) -> list[dict[Role, FoundChannel]]:
    """One dict per stroke from series; single channels are shared."""
    count = max(len(found) for found in series.values())
    for role, found in series.items():
        if len(found) not in (1, count):
            longest = next(r for r, f in series.items() if len(f) == count)
            raise InputError(
                f"{recording.path.name}: channels",
                got=f"{count} channels of {longest} and {len(found)} of {role}",
                expected=f"one of {role} for all, or {count}",
                hint="choose with patterns in the section 'measurement' of the case.",
            )
    return [
        {role: found[k if len(found) > 1 else 0] for role, found in series.items()}
        for k in range(count)
    ]


def _as_yaml(name: str) -> str:
    """Name as in a case file: numbers and odd signs in quotes."""
    if re.fullmatch(r"[^\W\d][\w ./-]*", name):
        return name
    quoted = name.replace("'", "''")
    return f"'{quoted}'"


def _ambiguous(recording: Recording, role: Role, infos: Sequence[ChannelInfo]) -> InputError:
    candidates, choice = some_names(tuple(infos)), _as_yaml(infos[0].name)
    return InputError(
        f"{recording.path.name}: channels",
        got=f"several that could be the {role}: {candidates}",
        expected=f"one channel of {role}, or a series whose names differ only in a number",
        hint=f"name it in the case: measurement: {{channels: {{{role}: {choice}}}}}.",
    )


def _candidate(recording: Recording, role: Role) -> ChannelInfo:
    """Channel that an error proposes: by name, volts of a sensor, or the first unknown."""
    word = re.compile(rf"(\w*_)?({_WORDS[role]})(_?\d+)?(_\w*)?", re.IGNORECASE)
    infos = recording.channels
    named = [info for info in infos if word.fullmatch(_last_part(info.name))]
    volts = [info for info in infos if roles_of_unit(info.unit) == ("voltage",)]
    unknown = [info for info in infos if not roles_of_unit(info.unit)]
    return (*named, *volts, *unknown, *infos)[0]


def _not_found(recording: Recording, role: Role) -> InputError:
    listed = [
        f"{info.name} [{info.unit}]" if info.unit else info.name for info in recording.channels[:12]
    ]
    first, unit = _candidate(recording, role), ROLES[role].common[0]
    unit = "um" if role == "lift" else unit
    name = _as_yaml(first.name)
    choice, meaning = f"{{name: {name}, unit: {unit}}}", ""
    if not no_unit(first.unit):
        choice = f"{{name: {name}, unit: {unit}, scale: 1}}"
        meaning = f", with the {unit} per {first.unit} as scale"
    return InputError(
        f"{recording.path.name}: channels",
        got=f"none that could be the {role}: {', '.join(listed)}",
        expected=f"a channel of {ROLES[role].name} called '{role}' or the like",
        hint=f"name it in the case: measurement: {{channels: {{{role}: {choice}}}}}{meaning}.",
    )
