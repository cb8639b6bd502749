"""The process that an imported FMU lives in: ``python -I -S fmu_child.py PARENT``.

Foreign code, which already loading the library of an FMU runs, stays in here: a crash, an ``exit``
or an endless loop ends or blocks this process and not klack.  Requests come through the standard
input, answers go to the standard output; output of the FMU itself is dropped.

Only the standard library is imported, so that the process starts in some hundredths of a second.
The functions of FMI are called by ctypes.

Source: Functional Mock-up Interface 2.0.4, sections 2.1 and 4.2; 3.0.1, sections 2.3 and 4.2.
"""

import ctypes
import json
import os
import signal
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from ctypes import c_bool, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from struct import Struct
from typing import Any

__all__ = ["ADVANCE", "ANSWER", "FORCE", "RUN", "Fmi2", "Fmi3", "Instance", "request"]

ANSWER = Struct("<BdI")
"""0 for success, output in the unit of the FMU, length of the text that follows."""
FORCE, RUN, ADVANCE = 1, 2, 3
"""Output in the initialisation; end of the initialisation; a step and the output after it."""

_C = ctypes.CDLL(None) if os.name == "posix" else ctypes.CDLL("msvcrt")
_STATUS = ("OK", "warning", "discard", "error", "fatal", "pending")
_WARNING = 1  # the worst status with which an FMU goes on
_LONGEST = 2000  # characters of what an FMU says
_DIES_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux
_LOOK = 0.5  # [s] between two looks for the parent where the system does not tell

_Logger2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
_Allocate = ctypes.CFUNCTYPE(c_void_p, c_size_t, c_size_t)
_Free = ctypes.CFUNCTYPE(None, c_void_p)
_Finished = ctypes.CFUNCTYPE(None, c_void_p, c_int)
_Logger3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


def request(inputs: int) -> Struct:
    """What to do, time and step [s], and so many inputs in the units of the FMU."""
    return Struct(f"<B{2 + inputs}d")


class _Callbacks2(ctypes.Structure):
    _fields_ = (
        ("logger", _Logger2),
        ("allocateMemory", _Allocate),
        ("freeMemory", _Free),
        ("stepFinished", _Finished),
        ("componentEnvironment", c_void_p),
    )


class Instance(ABC):
    """One instance of an FMU with some inputs, mostly a motion, and one output, mostly a force.

    ``library`` is the path of its shared library, which is loaded here.
    """

    version: int
    real: str

    def __init__(self, library: str) -> None:
        self.said = ""
        self._library = ctypes.CDLL(library)
        self._instance = c_void_p()

    def begin(self, given: Mapping[str, Any]) -> None:
        """Make the instance, set its parameters and enter its initialisation.

        Parameters
        ----------
        given
            ``token``; ``resources``: a folder; ``parameters``: lists of value reference, kind and
            value; ``inputs``: value references, or None for an input that is not joined;
            ``force``: value reference of the output.
        """
        made = self._made(str(given["token"]).encode(), Path(given["resources"]))
        if not made:
            raise RuntimeError("no instance was made")
        self._instance = c_void_p(made)
        for reference, kind, value in given["parameters"]:
            word, form = self._kind(kind)
            number = (form * 1)(value if kind == "real" else int(value))
            self._access(f"Set{word}", (c_uint * 1)(reference), number)()
        joined = [(k, item) for k, item in enumerate(given["inputs"]) if item is not None]
        self._joined = [k for k, _ in joined]
        self._motion, self._force = (c_double * len(joined))(), (c_double * 1)()
        references = (c_uint * len(joined))(*(item for _, item in joined))
        self._write = self._access(f"Set{self.real}", references, self._motion)
        self._read = self._access(f"Get{self.real}", (c_uint * 1)(given["force"]), self._force)
        self._prepare_steps()
        self._initialise()

    def force(self, *motion: float) -> float:
        """Force at displacement and velocity, all in the units of the FMU."""
        for place, k in enumerate(self._joined):
            self._motion[place] = motion[k]
        self._write()
        self._read()
        return self._force[0]

    def run(self) -> None:
        """End the initialisation."""
        self._call("ExitInitializationMode", [c_void_p], self._instance)

    def advance(self, time: float, step: float, *motion: float) -> float:
        """Force after a step [s] with that displacement and velocity."""
        for place, k in enumerate(self._joined):
            self._motion[place] = motion[k]
        self._write()
        self._step(time, step)
        self._read()
        return self._force[0]

    def free(self) -> None:
        """Let the FMU clean up."""
        self._function("FreeInstance", [c_void_p], None)(self._instance)

    # --------------------------------------------------------------------- of one version

    @abstractmethod
    def _made(self, token: bytes, resources: Path) -> int | None: ...

    @abstractmethod
    def _kind(self, kind: str) -> tuple[str, Any]:
        """Word in the names of functions, and type of C."""

    @abstractmethod
    def _sizes(self, count: int) -> tuple[c_size_t, ...]:
        """Arguments after the values in an access to variables."""

    @abstractmethod
    def _initialise(self) -> None: ...

    @abstractmethod
    def _prepare_steps(self) -> None: ...

    @abstractmethod
    def _step(self, time: float, step: float) -> None: ...

    # --------------------------------------------------------------------- calls

    def _function(self, name: str, kinds: Sequence[Any], result: Any = c_int) -> Any:
        function = self._library[f"fmi{self.version}{name}"]
        function.argtypes, function.restype = kinds, result
        return function

    def _call(self, name: str, kinds: Sequence[Any], *values: Any) -> None:
        self._check(name, self._function(name, kinds)(*values))

    def _access(self, name: str, references: Any, values: Any) -> Any:
        """Access to variables, with everything ready."""
        sizes = self._sizes(len(values))
        kinds = [c_void_p, c_void_p, c_size_t, c_void_p, *(c_size_t for _ in sizes)]
        function = self._function(name, kinds)
        arguments = (self._instance, references, len(references), values, *sizes)

        def access() -> None:
            self._check(name, function(*arguments))

        return access

    def _check(self, what: str, status: int) -> None:
        if not 0 <= status <= _WARNING:
            word = _STATUS[status] if 0 <= status < len(_STATUS) else "unknown"
            raise RuntimeError(f"fmi{self.version}{what} gave the status {status}, {word}")

    def _keep(self, text: bytes | None) -> None:
        self.said = (text or b"")[:_LONGEST].decode(errors="replace")


class Fmi2(Instance):
    """An instance of FMI 2.0."""

    version, real = 2, "Real"

    def _made(self, token: bytes, resources: Path) -> int | None:
        self._callbacks = _Callbacks2(
            _Logger2(lambda _, __, ___, ____, text: self._keep(text)),
            ctypes.cast(_C.calloc, _Allocate),
            ctypes.cast(_C.free, _Free),
            _Finished(),
            None,
        )
        kinds = [c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int]
        make = self._function("Instantiate", kinds, c_void_p)
        place = resources.as_uri().encode()
        made: int | None
        made = make(b"klack", 1, token, place, ctypes.byref(self._callbacks), 0, 0)
        return made

    def _kind(self, kind: str) -> tuple[str, Any]:
        words = {"real": ("Real", c_double), "integer": ("Integer", c_int)}
        return words.get(kind, ("Boolean", c_int))

    def _sizes(self, count: int) -> tuple[c_size_t, ...]:
        return ()

    def _initialise(self) -> None:
        kinds = [c_void_p, c_int, c_double, c_double, c_int, c_double]
        self._call("SetupExperiment", kinds, self._instance, 0, 0.0, 0.0, 0, 0.0)
        self._call("EnterInitializationMode", [c_void_p], self._instance)

    def _prepare_steps(self) -> None:
        self._do_step = self._function("DoStep", [c_void_p, c_double, c_double, c_int])

    def _step(self, time: float, step: float) -> None:
        self._check("DoStep", self._do_step(self._instance, time, step, 1))


class Fmi3(Instance):
    """An instance of FMI 3.0."""

    version, real = 3, "Float64"

    def _made(self, token: bytes, resources: Path) -> int | None:
        self._logger = _Logger3(lambda _, __, ___, text: self._keep(text))
        flags = [c_bool] * 4  # visible, logging, events, early return
        kinds = [c_char_p, c_char_p, c_char_p, *flags, c_void_p, c_size_t, c_void_p]
        make = self._function("InstantiateCoSimulation", [*kinds, _Logger3, c_void_p], c_void_p)
        place = f"{resources}{os.sep}".encode()
        none = (False,) * len(flags)
        made: int | None
        made = make(b"klack", token, place, *none, None, 0, None, self._logger, None)
        return made

    def _kind(self, kind: str) -> tuple[str, Any]:
        words = {"real": ("Float64", c_double), "integer": ("Int32", c_int)}
        return words.get(kind, ("Boolean", c_bool))

    def _sizes(self, count: int) -> tuple[c_size_t, ...]:
        return (c_size_t(count),)

    def _initialise(self) -> None:
        kinds = [c_void_p, c_bool, c_double, c_double, c_bool, c_double]
        values = (self._instance, False, 0.0, 0.0, False, 0.0)
        self._call("EnterInitializationMode", kinds, *values)

    def _prepare_steps(self) -> None:
        kinds = [c_void_p, c_double, c_double, c_bool, c_void_p, c_void_p, c_void_p, c_void_p]
        self._do_step = self._function("DoStep", kinds)
        self._ends, self._reached = tuple(c_bool() for _ in range(3)), c_double()
        ends = (ctypes.byref(flag) for flag in self._ends)
        self._places = (*ends, ctypes.byref(self._reached))

    def _step(self, time: float, step: float) -> None:
        self._check("DoStep", self._do_step(self._instance, time, step, True, *self._places))
        _, ended, early = self._ends
        if ended.value or early.value:
            raise RuntimeError("it stopped before the end of the step")


# --------------------------------------------------------------------------- the process


def serve(reader: int, writer: int) -> None:
    """Answer requests until the other side closes."""

    def answer(failed: bool, *texts: str) -> None:
        words = "\0".join(texts).encode(errors="replace")[: 2 * _LONGEST]
        os.write(writer, ANSWER.pack(failed, 0.0, len(words)) + words)

    answer(False)  # here it is
    given = json.loads(_line(reader))
    fmu: Instance | None = None
    try:
        fmu = (Fmi2 if given["version"] == 2 else Fmi3)(given["library"])
        fmu.begin(given)
        answer(False)
        asked = request(len(given["inputs"]))
        while data := _whole(reader, asked.size):
            what, *numbers = asked.unpack(data)
            force = 0.0
            if what == ADVANCE:
                force = fmu.advance(*numbers)
            elif what == FORCE:
                force = fmu.force(*numbers[2:])
            else:
                fmu.run()
            os.write(writer, ANSWER.pack(0, force, 0))
    except Exception as error:  # whatever it is, it is of the FMU
        answer(True, str(error)[:_LONGEST], fmu.said if fmu is not None else "")
    if fmu is not None:
        fmu.free()


def _line(reader: int) -> bytes:
    data = b""
    while not data.endswith(b"\n"):
        data += os.read(reader, 65536) or b"\n"
    return data


def _whole(reader: int, size: int) -> bytes:
    """Read ``size`` bytes; none if the other side closed."""
    data = os.read(reader, size)
    while 0 < len(data) < size:
        more = os.read(reader, size - len(data))
        data = data + more if more else b""
    return data


def _die_with(parent: int) -> None:
    """End this process when its parent is gone, whatever the FMU does."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK)
        os._exit(1)

    if sys.platform == "linux" and _C.prctl(_DIES_WITH_PARENT, signal.SIGKILL, 0, 0, 0) == 0:
        if os.getppid() != parent:  # gone before the system was asked to tell
            os._exit(1)
    elif os.name == "posix":
        threading.Thread(target=watch, daemon=True).start()


def _private(number: int) -> int:
    """Keep a standard stream, and give the FMU nothing in its place."""
    kept = os.dup(number)
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, number)
    os.close(nothing)
    return kept


if __name__ == "__main__":
    _die_with(int(sys.argv[1]))
    serve(_private(0), _private(1))
