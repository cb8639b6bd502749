"""Self-contained page: figures, plotly and texts in a single file.

Its content security policy forbids to load anything. Plotly is packed with gzip, which all browsers
since 2023 unpack (``DecompressionStream``): 2 instead of 5 MB in every report.
"""

import gzip
from base64 import b64encode
from functools import cache
from pathlib import Path
from zlib import ZLIB_RUNTIME_VERSION

from jinja2 import Environment, PackageLoader, StrictUndefined
from plotly.offline import get_plotlyjs, get_plotlyjs_version

from klack.files.whole import whole_file
from klack.machine.cache.entry import bytes_of_entry, entry_of_bytes
from klack.machine.cache.remember import remembered
from klack.machine.cache.result_cache import result_cache
from klack.report.interactive import figure_of
from klack.report.page import Content
from klack.report.spoken import spoken

__all__ = ["render_html", "write_report"]


def write_report(content: Content, path: Path) -> None:
    """Write the report as one HTML file for any browser, offline."""
    with whole_file(path) as new:
        new.write_bytes(render_html(content).encode())


def render_html(content: Content) -> str:
    """Lay the content out as a page."""
    environment = Environment(
        loader=PackageLoader("klack.report", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["figure"] = figure_of
    environment.filters["spoken"] = spoken
    environment.filters["base64"] = lambda data: b64encode(data).decode()
    template = environment.get_template("template.html")
    return template.render(content=content, plotly=_plotly())


@cache
def _plotly() -> dict[str, str]:
    version = get_plotlyjs_version()
    packed = remembered(
        result_cache(),
        "plotly",
        (version, ZLIB_RUNTIME_VERSION),
        lambda: gzip.compress(get_plotlyjs().encode(), mtime=0),
        pack=entry_of_bytes,
        unpack=bytes_of_entry,
    )
    return {"version": version, "packed": b64encode(packed).decode()}
