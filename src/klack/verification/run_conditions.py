"""When, where and with what a set of checks ran."""

import os
import platform
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version

from klack import __version__
from klack.cores import available_cores
from klack.elasticity.factorization import available_backends

__all__ = ["RunConditions", "run_conditions"]

_LIBRARIES = ("numpy", "scipy", "numba")
_THREAD_LIMITS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunConditions:
    """All that can change the last digits of a check.

    Parameters
    ----------
    klack, python, numpy, scipy, numba : str
        Versions.
    date : str
        UTC, ISO 8601.
    platform : str
        Operating system and processor family.
    solvers : str
        Direct solvers that can be loaded; the first is used.
    threads : str
        Usable processor cores, and limits set in the environment.
    """

    klack: str
    date: str
    python: str
    numpy: str
    scipy: str
    numba: str
    platform: str
    solvers: str
    threads: str

    def words(self) -> dict[str, str]:
        """Name -> text, in the order of this class."""
        return asdict(self)


def run_conditions() -> RunConditions:
    """Conditions of this process: versions, platform and cores."""
    numpy, scipy, numba = (version(name) for name in _LIBRARIES)
    return RunConditions(
        klack=__version__,
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        python=platform.python_version(),
        numpy=numpy,
        scipy=scipy,
        numba=numba,
        platform=f"{platform.system()} {platform.machine()}",
        solvers=", ".join(available_backends()),
        threads=_threads(),
    )


def _threads() -> str:
    cores = available_cores()
    limits = [f"{name}={os.environ[name]}" for name in _THREAD_LIMITS if os.environ.get(name)]
    return ", ".join([f"{cores} core{'s' * (cores != 1)}", *limits])
