"""Former and present sound of the demo valve in third octaves: ``python docs/noise_estimates.py``.

Writes the table and the directivity of docs/theory/radiation.md. The valve of ``demo-mounted``
stands on its sheet of steel: its own surface by three ways, the sheet by two.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.integrate import simpson

import klack
from klack.acoustics.radiation import PLATE, piston_efficiency
from klack.acoustics.third_octave import nominal_label
from klack.analyses.noise.figures import own_sound_charts
from klack.analyses.noise.record import NoiseDesign, NoiseStudy
from klack.case.reader import find_case
from klack.report.printed import svg_chart

PAGE = Path(__file__).parent / "theory" / "radiation.md"
BEGIN, END = "<!-- made by docs/noise_estimates.py -->", "<!-- end -->"
PICTURE = Path(__file__).parent / "images" / "directivity.svg"
SQUARED = (20e-6) ** 2
FORMER = """noise:
  mounts:
    flange: {surface: [housing.rim, pole.rim]}
  reactions: {spring: pole.top, guide: housing.inside}
  surfaces: [housing.bottom, housing.outside, housing.top, pole.pole_face, pole.outside, pole.top]
  radiation: elements
  mount: {stiffness: 1000 N/um, loss_factor: 2 %}
  plate: {thickness: 1.5 mm, area: 0.2 m^2, material: steel, loss_factor: 2 %}
"""


def designs() -> tuple[NoiseStudy, NoiseDesign]:
    """The valve on the plate of the estimates, and in its machine."""
    text = find_case("demo-mounted").read_text(encoding="utf-8")
    with TemporaryDirectory() as folder:
        case = Path(folder) / "estimates.yaml"
        case.write_text(text[: text.index("noise:\n")] + FORMER, encoding="utf-8")
        former = klack.noise_of(klack.run_stroke(case)).record
        case.write_text(text, encoding="utf-8")
        return former, klack.noise_of(klack.run_stroke(case)).record.reference


def levels(former: NoiseDesign, machine: NoiseDesign) -> tuple[list[str], np.ndarray]:
    """Bands, and exposure levels [dB re (20 uPa)^2 s] at 1 m (k, 5)."""
    octaves, settings = former.stops[0].bands, former.settings
    f = octaves.middle
    unity, piston, plate = (np.zeros(f.size) for _ in range(3))
    for body in former.bodies:
        own = body.upper_bound.sum(axis=0)
        if PLATE in body.groups:
            on_plate = body.radiated[body.groups.index(PLATE)]
            own, plate = own - body.upper_bound[-1], plate + on_plate
        unity += own
        area = float(np.nansum(body.area))
        piston += own * piston_efficiency(f, area, settings.sound_speed)
    sound, found = former.own_sound, machine.machine
    assert sound is not None
    assert found is not None
    ear = found.ears[0].bands
    sine = np.sin(sound.angle)
    around = simpson(sound.exposure * sine, x=sound.angle, axis=1) / 2.0
    chosen = [n for n in range(sound.middle.size) if 95.0 < sound.middle[n] < 17e3]
    strength = settings.air_density * settings.sound_speed / (4.0 * np.pi * settings.distance**2)
    at_ear = np.interp(sound.middle, ear.middle, ear.energy)
    columns = [
        *(strength * energy[: sound.middle.size] for energy in (unity, piston)),
        around,
        strength * plate[: sound.middle.size],
        at_ear,
    ]
    names = [nominal_label(int(octaves.number[n])) for n in chosen]
    energy = np.array(columns).T[chosen]
    energy = np.vstack([energy, energy.sum(axis=0)])
    return names, 10.0 * np.log10(np.maximum(energy, 1e-30) / SQUARED)


def table(names: list[str], values: np.ndarray) -> str:
    """As the page has it."""
    rows = [
        "| band | own surface: efficiency 1 | piston | elements | sheet: estimate | modes |",
        "|---|---|---|---|---|---|",
    ]
    for name, row in zip([*names, "sum"], values, strict=True):
        rows.append(f"| {name} | " + " | ".join(f"{value:.1f}" for value in row) + " |")
    return "\n".join(rows)


def main() -> None:
    """Write the table and the picture."""
    study, machine = designs()
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    after = rest.partition(END)[2]
    made = table(*levels(study.reference, machine))
    PAGE.write_text(f"{before}{BEGIN}\n\n{made}\n\n{END}{after}", encoding="utf-8")
    PICTURE.write_bytes(svg_chart(own_sound_charts(study)[0]))


if __name__ == "__main__":
    main()
