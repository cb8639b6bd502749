#!/usr/bin/env bash
# libcosimpy 0.0.6: the file of results has six significant digits, and is empty until the
# Python objects are deleted.
#
# Guess: after the last step the file of the observer holds the run, with the digits of a double.
# Reality, 2026-11-29: no row is there after five steps; all are after the observer and the execution
# are deleted.  1.23956789e-07 is written as 1.23957e-07, and so is the time, in seconds.
# Why it matters here: a script that reads the file in the same program finds nothing; and after one
# second the times of steps of 0.1 us are all the same number.  klack's page on FMUs says so.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check libcosimpy==0.0.6
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
mkdir -p binaries/linux64 log
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

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

execution = CosimExecution.from_step_size(100)
slave = execution.add_local_slave(CosimLocalSlave("lift.fmu", "valve"))
observer = CosimObserver.create_to_dir("log")
execution.add_observer(observer)
execution.step(5)
(path,) = Path("log").glob("*.csv")
before = path.read_text().splitlines()
del observer, slave, execution
after = path.read_text().splitlines()
print(f"lines after the run {len(before)}, after deletion {len(after)}: {after[-1]}")
assert not before and len(after) == 7 and after[-1].endswith(",1.23957e-07"), (before, after)
PYTHON
echo "as found: nothing before deletion, six digits after it"
