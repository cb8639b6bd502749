r"""Equations of docstrings as text for a terminal.

Made for the LaTeX that docstrings of components use; what it does not know stays as it is.
"""

import re

__all__ = ["plain_math"]

_WORDS = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "zeta": "ζ",
    "theta": "θ",
    "vartheta": "θ",
    "lambda": "λ",
    "Lambda": "Λ",
    "Theta": "Θ",
    "Delta": "Δ",
    "mu": "µ",
    "nu": "ν",
    "pi": "π",
    "rho": "ρ",
    "varrho": "ρ",
    "varepsilon": "ε",
    "varphi": "φ",
    "psi": "ψ",
    "omega": "ω",
    "sum": "Σ",
    "int": "∫",
    "partial": "∂",
    "infty": "∞",
    "pm": "±",
    "mp": "∓",
    "le": "≤",
    "ge": "≥",
    "ll": "≪",
    "cdot": "·",
    "quad": "  ",
    "qquad": "  ",
}
_DROPPED = re.compile(r"\\(?:Bigl|Bigr|bigl|bigr|left|right)(?![A-Za-z])")
_FUNCTIONS = "sinh|cosh|tanh|sin|cos|tan|exp|ln"
_GROUP = r"\{([^{}]*)\}"
_SIMPLE = re.compile(r"[A-Za-z0-9αβγζθλΛΘµνπρεφψωΔ∂.'_]+")


def plain_math(latex: str) -> str:
    r"""One line of text.

    >>> plain_math(r"F = \frac{\mu \pi d l}{c} (v_n - v_b), \qquad m \ddot y = \sum_p F_p")
    "F = (µ π d l)/c (v_n - v_b),  m y'' = Σ_p F_p"
    """
    text = _DROPPED.sub("", latex)
    text = re.sub(r"\\(?:,|;|!|:| )", " ", text)
    text = re.sub(r"\\(?:text|mathrm)\{([^{}]*)\}", r" \1", text)
    text = re.sub(r"\\mathrm\s*d", "d", text)
    text = re.sub(r"([_^]) (\w)", r"\1\2", text)
    text = re.sub(r"\\tfrac\s*(\d)\s*(\d)", r"\1/\2 ", text)
    text = re.sub(rf"\\({_FUNCTIONS})\s*(\\frac{_GROUP}{_GROUP})", r"\1(\2)", text)
    text = re.sub(rf"\\({_FUNCTIONS})(?=\\)", r"\1 ", text)
    text = re.sub(r"\\sqrt(?=\{)", r" \\sqrt", text)
    text = re.sub(r"\\([A-Za-z]+)", lambda found: _WORDS.get(found[1], found[0]), text)
    text = re.sub(r"([∂Δ]) (?=\w)", r"\1", text)
    text = re.sub(r"\\ddot\s*(\w)", r"\1''", text)
    text = re.sub(r"\\dot\s*(\w)", r"\1'", text)
    text = re.sub(r"\\bar\s*(\w)", r"mean \1", text)
    before = ""
    while before != text:  # from the inside outward
        before = text
        text = re.sub(rf"\\frac{_GROUP}{_GROUP}", _quotient, text)
        text = re.sub(rf"\\sqrt{_GROUP}", r"sqrt(\1)", text)
        text = re.sub(rf"([_^]){_GROUP}", _raised, text)
    text = re.sub(r"\\([A-Za-z]+)", r"\1", text)
    text = re.sub(r"\{([^{}]*)\}", r"\1", text)
    text = re.sub(r"(?<!,) {2,}", " ", text)
    return re.sub(r", {2,}", ",  ", text).strip()


def _quotient(found: re.Match[str]) -> str:
    return "/".join(part if _SIMPLE.fullmatch(part) else f"({part})" for part in found.groups())


def _raised(found: re.Match[str]) -> str:
    mark, part = found.groups()
    if mark == "_" or _SIMPLE.fullmatch(part):
        return f"{mark}{part.strip()}"
    return f"^({part})"
