"""Make the pictures of the README from a stored result: ``python docs/pictures.py RESULT``."""

import sys
from dataclasses import replace
from pathlib import Path

from klack.report.figures import force_chart
from klack.report.printed import svg_chart
from klack.report.section_figure import section_figure
from klack.workflow.store import load_study

IMAGES = Path(__file__).parent / "images"


def main(result: Path) -> None:
    """Write section.svg and force.svg."""
    study = load_study(result)
    # five times the force of all others would flatten them
    study = replace(study, levels={k: v for k, v in study.levels.items() if k != "lumped"})
    (IMAGES / "section.svg").write_bytes(section_figure(study).image)
    (IMAGES / "force.svg").write_bytes(svg_chart(force_chart(study)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
