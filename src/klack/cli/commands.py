"""All commands and their parser, which knows each by its function.

Nothing heavy is imported here or at the top of the command modules, so that ``--help`` is quick.
"""

from collections.abc import Callable, Mapping
from inspect import getdoc

from cyclopts import App

from klack import __version__
from klack.analyses.catalogue import commands
from klack.cli import app as browser_app
from klack.cli import cache, compare, demo, export, inspect, report, schema, show, verify, warm

__all__ = ["COMMANDS", "app"]

app = App(
    name="klack",
    help="Predict how a valve needle hits its end stops.",
    version=f"klack {__version__}",
    version_flags=["--version"],
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
COMMANDS: Mapping[Callable[..., int], str] = {
    demo.demo: "klack demo",
    **commands(),
    inspect.inspect: "klack inspect needle.step",
    show.show: "klack show demo-stroke --out valve.svg",
    report.report: "klack report klack-results/demo-stroke --out report",
    export.export: "klack export demo-valve-axisymmetric --to mat --out models",
    compare.compare: "klack compare klack-results/demo-stroke --measurement wet=strokes.csv",
    verify.verify: "klack verify --group contact",
    schema.schema: "klack schema --kind stroke --json valve.schema.json",
    cache.cache: "klack cache --clear",
    warm.warm: "klack warm",
    browser_app.app: "klack app my-valves",
}
"""Every command, with the example that its help shows."""

for _command, _example in COMMANDS.items():
    app.command(_command, help=f"{getdoc(_command)}\n\nExample: {_example}")
