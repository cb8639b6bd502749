"""Equations as MathML, made while the site is built: nothing is fetched, no script runs.

The converter is the one that docutils brings (LaTeX to MathML Core).  An equation that it cannot
read is a warning with its place, and a built site has no warnings.
"""

import re
from html import unescape
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.typing import ExtensionMetadata
from sphinx.writers.html5 import HTML5Translator

__all__ = ["mathml", "setup"]

_SPACE = "http://www.w3.org/1998/Math/MathML"
ElementTree.register_namespace("", _SPACE)

_ENTITY = re.compile(r"&(?!amp;|lt;|gt;)\w+;")  # names of HTML, such as &ApplyFunction;

# what LaTeX allows and the converter does not know, in words that it knows
_SPELLINGS = (
    (re.compile(r"\\([dt]?frac)\s*(\d)\s*(\d)"), r"\\\1{\2}{\3}"),
    (re.compile(r"\\dots(?![a-z])"), r"\\ldots"),
    (re.compile("°C"), r"{}^\\circ\\mathrm{C}"),
    (re.compile(r"\\[bB]igg?(?=[()\[\]/|])"), ""),
)


def mathml(tex: str, *, block: bool) -> str:
    """Turn one LaTeX equation into a ``<math>`` element."""
    for spelling, known in _SPELLINGS:
        tex = spelling.sub(known, tex)
    text = _ENTITY.sub(lambda name: unescape(name[0]), tex2mathml(tex.strip(), as_block=block))
    tree = ElementTree.fromstring(text)
    for parent in list(tree.iter()):
        for place, child in enumerate(parent):
            parent[place] = _index_beside(child)
    return ElementTree.tostring(tree, encoding="unicode", short_empty_elements=False)


def _index_beside(element: ElementTree.Element) -> ElementTree.Element:
    r"""Put the index of an accented letter beside it: the converter sets ``\dot q_i`` below q."""
    if element.tag != _tag("munderover"):
        return element
    letter, index, accent = element
    if letter.tag == _tag("mo") or accent.tag != _tag("mo"):  # a sum with its limits
        return element
    over = ElementTree.Element(_tag("mover"), {"accent": "true"})
    over.extend([letter, accent])
    beside = ElementTree.Element(_tag("msub"))
    beside.extend([over, index])
    beside.tail = element.tail
    return beside


def _tag(name: str) -> str:
    return f"{{{_SPACE}}}{name}"


def setup(app: Sphinx) -> ExtensionMetadata:
    """Offer the renderer ``mathml``."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(writer: HTML5Translator, node: nodes.math) -> None:
    writer.body.append(_converted(node, block=False))
    raise nodes.SkipNode


def _block(writer: HTML5Translator, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="math">{_converted(node, block=True)}</div>\n')
    raise nodes.SkipNode


def _converted(node: nodes.math | nodes.math_block, *, block: bool) -> str:
    try:
        return mathml(node.astext(), block=block)
    except Exception as error:  # MathError, and what the converter trips over besides
        logging.getLogger(__name__).warning(
            "no MathML for %r: %r", node.astext(), error, location=node
        )
        return ""
