/* Spring and damper as a co-simulation FMU, F = -k x - c v, with an inner clock.
   Compile with -DFMI=2 or -DFMI=3; -DFAULT=statement does something wrong after 4 us, -DAT_LOAD=
   statement while the library is loaded.  Variables: 0 time, 1 x, 2 v, 3 F, 4 k, 5 c, 6 steps. */

#include <stdlib.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

#if FMI == 2
#include "fmi2Functions.h"
typedef fmi2Component Instance;
typedef fmi2Status Status;
enum { OK = fmi2OK, FAILED = fmi2Error };
#else
#include "fmi3Functions.h"
typedef fmi3Instance Instance;
typedef fmi3Status Status;
enum { OK = fmi3OK, FAILED = fmi3Error };
#endif

typedef struct {
    double value[7];
} Model;

#ifdef AT_LOAD
__attribute__((constructor)) static void at_load(void) { AT_LOAD; }
#endif

static void *create(void) {
    Model *m = calloc(1, sizeof(Model));
    m->value[4] = 1000.0;
    return m;
}

static Status set(Instance c, const unsigned *vr, size_t n, const double *value) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > 5) return FAILED;
        ((Model *)c)->value[vr[i]] = value[i];
    }
    return OK;
}

static Status get(Instance c, const unsigned *vr, size_t n, double *value) {
    Model *m = c;
    m->value[3] = -m->value[4] * m->value[1] - m->value[5] * m->value[2];
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > 6) return FAILED;
        value[i] = m->value[vr[i]];
    }
    return OK;
}

static Status step(Instance c, double t, double h) {
    Model *m = c;
    /* refuses a master that forgets or repeats a step, and forces that are no numbers */
    if (fabs(m->value[0] - t) > 1e-12 || !(h > 0.0) || !isfinite(m->value[1])) return FAILED;
    m->value[0] = t + h;
    m->value[6] += 1.0;
#ifdef FAULT
    if (t > 4e-6) { FAULT; }
#endif
    return OK;
}

#if FMI == 2
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String guid, fmi2String place,
    const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean log) { return create(); }
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real start,
    fmi2Boolean d, fmi2Real e) { ((Model *)c)->value[0] = start; return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const fmi2Real value[]) { return set(c, vr, n, value); }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    fmi2Real value[]) { return get(c, vr, n, value); }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean a) {
    return step(c, t, h);
}
#else
const char *fmi3GetVersion(void) { return fmi3Version; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String place,
    fmi3Boolean visible, fmi3Boolean log, fmi3Boolean events, fmi3Boolean early,
    const fmi3ValueReference v[], size_t n, fmi3InstanceEnvironment e,
    fmi3LogMessageCallback say, fmi3IntermediateUpdateCallback update) { return create(); }
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b,
    fmi3Float64 start, fmi3Boolean d, fmi3Float64 stop) {
    ((Model *)c)->value[0] = start;
    return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    const fmi3Float64 value[], size_t m) { return set(c, vr, n, value); }
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
    fmi3Float64 value[], size_t m) { return get(c, vr, n, value); }
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean a,
    fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last) {
    *event = *end = *early = 0;
    *last = t + h;
    return step(c, t, h);
}
#endif
