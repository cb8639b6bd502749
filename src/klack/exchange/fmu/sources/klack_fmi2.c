/* FMI 2.0 around the model: model exchange and co-simulation in one library.

   The functions have no prefix, as a shared library needs them.  To link the sources into a
   program, compile with FMI2_FUNCTION_PREFIX set to the model identifier and an underscore.   */
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "klack_model.h"

typedef enum {
    CREATED = 1,
    INITIALIZING = 2,
    EVENTS = 4,
    CONTINUOUS = 8,
    STEPPING = 16,
    TERMINATED = 32,
    BROKEN = 64
} phase;

#define RUNNING (EVENTS | CONTINUOUS | STEPPING)
#define READABLE (INITIALIZING | RUNNING | TERMINATED | BROKEN)
#define ANY (CREATED | READABLE)

typedef struct {
    phase now;
    double start;
} situation;

typedef struct {
    situation at;
    fmi2Type type;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    char *name;
    klack_model *model;
} component;

/* ------------------------------------------------------------- messages */

static fmi2Status told(const component *c, const char *function, const char *text) {
    if (c && c->logger) {
        c->logger(c->environment, c->name, fmi2Error, "logStatusError", "%s: %s.", function, text);
    }
    return fmi2Error;
}

static fmi2Status of_model(component *c, const char *function, int failure) {
    return failure ? told(c, function, klack_message(c->model)) : fmi2OK;
}

#define NEED(allowed, function)                                                                \
    component *c = (component *)instance;                                                      \
    if (!c) return fmi2Error;                                                                  \
    if (!(c->at.now & (allowed))) return told(c, function, "it cannot be called at this stage")

#define GIVEN(condition, function, text)                                                       \
    if (!(condition)) return told(c, function, text)

/* ------------------------------------------------------------- life */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component instance, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    (void)loggingOn, (void)nCategories, (void)categories; /* errors are always reported */
    return instance ? fmi2OK : fmi2Error;
}

static void discard(component *c) {
    free(c->model);
    free(c->name);
    free(c);
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn) {
    const char *name = instanceName && *instanceName ? instanceName : KLACK_NAME;
    const char *trouble = NULL;
    component *c = (component *)calloc(1, sizeof *c);
    (void)fmuResourceLocation, (void)visible, (void)loggingOn;
    if (!c) return NULL;
    c->type = fmuType;
    c->logger = functions ? functions->logger : NULL;
    c->environment = functions ? functions->componentEnvironment : NULL;
    c->name = (char *)malloc(strlen(name) + 1);
    c->model = (klack_model *)calloc(1, klack_size());
    c->at.now = CREATED;
    if (c->name) strcpy(c->name, name);
    if (!c->name || !c->model) {
        trouble = "there is not enough memory";
    } else if (!fmuGUID || strcmp(fmuGUID, KLACK_GUID) != 0) {
        trouble = "the GUID is not that of this model";
    } else if (fmuType == fmi2ModelExchange && !klack_has_model_exchange()) {
        trouble = "this model has no model exchange";
    }
    if (trouble) {
        told(c, "fmi2Instantiate", trouble);
        discard(c);
        return NULL;
    }
    klack_reset(c->model);
    return c;
}

void fmi2FreeInstance(fmi2Component instance) {
    if (instance) discard((component *)instance);
}

fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean toleranceDefined,
                               fmi2Real tolerance, fmi2Real startTime, fmi2Boolean stopTimeDefined,
                               fmi2Real stopTime) {
    NEED(CREATED, "fmi2SetupExperiment");
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    c->at.start = startTime;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component instance) {
    NEED(CREATED, "fmi2EnterInitializationMode");
    c->at.now = INITIALIZING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component instance) {
    NEED(INITIALIZING, "fmi2ExitInitializationMode");
    if (klack_initialize(c->model, c->at.start)) {
        c->at.now = BROKEN;
        return of_model(c, "fmi2ExitInitializationMode", 1);
    }
    c->at.now = c->type == fmi2ModelExchange ? EVENTS : STEPPING;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component instance) {
    NEED(RUNNING, "fmi2Terminate");
    c->at.now = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component instance) {
    NEED(ANY, "fmi2Reset");
    klack_reset(c->model);
    c->at.now = CREATED;
    c->at.start = 0.0;
    return fmi2OK;
}

/* ------------------------------------------------------------- values */

fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
    size_t i;
    NEED(READABLE, "fmi2GetReal");
    GIVEN(nvr == 0 || (vr && value), "fmi2GetReal", "an array is missing");
    for (i = 0; i < nvr; i++) {
        if (klack_get_real(c->model, vr[i], &value[i])) return of_model(c, "fmi2GetReal", 1);
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
    size_t i;
    NEED(CREATED | INITIALIZING | RUNNING, "fmi2SetReal");
    GIVEN(nvr == 0 || (vr && value), "fmi2SetReal", "an array is missing");
    for (i = 0; i < nvr; i++) {
        if (klack_set_real(c->model, vr[i], value[i])) return of_model(c, "fmi2SetReal", 1);
    }
    return fmi2OK;
}

/* all variables are reals */
#define NO_VARIABLES(function, type)                                                           \
    fmi2Status function(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,     \
                        type value[]) {                                                        \
        NEED(ANY, #function);                                                                  \
        (void)vr, (void)value;                                                                 \
        return nvr == 0 ? fmi2OK : told(c, #function, "no variable has this type");            \
    }

NO_VARIABLES(fmi2GetInteger, fmi2Integer)
NO_VARIABLES(fmi2GetBoolean, fmi2Boolean)
NO_VARIABLES(fmi2GetString, fmi2String)
NO_VARIABLES(fmi2SetInteger, const fmi2Integer)
NO_VARIABLES(fmi2SetBoolean, const fmi2Boolean)
NO_VARIABLES(fmi2SetString, const fmi2String)

fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance,
                                        const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
    static const char *const function = "fmi2GetDirectionalDerivative";
    size_t i, k;
    NEED(READABLE, function);
    GIVEN(c->type == fmi2ModelExchange, function, "only model exchange has derivatives");
    for (i = 0; i < nUnknown; i++) {
        dvUnknown[i] = 0.0;
        for (k = 0; k < nKnown; k++) {
            double factor;
            if (klack_directional(c->model, vUnknown_ref[i], vKnown_ref[k], &factor)) {
                return of_model(c, function, 1);
            }
            dvUnknown[i] += factor * dvKnown[k];
        }
    }
    return fmi2OK;
}

/* ------------------------------------------------------------- saved states */

typedef struct {
    char guid[64];
    size_t size;
    situation at;
    int type;
} saved_head;

static size_t saved_size(void) { return sizeof(saved_head) + klack_size(); }

static char *block_of(void *state) { return (char *)state + sizeof(saved_head); }

fmi2Status fmi2GetFMUstate(fmi2Component instance, fmi2FMUstate *FMUstate) {
    saved_head head;
    NEED(ANY, "fmi2GetFMUstate");
    GIVEN(FMUstate, "fmi2GetFMUstate", "there is no place for the state");
    if (!*FMUstate) *FMUstate = malloc(saved_size());
    GIVEN(*FMUstate, "fmi2GetFMUstate", "there is not enough memory");
    memset(&head, 0, sizeof head);
    strncpy(head.guid, KLACK_GUID, sizeof head.guid - 1);
    head.size = klack_size();
    head.at = c->at;
    head.type = (int)c->type;
    memcpy(*FMUstate, &head, sizeof head);
    memcpy(block_of(*FMUstate), c->model, klack_size());
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component instance, fmi2FMUstate FMUstate) {
    saved_head head;
    NEED(ANY, "fmi2SetFMUstate");
    GIVEN(FMUstate, "fmi2SetFMUstate", "there is no state");
    memcpy(&head, FMUstate, sizeof head);
    GIVEN(head.type == (int)c->type, "fmi2SetFMUstate", "the state is one of the other kind");
    c->at = head.at;
    memcpy(c->model, block_of(FMUstate), klack_size());
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component instance, fmi2FMUstate *FMUstate) {
    NEED(ANY, "fmi2FreeFMUstate");
    if (FMUstate) {
        free(*FMUstate);
        *FMUstate = NULL;
    }
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component instance, fmi2FMUstate FMUstate,
                                      size_t *size) {
    NEED(ANY, "fmi2SerializedFMUstateSize");
    GIVEN(FMUstate && size, "fmi2SerializedFMUstateSize", "there is no state");
    *size = saved_size();
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component instance, fmi2FMUstate FMUstate,
                                 fmi2Byte serializedState[], size_t size) {
    NEED(ANY, "fmi2SerializeFMUstate");
    GIVEN(FMUstate && serializedState && size >= saved_size(), "fmi2SerializeFMUstate",
          "there is no state, or no place for it");
    memcpy(serializedState, FMUstate, saved_size());
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component instance, const fmi2Byte serializedState[],
                                   size_t size, fmi2FMUstate *FMUstate) {
    static const char *const function = "fmi2DeSerializeFMUstate";
    saved_head head;
    void *block;
    int wrong;
    NEED(ANY, function);
    GIVEN(serializedState && FMUstate && size == saved_size(), function,
          "these bytes are not a state of this model");
    memcpy(&head, serializedState, sizeof head);
    wrong = memcmp(head.guid, KLACK_GUID, sizeof KLACK_GUID) != 0 || head.size != klack_size() ||
            head.at.now <= 0 || head.at.now > BROKEN || (head.at.now & (head.at.now - 1)) != 0;
    GIVEN(!wrong, function, "these bytes are not a state of this model");
    block = malloc(saved_size());
    GIVEN(block, function, "there is not enough memory");
    memcpy(block, serializedState, saved_size());
    if (klack_check((klack_model *)(void *)block_of(block))) {
        free(block);
        return told(c, function, "these bytes are not a state of this model");
    }
    *FMUstate = block;
    return fmi2OK;
}

/* ------------------------------------------------------------- model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component instance) {
    NEED(EVENTS | CONTINUOUS, "fmi2EnterEventMode");
    c->at.now = EVENTS;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component instance, fmi2EventInfo *fmi2eventInfo) {
    NEED(EVENTS, "fmi2NewDiscreteStates");
    GIVEN(fmi2eventInfo, "fmi2NewDiscreteStates", "there is no place for the answer");
    memset(fmi2eventInfo, 0, sizeof *fmi2eventInfo);
    return of_model(c, "fmi2NewDiscreteStates", klack_update_events(c->model));
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component instance) {
    NEED(EVENTS, "fmi2EnterContinuousTimeMode");
    c->at.now = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component instance,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    NEED(CONTINUOUS, "fmi2CompletedIntegratorStep");
    (void)noSetFMUStatePriorToCurrentPoint;
    GIVEN(enterEventMode && terminateSimulation, "fmi2CompletedIntegratorStep",
          "there is no place for the answer");
    *enterEventMode = fmi2False;
    *terminateSimulation = fmi2False;
    return of_model(c, "fmi2CompletedIntegratorStep", klack_complete_step(c->model));
}

fmi2Status fmi2SetTime(fmi2Component instance, fmi2Real time) {
    NEED(EVENTS | CONTINUOUS, "fmi2SetTime");
    return of_model(c, "fmi2SetTime", klack_set_time(c->model, time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component instance, const fmi2Real x[], size_t nx) {
    NEED(CONTINUOUS, "fmi2SetContinuousStates");
    GIVEN(x && nx == klack_state_count(), "fmi2SetContinuousStates", "the count is wrong");
    return of_model(c, "fmi2SetContinuousStates", klack_set_states(c->model, x));
}

/* a whole vector of this model */
#define VECTOR(function, argument, count, getter, allowed)                                     \
    fmi2Status function(fmi2Component instance, fmi2Real argument[], size_t given) {           \
        NEED(allowed, #function);                                                              \
        GIVEN(c->type == fmi2ModelExchange, #function, "this is co-simulation");               \
        GIVEN(given == count() && (argument || given == 0), #function, "the count is wrong");  \
        return of_model(c, #function, given ? getter(c->model, argument) : 0);                 \
    }

VECTOR(fmi2GetDerivatives, derivatives, klack_state_count, klack_get_derivatives, READABLE)
VECTOR(fmi2GetEventIndicators, eventIndicators, klack_event_count, klack_get_events, READABLE)
VECTOR(fmi2GetContinuousStates, x, klack_state_count, klack_get_states, READABLE)
VECTOR(fmi2GetNominalsOfContinuousStates, x_nominal, klack_state_count, klack_get_nominals, ANY)

/* ------------------------------------------------------------- co-simulation */

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    int failure;
    NEED(STEPPING, "fmi2DoStep");
    (void)noSetFMUStatePriorToCurrentPoint;
    failure = klack_do_step(c->model, currentCommunicationPoint, communicationStepSize);
    if (failure > 1) c->at.now = BROKEN;
    return of_model(c, "fmi2DoStep", failure);
}

fmi2Status fmi2CancelStep(fmi2Component instance) {
    NEED(STEPPING, "fmi2CancelStep");
    return told(c, "fmi2CancelStep", "every step is finished when fmi2DoStep returns");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component instance, const fmi2ValueReference vr[],
                                       size_t nvr, const fmi2Integer order[],
                                       const fmi2Real value[]) {
    NEED(CREATED | INITIALIZING | STEPPING, "fmi2SetRealInputDerivatives");
    (void)vr, (void)order, (void)value;
    return nvr == 0 ? fmi2OK
                    : told(c, "fmi2SetRealInputDerivatives", "inputs are held over a step");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component instance, const fmi2ValueReference vr[],
                                        size_t nvr, const fmi2Integer order[], fmi2Real value[]) {
    NEED(STEPPING | TERMINATED | BROKEN, "fmi2GetRealOutputDerivatives");
    (void)vr, (void)order, (void)value;
    return nvr == 0 ? fmi2OK
                    : told(c, "fmi2GetRealOutputDerivatives", "outputs have no derivatives");
}

fmi2Status fmi2GetStatus(fmi2Component instance, const fmi2StatusKind s, fmi2Status *value) {
    NEED(STEPPING | TERMINATED | BROKEN, "fmi2GetStatus");
    (void)s, (void)value;
    return told(c, "fmi2GetStatus", "no step is ever pending"), fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component instance, const fmi2StatusKind s, fmi2Real *value) {
    NEED(STEPPING | TERMINATED | BROKEN, "fmi2GetRealStatus");
    if (s != fmi2LastSuccessfulTime || !value) {
        return told(c, "fmi2GetRealStatus", "only the last successful time is known"), fmi2Discard;
    }
    *value = klack_get_time(c->model);
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component instance, const fmi2StatusKind s,
                                fmi2Integer *value) {
    NEED(STEPPING | TERMINATED | BROKEN, "fmi2GetIntegerStatus");
    (void)s, (void)value;
    return told(c, "fmi2GetIntegerStatus", "there is no such status"), fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component instance, const fmi2StatusKind s,
                                fmi2Boolean *value) {
    NEED(STEPPING | TERMINATED | BROKEN, "fmi2GetBooleanStatus");
    if (s != fmi2Terminated || !value) {
        return told(c, "fmi2GetBooleanStatus", "there is no such status"), fmi2Discard;
    }
    *value = c->at.now == TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component instance, const fmi2StatusKind s,
                               fmi2String *value) {
    NEED(STEPPING | TERMINATED | BROKEN, "fmi2GetStringStatus");
    (void)s, (void)value;
    return told(c, "fmi2GetStringStatus", "there is no such status"), fmi2Discard;
}
