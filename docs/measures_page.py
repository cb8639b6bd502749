"""Write docs/reference/measures.md, what klack's numbers mean, from the catalogues of measures.

Run it in the folder of the project: ``python docs/measures_page.py``.
"""

from pathlib import Path

from klack.analyses.json_results import measures_catalogue

__all__ = ["page"]

_HEAD = """\
# Measures

<!-- written by docs/measures_page.py -->

The numbers that klack names, each described once: terminal tables, JSON, exported files, reports
and their glossaries take key, name, unit and definition from here. In Python,
`result.measures["reduced"]["peak_force"]` has value, unit and this description;
`klack schema --kind result` prints the catalogue under `x-measures`."""


def page() -> str:
    """Markdown of the whole page."""
    parts = [_HEAD]
    for of, measures in measures_catalogue().items():
        if not isinstance(measures, list):
            continue
        rows = ["| key in JSON | name | symbol | unit | definition |", "|---|---|---|---|---|"]
        for item in measures:
            symbol = f"`{item['symbol']}`" if item["symbol"] else ""
            unit = "-" if item["unit"] == "1" else item["unit"]
            link = f"[theory](../{item['source']}.md)"
            rows.append(
                f"| `{item['key']}` | {item['name']} | {symbol} | {unit} | {item['definition']} "
                f"({link}) |"
            )
        sources = "\n".join(rows)
        parts.append(f"## Of {'an' if of[0] in 'aeiou' else 'a'} {of}\n\n{sources}")
    return "\n\n".join(parts) + "\n"


def main() -> None:
    """Write the page."""
    path = Path(__file__).parent / "reference" / "measures.md"
    path.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
