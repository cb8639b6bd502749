"""The command ``klack``: its subcommands and their exit codes.

===== =================================================================================
code  meaning
===== =================================================================================
0     done
1     a check failed, or an iteration did not converge
2     bad input: one message that names file, line, key, what came, what was expected
70    internal error; the traceback is printed
130   stopped by Ctrl-C; nothing half written is left
143   stopped by SIGTERM; the same
===== =================================================================================
"""

import os
import sys
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from klack import __version__
from klack.cli.surroundings import (
    close_quietly,
    in_words,
    keep_bytecode,
    prepare_compiling,
    prepare_streams,
    require_present_folder,
    stop_code,
    terminable,
)
from klack.errors import (
    AccuracyWarning,
    CacheWarning,
    ConvergenceError,
    KlackError,
    LeftAloneWarning,
)
from klack.terminal.tables import printable

if TYPE_CHECKING:
    from cyclopts import CycloptsError

__all__ = ["main"]

EXIT_OK, EXIT_FAILED, EXIT_BAD_INPUT, EXIT_BUG = 0, 1, 2, 70


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    Parameters
    ----------
    argv
        Arguments after ``klack``; those of the process by default.
    """
    prepare_streams()
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments == ["--version"]:
        print(f"klack {__version__}")
        return EXIT_OK
    if argv is None:  # a process of klack's own
        keep_bytecode()
    name = " ".join(["klack", *(a for a in arguments[:1] if not a.startswith("-"))])
    try:
        with terminable():
            return _run(arguments, name)
    except ConvergenceError as error:
        return _complain(f"{name}: {error}", EXIT_FAILED)
    except KlackError as error:
        return _complain(f"{name}: {error}", EXIT_BAD_INPUT)
    except MemoryError:
        text = "the memory of this machine is exhausted.\nTry: larger elements, or fewer modes."
        return _complain(f"{name}: {text}", EXIT_BAD_INPUT)
    except KeyboardInterrupt as stop:
        kept = " ".join(getattr(stop, "__notes__", ())) or "no partial files are left."
        return _complain(f"{name}: stopped; {kept}", stop_code(stop))
    except BrokenPipeError:
        # the reader of our output went away (klack schema | head); python would complain at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
    except OSError as error:
        close_quietly()
        said = in_words(error)
        return _bug(name) if said is None else _complain(f"{name}: {said}", EXIT_BAD_INPUT)
    except Exception:  # a bug: show all of it, but keep the code apart from the others
        return _bug(name)


def _run(arguments: list[str], name: str) -> int:
    from cyclopts import CycloptsError

    from klack.cli.commands import parser

    def note(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if issubclass(category, (AccuracyWarning, CacheWarning, LeftAloneWarning)):
            print(printable(f"{name}: note: {message}"), file=sys.stderr)
        else:
            usual(message, category, *place, **more)

    with warnings.catch_warnings():
        usual, warnings.showwarning = warnings.showwarning, note
        if arguments and not arguments[0].startswith("-"):
            require_present_folder()
            if arguments[0] != "warm":  # which says itself that there is no folder
                prepare_compiling()
        try:
            code = parser(
                arguments, print_error=False, exit_on_error=False, result_action="return_value"
            )
        except CycloptsError as error:
            shown = name if name.removeprefix("klack").strip() in parser else "klack"
            return _complain(f"{name}: {_one_line(error)}\nTry: {shown} --help", EXIT_BAD_INPUT)
    sys.stdout.flush()
    return code if isinstance(code, int) else EXIT_OK


def _bug(name: str) -> int:
    import traceback

    traceback.print_exc()
    text = (
        "internal error, not caused by your input; please report the text above, with that of "
        "`klack about`."
    )
    return _complain(f"{name}: {text}", EXIT_BUG)


def _complain(text: str, code: int) -> int:
    print(printable(text), file=sys.stderr)
    return code


def _one_line(error: "CycloptsError") -> str:
    from cyclopts import UnusedCliTokensError

    if isinstance(error, UnusedCliTokensError):
        words = ", ".join(f"'{word}'" for word in error.unused_tokens or ())
        return f"got {words}, which belongs to no option, expected one value for each option."
    return " ".join(str(error).split())


if __name__ == "__main__":
    sys.exit(main())
