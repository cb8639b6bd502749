"""When, where and with what a set of checks ran."""

import os
import platform
from datetime import UTC, datetime
from importlib.metadata import version

from klack import __version__
from klack.bodies.elasticity.factorization import available_backends
from klack.machine.cores import available_cores

__all__ = ["run_conditions"]

_LIBRARIES = ("numpy", "scipy", "numba")
_THREAD_LIMITS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def run_conditions() -> dict[str, str]:
    """All that can change the last digits of a check.

    ``solvers``: direct ones that can be loaded, the first is used; ``threads``: usable cores and
    limits of the environment.
    """
    numpy, scipy, numba = (version(name) for name in _LIBRARIES)
    return dict(
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
