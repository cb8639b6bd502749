#!/usr/bin/env bash
# ecospy 0.7.2 (needs libtbb.so.12): its file of results holds six decimals; a lift reads 0.000000.
#
# Guess: a result file keeps the significant digits of a double, or at least six of them.
# Reality, 2026-11-29: 1.24e-07 is written as 0.000000 in every row, while get_real gives all digits.
# Why it matters here: lifts, gaps and overlaps of contacts are metres by the FMU's unit, some 1e-5
# and 1e-8; the file looks like a needle that never moves.  klack's page on FMUs says to read the
# values in the program, step by step.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check ecospy==0.7.2
cd "$place"
cat > lift.c <<'C'
static double time;
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate() { return &time; }
void fmi2FreeInstance() {}
int fmi2DoStep(void *lift, double t, double h, int keep) { time = t + h; return 0; }
int fmi2GetReal(void *lift, unsigned *which, unsigned long n, double *y) {
  return *y = 1.23456789e-7 + 1e-3 * time, 0;
}
C
for name in SetDebugLogging SetupExperiment {Enter,Exit}InitializationMode Terminate Reset SetReal \
  {Get,Set}{Integer,Boolean,String} {Get,Set,Free}FMUstate SerializedFMUstateSize {,De}SerializeFMUstate \
  GetDirectionalDerivative SetRealInputDerivatives GetRealOutputDerivatives CancelStep \
  Get{,Real,Integer,Boolean,String}Status; do echo "int fmi2$name() { return 0; }"; done >> lift.c
mkdir -p binaries/linux64
gcc -shared -fPIC -o binaries/linux64/lift.so lift.c
cat > modelDescription.xml <<'XML'
<fmiModelDescription fmiVersion="2.0" modelName="lift" guid="lift">
<CoSimulation modelIdentifier="lift"/><ModelVariables>
<ScalarVariable name="lift" valueReference="0" causality="output"><Real/></ScalarVariable>
</ModelVariables><ModelStructure><Outputs><Unknown index="1"/></Outputs></ModelStructure>
</fmiModelDescription>
XML
python3 -m zipfile -c lift.fmu modelDescription.xml binaries
"$place/env/bin/python" - <<'PYTHON'
from pathlib import Path

import ecospy

with ecospy.EcosSimulationStructure() as structure:
    structure.add_model("valve", "lift.fmu")
    with ecospy.EcosSimulation(structure=structure, step_size=1e-7) as simulation:
        simulation.add_csv_writer("lift.csv")
        simulation.init()
        for _ in range(5):
            simulation.step()
        lift = simulation.get_real("valve::lift")
        simulation.terminate()
head, *rows = Path("lift.csv").read_text().splitlines()
print("get_real", lift, head, rows[5], sep="\n")
column = head.split(", ").index("valve::lift[REAL]")
assert abs(lift - 1.23956789e-7) < 1e-16, lift
assert {row.split(", ")[column] for row in rows if row} == {"0.000000"}, rows
PYTHON
echo "as found: the file says 0.000000"
