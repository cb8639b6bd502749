"""What computing processes tell the pages; light, since the server imports it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.input.problem import Key
from klack.units import format_in, format_si

__all__ = [
    "Answer",
    "CatalogueEntry",
    "Checked",
    "Curve",
    "FaceFacts",
    "Finding",
    "FormField",
    "Heard",
    "Hearing",
    "Judgement",
    "MeasureOffer",
    "NetworkPart",
    "NetworkPort",
    "NetworkView",
    "Number",
    "Opened",
    "PartFacts",
    "ResultCard",
    "Review",
    "Slider",
    "StudyChoice",
    "StudyOffer",
    "typed",
]

Floats = NDArray[np.float64]

_TYPED = {"µ": "u", "²": "^2", "³": "^3", "°C": "degC"}


def typed(words: str) -> str:
    """Words with units as the commands print them, whatever a report makes of them.

    >>> typed("45 µm, 3 mm², 20 °C")
    '45 um, 3 mm^2, 20 degC'
    """
    for drawn, written in _TYPED.items():
        words = words.replace(drawn, written)
    return words


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """A line of a chart."""

    name: str
    x: Floats
    y: Floats

    @classmethod
    def scaled(cls, name: str, x: Floats, y: Floats, x_scale: float, y_scale: float) -> "Curve":
        """A line in the units of the chart."""
        return cls(name=name, x=x_scale * x, y=y_scale * y)


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number beside the charts.

    ``difference`` is how a difference is given: ``"%"`` of the pinned one, ``"us"``, ``"dB"`` or
    ``"1"``.
    """

    key: str
    name: str
    unit: str
    value: float | None
    difference: str = "%"


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """Force, motion, bands and sound of one position.

    Parameters
    ----------
    force, lift
        Over time in us (impact) or ms (stroke); force in N, lift in um.
    bands [Hz]
        Middle frequencies.
    levels [dB]
        Of the force, re 1e-12 N^2 s.
    wav, ghost_wav
        Clicks now and of the pinned design, to one full scale; empty if nothing radiates.
    scale
        Full scale of both in words.
    ghost_level
        Of the pinned click at the same ear.
    ears
        Of the machine, by name; of a result with their clicks in ``ear_wavs``.
    doubts
        Shown at once.
    seconds
        That it took.
    run
        Level or variant of a result.
    inputs
        Of a result beside another one: keys of the case that differ, there and here.
    """

    force: tuple[Curve, ...]
    lift: tuple[Curve, ...]
    time_unit: str
    bands: Floats
    levels: Floats
    numbers: tuple[Number, ...]
    wav: bytes = b""
    ghost_wav: bytes = b""
    scale: str = ""
    ghost_level: tuple[Number, ...] = ()
    ears: tuple[str, ...] = ()
    ear_wavs: tuple[bytes, ...] = ()
    doubts: tuple[str, ...] = ()
    seconds: float = 0.0
    run: str = ""
    inputs: tuple[tuple[str, str, str], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """Whether the numbers can be relied on; follows once the sliders rest.

    ``grade`` is ``"good"``, ``"fair"``, ``"out"`` of range, or ``"none"`` without an estimate.
    """

    grade: str
    words: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Hearing:
    """Loudness now and of the pinned design, spectrogram and drive pattern; follows as a judgement.

    Parameters
    ----------
    spectrogram
        Time [ms], frequency [kHz], level [dB re 20 uPa].
    pattern_wav
        The click as often as the drive pattern of the case has it, to the full scale of the clicks.
    """

    number: Number
    pinned: Number
    spectrogram: tuple[Floats, Floats, Floats]
    pattern_wav: bytes


@dataclass(frozen=True, kw_only=True, eq=False)
class Heard:
    """Click of a point of a study beside that of the case as it is.

    Both sounds have one full scale, ``scale`` in words; levels are sound exposure levels [dB(A)].
    """

    point: int
    wav: bytes
    base_wav: bytes
    scale: str
    level: float
    base_level: float


@dataclass(frozen=True, kw_only=True)
class ResultCard:
    """A stored result in short.

    ``compares``: two of its kind can be compared; ``has_points``: it is a study, with a page of
    points.
    """

    command: str
    title: str
    case: str
    created: str
    numbers: tuple[Number, ...]
    doubts: tuple[str, ...]
    compares: bool
    has_points: bool = False


@dataclass(frozen=True)
class Slider:
    """One number of the case that moves, ``"motion.speed"``.

    Parameters
    ----------
    unit
        SI, of ``low``, ``high``, ``start`` and ``step``; empty for a pure number.
    needs_mesh
        Whether bodies depend on it, so that it does not move here.
    written
        What the case has there.
    own, size
        Unit in which the case has it, and its size in SI; empty for one of klack's choice.
    also
        Other places that have the same value always: a lift is the gap of a stop and of a coil.
    """

    key: str
    place: Key
    label: str
    unit: str
    low: float
    high: float
    start: float
    step: float
    needs_mesh: bool
    written: str
    own: str = ""
    size: float = 1.0
    also: tuple[Key, ...] = ()

    @property
    def places(self) -> tuple[Key, ...]:
        """Where the case has the value."""
        return (self.place, *self.also)

    def text(self, value: float) -> str:
        """Value with its unit, as people read it."""
        return format_in(value, self.own, self.size) if self.own else format_si(value, self.unit)

    def about(self, share: float) -> tuple[float, float]:
        """Ends of a range: this share of the value on both sides, of a temperature that of 100 K.

        A share of kelvin from absolute zero would be an arctic night to a summer in the desert.
        """
        by = share * (100.0 if self.unit == "K" else abs(self.start))
        return self.start - by, self.start + by


@dataclass(frozen=True, kw_only=True, eq=False)
class Opened:
    """A case that is ready to move.

    Parameters
    ----------
    kind
        ``"impact"`` or ``"stroke"``.
    run
        Level or variant.
    first
        At the values of the case, which is pinned.
    """

    title: str
    kind: str
    sliders: tuple[Slider, ...]
    run: str
    first: Answer


@dataclass(frozen=True, kw_only=True)
class MeasureOffer:
    """Measure for a study of a case; ``is_first`` if it is ticked at first."""

    name: str
    unit: str
    definition: str
    is_first: bool


@dataclass(frozen=True, kw_only=True)
class StudyOffer:
    """Contents for a new study of a case; ``designs`` with their purposes."""

    title: str
    kind: str
    parameters: tuple[Slider, ...]
    measures: tuple[MeasureOffer, ...]
    designs: Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class StudyChoice:
    """What was chosen of a :class:`StudyOffer`.

    ``ranges`` are lowest and highest values, with their units, by the key of the case;
    ``objectives`` are ``"minimise"`` or ``"maximise"``.
    """

    ranges: Mapping[str, tuple[str, str]]
    measures: tuple[str, ...]
    objectives: Mapping[str, str]
    design: str
    points: int


@dataclass(frozen=True, kw_only=True)
class FormField:
    """One key of the form.

    Parameters
    ----------
    written
        As the file has it; else empty.
    kind
        ``"a length"``, with an ``example``; empty for words and plain numbers.
    limits
        ``"> 0"``.
    choices
        Words of the schema; empty for any.
    default
        Value without the key.
    """

    key: str
    place: Key
    section: str
    label: str
    written: str
    kind: str = ""
    example: str = ""
    limits: str = ""
    choices: tuple[str, ...] = ()
    description: str = ""
    default: str = ""


@dataclass(frozen=True, kw_only=True)
class Checked:
    """What the checker says of a text: an ``error``, empty for a valid one.

    ``line`` and ``column`` of an error count from 1; 0 where it names none of this text.
    ``doubts`` of a valid one are notes with their lines.  ``kind`` is ``"impact"``, ``"stroke"``,
    ``"magnet"``, or ``"study"`` of a study in its own file, with the ``case`` that it names;
    ``has_objectives`` if its study has something to search for; ``has_sliders`` if its numbers can
    be moved live.
    """

    error: str = ""
    line: int = 0
    column: int = 0
    doubts: tuple[tuple[int, str], ...] = ()
    title: str = ""
    kind: str = ""
    fields: tuple[FormField, ...] = ()
    has_study: bool = False
    has_objectives: bool = False
    has_sliders: bool = False
    case: str = ""

    @property
    def ways(self) -> dict[str, str]:
        """Pages of a valid case beside its editor, by the words of their links."""
        if self.kind not in ("impact", "stroke"):
            return {}
        sliders = {"Sliders": "sliders"} if self.has_sliders else {}
        return {"Show": "show", **sliders, "New study": "new-study"}


@dataclass(frozen=True, kw_only=True)
class CatalogueEntry:
    """A component type that can be added; ``fields`` are its keys, those required are written."""

    group: str
    word: str
    meaning: str
    fields: tuple[FormField, ...]
    required: frozenset[str]


@dataclass(frozen=True, kw_only=True)
class NetworkPort:
    """A port of a component, and the ports and words that it is connected with."""

    name: str
    domain: str
    joined: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class NetworkPart:
    """A component of a text; one of an included part, ``is_included``, has no fields."""

    name: str
    type: str
    meaning: str
    fields: tuple[FormField, ...] = ()
    ports: tuple[NetworkPort, ...] = ()
    is_included: bool = False


@dataclass(frozen=True, kw_only=True)
class NetworkView:
    """The network of a text; ``svg`` is empty where it cannot be drawn."""

    svg: str = ""
    width: float = 0.0
    parts: tuple[NetworkPart, ...] = ()


@dataclass(frozen=True, kw_only=True)
class FaceFacts:
    """A face of a part, for a list; ``place`` is ``"bottom"``, ``"outside"``."""

    name: str
    words: str
    place: str = ""


@dataclass(frozen=True, kw_only=True)
class PartFacts:
    """What a STEP file or a drawing holds.

    ``words`` tell size, volume, solids; ``faces`` are those of the half section, or empty, and
    ``not_turned`` says why.
    """

    words: str
    faces: tuple[FaceFacts, ...]
    solid_faces: tuple[FaceFacts, ...]
    not_turned: str = ""


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """Faces that meet and the held one, each empty if unknown; ``words`` say why these or none.

    ``is_refused`` if the parts could not even be compared.
    """

    needle_contact: str = ""
    housing_contact: str = ""
    held: str = ""
    words: str = ""
    is_refused: bool = False


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What one check of a new valve found, graded ``"good"``, ``"doubt"`` or ``"error"``.

    ``what`` is its name, ``step`` that of the guide where it is changed; what is good has no
    ``advice``.
    """

    grade: str
    what: str
    words: str
    advice: str = ""
    step: int = 0


@dataclass(frozen=True, kw_only=True)
class Review:
    """Checks of a new valve, and its case file.

    Parameters
    ----------
    text
        Of the case; empty where there is an error.
    steps
        Bodies whose STEP files the case names, as ``needle.step`` beside it.
    """

    findings: tuple[Finding, ...]
    text: str = ""
    steps: tuple[str, ...] = ()
