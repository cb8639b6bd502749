#!/usr/bin/env bash
# CoolProp 8.0.0: density and speed of sound come without a word beyond the largest pressure and
# temperature of an equation of state.
#
# Guess: n-heptane at 3000 bar is an error, since pmax() of its equation is 1000 bar.
# Reality, 2026-11-29: 808 kg/m3 and 2198 m/s at 25 degC; PropsSI and AbstractState alike.  2000 K
# gives numbers as well, with a largest temperature of 600 K.
# Why it matters here: injectors reach 2500 bar, and the stiffness of the fluid is rho c^2.  klack ends
# its table of a fluid at pmax(), and takes no temperature above Tmax().
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check CoolProp==8.0.0 numpy==2.2.6
"$place/env/bin/python" - <<'PYTHON'
import CoolProp
from CoolProp.CoolProp import PropsSI

heptane = CoolProp.AbstractState("HEOS", "n-Heptane")
heptane.update(CoolProp.PT_INPUTS, 3000e5, 298.15)
rho, c = heptane.rhomass(), heptane.speed_sound()
print(f"CoolProp {CoolProp.__version__}: pmax {heptane.pmax() / 1e5:.0f} bar, Tmax {heptane.Tmax():.0f} K")
print(f"at 3000 bar: {rho:.1f} kg/m3, {c:.0f} m/s")
assert heptane.pmax() == 1000e5 and abs(rho - 808) < 1 and abs(c - 2198) < 2, (rho, c)
assert abs(PropsSI("D", "P", 3000e5, "T", 298.15, "n-Heptane") - rho) < 1e-6
heptane.update(CoolProp.PT_INPUTS, 1e5, 2000.0)
print(f"at 2000 K: {heptane.rhomass():.4f} kg/m3")
assert abs(heptane.rhomass() - 0.6025) < 1e-3 and heptane.Tmax() == 600.0, heptane.rhomass()
PYTHON
echo "as found: no limit of pressure or temperature"
