"""Write machine_synthetic.csv: a SYNTHETIC machine, as hammer and microphone would measure it.

A wall of aluminium, 300 x 250 x 3 mm with 8 % of loss, and a driver 0.6 m before it. Struck along z
at node 101, where the valve stands; accelerometers at 101 and 102; 16 Hz to 10 kHz in steps of
4 Hz, with 0.5 % of noise. No real machine.
"""

import csv

import numpy as np

from klack.acoustics.interface import InterfacePoint, laplace
from klack.acoustics.plate import Plate
from klack.acoustics.receivers.plates import PlateSound, finite_plate
from klack.materials.material import Material

aluminium = Material(name="aluminium", young=70e9, poisson=0.33, density=2700.0)
wall = Plate(thickness=3e-3, area=0.075, material=aluminium, loss_factor=0.08)
nodes = [
    InterfacePoint(name="101", position=np.array([0.11, 0.1, 0.0])),
    InterfacePoint(name="102", position=np.array([0.16, 0.13, 0.0])),
]
driver = PlateSound(places={"9001": np.array([0.05, 0.1, 0.6])})
f = np.arange(16.0, 10001.0, 4.0)
answer = finite_plate(wall, (0.3, 0.25), nodes, highest=10e3, sound=driver).at(laplace(f))

columns = {"frequency [Hz]": [f"{value:g}" for value in f]}
draw = np.random.default_rng(1)
for name, unit, values in (
    ("101.z", "m/s^2/N", answer.mobility[:, 0, 0] * laplace(f)),
    ("102.z", "m/s^2/N", answer.mobility[:, 1, 0] * laplace(f)),
    ("9001", "Pa/N", answer.transfers[:, 0, 0]),
):
    noise = draw.normal(size=f.size) + 1j * draw.normal(size=f.size)
    measured = values + 0.005 * np.abs(values) * noise / np.sqrt(2.0)
    columns[f"{name}/101.z re [{unit}]"] = [f"{value:.4e}" for value in measured.real]
    columns[f"{name}/101.z im [{unit}]"] = [f"{value:.4e}" for value in measured.imag]

with open("machine_synthetic.csv", "w", newline="", encoding="utf-8") as file:
    file.write("# SYNTHETIC: see make_machine.py\n")
    writer = csv.writer(file)
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
print(f"machine_synthetic.csv: {f.size} lines, {len(columns) // 2} responses")
