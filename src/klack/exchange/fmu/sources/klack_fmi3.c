/* FMI 3.0 around the model: model exchange and co-simulation.

   The time has the value reference klack_variable_count(); all others are those of the model.  */
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "klack_model.h"

enum phase { CREATED, INITIALIZING, RUNNING, TERMINATED };
enum use { MODEL_EXCHANGE, CO_SIMULATION };

typedef struct {
    double start;
    int phase;
} situation;

typedef struct {
    situation at;
    enum use use;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    klack_model *model;
} component;

/* ---------------------------------------------------------------------------- messages */

static void refused(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                    const char *text) {
    if (log) log(environment, fmi3Error, "logStatusError", text);
}

static fmi3Status failed(const component *c, const char *text) {
    if (c) refused(c->environment, c->log, text);
    return fmi3Error;
}

static fmi3Status of_model(const component *c, int failure) {
    return failure ? failed(c, klack_message(c->model)) : fmi3OK;
}

#define REQUIRE(condition, text)                                                                  \
    do {                                                                                          \
        if (!instance) return fmi3Error;                                                          \
        if (!(condition)) return failed((const component *)instance, text);                       \
    } while (0)

/* ---------------------------------------------------------------------------- life */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
    (void)loggingOn, (void)nCategories, (void)categories; /* errors are always reported */
    return instance ? fmi3OK : fmi3Error;
}

static component *created(enum use use, fmi3String token, fmi3InstanceEnvironment environment,
                          fmi3LogMessageCallback log) {
    component *c;
    if (!token || strcmp(token, KLACK_GUID) != 0) {
        refused(environment, log, "The instantiation token is not that of this model.");
        return NULL;
    }
    c = (component *)calloc(1, sizeof *c);
    if (c) c->model = (klack_model *)calloc(1, klack_size());
    if (!c || !c->model) {
        refused(environment, log, "Not enough memory.");
        free(c);
        return NULL;
    }
    c->use = use;
    c->environment = environment;
    c->log = log;
    klack_reset(c->model);
    return c;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
    (void)instanceName, (void)resourcePath, (void)visible, (void)loggingOn;
    if (!klack_has_model_exchange()) {
        refused(instanceEnvironment, logMessage, "This model has co-simulation only.");
        return NULL;
    }
    return created(MODEL_EXCHANGE, instantiationToken, instanceEnvironment, logMessage);
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate) {
    (void)instanceName, (void)resourcePath, (void)visible, (void)loggingOn, (void)eventModeUsed;
    (void)earlyReturnAllowed, (void)requiredIntermediateVariables, (void)intermediateUpdate;
    if (nRequiredIntermediateVariables > 0) {
        refused(instanceEnvironment, logMessage, "This model has no intermediate variables.");
        return NULL;
    }
    return created(CO_SIMULATION, instantiationToken, instanceEnvironment, logMessage);
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
    fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption) {
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible;
    (void)loggingOn, (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    refused(instanceEnvironment, logMessage, "This model has no scheduled execution.");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance) {
    component *c = (component *)instance;
    if (!c) return;
    free(c->model);
    free(c);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
    component *c = (component *)instance;
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    REQUIRE(c->at.phase == CREATED, "fmi3EnterInitializationMode: the model runs already.");
    c->at.phase = INITIALIZING;
    c->at.start = startTime;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    component *c = (component *)instance;
    fmi3Status status;
    REQUIRE(c->at.phase == INITIALIZING, "fmi3ExitInitializationMode: not initializing.");
    status = of_model(c, klack_initialize(c->model, c->at.start));
    c->at.phase = RUNNING;
    return status;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    component *c = (component *)instance;
    REQUIRE(c->use == MODEL_EXCHANGE && c->at.phase == RUNNING,
            "fmi3EnterEventMode: only in model exchange, after initialization.");
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    component *c = (component *)instance;
    REQUIRE(c->at.phase == RUNNING, "fmi3Terminate: the model does not run.");
    c->at.phase = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    static const situation first = {0.0, CREATED};
    component *c = (component *)instance;
    if (!c) return fmi3Error;
    klack_reset(c->model);
    c->at = first;
    return fmi3OK;
}

/* ---------------------------------------------------------------------------- values */

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Float64 values[], size_t nValues) {
    component *c = (component *)instance;
    size_t i;
    REQUIRE(nValues == nValueReferences, "fmi3GetFloat64: one value per reference.");
    for (i = 0; i < nValueReferences; i++) {
        if (valueReferences[i] == klack_variable_count()) {
            values[i] = c->at.phase < RUNNING ? c->at.start : klack_get_time(c->model);
        } else if (klack_get_real(c->model, valueReferences[i], &values[i])) {
            return of_model(c, 1);
        }
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, const fmi3Float64 values[], size_t nValues) {
    component *c = (component *)instance;
    size_t i;
    REQUIRE(nValues == nValueReferences, "fmi3SetFloat64: one value per reference.");
    for (i = 0; i < nValueReferences; i++) {
        if (valueReferences[i] >= klack_variable_count()) {
            return failed(c, "fmi3SetFloat64: this variable cannot be set.");
        }
        if (klack_set_real(c->model, valueReferences[i], values[i])) return of_model(c, 1);
    }
    return fmi3OK;
}

/* All variables are Float64; asking for none of another type is no error. */
#define NO_VARIABLES(Name, Type)                                                                  \
    fmi3Status fmi3Get##Name(fmi3Instance instance, const fmi3ValueReference valueReferences[],   \
                             size_t nValueReferences, Type values[], size_t nValues) {            \
        (void)valueReferences, (void)values, (void)nValues;                                       \
        REQUIRE(nValueReferences == 0, "fmi3Get" #Name ": all variables are Float64.");           \
        return fmi3OK;                                                                            \
    }                                                                                             \
    fmi3Status fmi3Set##Name(fmi3Instance instance, const fmi3ValueReference valueReferences[],   \
                             size_t nValueReferences, const Type values[], size_t nValues) {      \
        (void)valueReferences, (void)values, (void)nValues;                                       \
        REQUIRE(nValueReferences == 0, "fmi3Set" #Name ": all variables are Float64.");           \
        return fmi3OK;                                                                            \
    }

NO_VARIABLES(Float32, fmi3Float32)
NO_VARIABLES(Int8, fmi3Int8)
NO_VARIABLES(UInt8, fmi3UInt8)
NO_VARIABLES(Int16, fmi3Int16)
NO_VARIABLES(UInt16, fmi3UInt16)
NO_VARIABLES(Int32, fmi3Int32)
NO_VARIABLES(UInt32, fmi3UInt32)
NO_VARIABLES(Int64, fmi3Int64)
NO_VARIABLES(UInt64, fmi3UInt64)
NO_VARIABLES(Boolean, fmi3Boolean)
NO_VARIABLES(String, fmi3String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, size_t valueSizes[], fmi3Binary values[],
                         size_t nValues) {
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    REQUIRE(nValueReferences == 0, "fmi3GetBinary: all variables are Float64.");
    return fmi3OK;
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, const size_t valueSizes[],
                         const fmi3Binary values[], size_t nValues) {
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    REQUIRE(nValueReferences == 0, "fmi3SetBinary: all variables are Float64.");
    return fmi3OK;
}

/* ---------------------------------------------------------------------------- saved states */

/* A saved state is one block: what it belongs to, the situation, the memory of the model. */
typedef struct {
    char token[64];
    size_t size;
    situation at;
} saved_head;

static size_t saved_size(void) { return sizeof(saved_head) + klack_size(); }

static void label(saved_head *head) {
    memset(head, 0, sizeof *head);
    strncpy(head->token, KLACK_GUID, sizeof head->token - 1);
    head->size = saved_size();
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    component *c = (component *)instance;
    saved_head head;
    REQUIRE(FMUState, "fmi3GetFMUState: no place for the state.");
    if (!*FMUState) *FMUState = malloc(saved_size());
    if (!*FMUState) return failed(c, "Not enough memory.");
    label(&head);
    head.at.start = c->at.start;
    head.at.phase = c->at.phase;
    memcpy(*FMUState, &head, sizeof head);
    memcpy((char *)*FMUState + sizeof head, c->model, klack_size());
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) {
    component *c = (component *)instance;
    REQUIRE(FMUState, "fmi3SetFMUState: no state.");
    c->at = ((const saved_head *)FMUState)->at;
    memcpy(c->model, (const char *)FMUState + sizeof(saved_head), klack_size());
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    if (!instance) return fmi3Error;
    if (FMUState) {
        free(*FMUState);
        *FMUState = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size) {
    REQUIRE(FMUState && size, "fmi3SerializedFMUStateSize: no state.");
    *size = saved_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState,
                                 fmi3Byte serializedState[], size_t size) {
    REQUIRE(FMUState && size >= saved_size(), "fmi3SerializeFMUState: too few bytes.");
    memcpy(serializedState, FMUState, saved_size());
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[],
                                   size_t size, fmi3FMUState *FMUState) {
    saved_head expected, head;
    char *block;
    REQUIRE(FMUState && size == saved_size(), "fmi3DeserializeFMUState: of another model.");
    label(&expected);
    memcpy(&head, serializedState, sizeof head);
    REQUIRE(memcmp(head.token, expected.token, sizeof head.token) == 0 && head.size == size,
            "fmi3DeserializeFMUState: of another model.");
    block = (char *)malloc(size);
    REQUIRE(block, "Not enough memory.");
    memcpy(block, serializedState, size);
    if (head.at.phase < CREATED || head.at.phase > TERMINATED ||
        klack_check((klack_model *)(block + sizeof head))) {
        free(block);
        return failed((component *)instance, "fmi3DeserializeFMUState: the bytes are damaged.");
    }
    free(*FMUState);
    *FMUState = block;
    return fmi3OK;
}

/* ---------------------------------------------------------------------------- derivatives */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                        size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                        fmi3Float64 sensitivity[], size_t nSensitivity) {
    component *c = (component *)instance;
    size_t i, k;
    REQUIRE(nSeed == nKnowns && nSensitivity == nUnknowns,
            "fmi3GetDirectionalDerivative: one seed per known, one result per unknown.");
    for (i = 0; i < nUnknowns; i++) {
        double sum = 0.0, factor;
        for (k = 0; k < nKnowns; k++) {
            if (seed[k] == 0.0 || knowns[k] == klack_variable_count()) continue;
            if (klack_directional(c->model, unknowns[i], knowns[k], &factor)) return of_model(c, 1);
            sum += factor * seed[k];
        }
        sensitivity[i] = sum;
    }
    return fmi3OK;
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                    size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                    fmi3Float64 sensitivity[], size_t nSensitivity) {
    (void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns;
    (void)seed, (void)nSeed, (void)sensitivity, (void)nSensitivity;
    return failed((component *)instance, "fmi3GetAdjointDerivative: not provided.");
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference reference,
                                               size_t *nDependencies) {
    (void)reference, (void)nDependencies;
    return failed((component *)instance,
                  "fmi3GetNumberOfVariableDependencies: see modelDescription.xml.");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[],
                                       fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[],
                                       fmi3DependencyKind dependencyKinds[], size_t nDependencies) {
    (void)dependent, (void)elementIndicesOfDependent, (void)independents;
    (void)elementIndicesOfIndependents, (void)dependencyKinds, (void)nDependencies;
    return failed((component *)instance, "fmi3GetVariableDependencies: see modelDescription.xml.");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance,
                                    const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nValues) {
    (void)valueReferences, (void)nValueReferences, (void)orders, (void)values, (void)nValues;
    return failed((component *)instance, "fmi3GetOutputDerivatives: not provided.");
}

/* ---------------------------------------------------------------------------- model exchange */

#define EXCHANGE "only in model exchange, after initialization."

static int exchanges(const component *c) {
    return c->use == MODEL_EXCHANGE && c->at.phase == RUNNING;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    component *c = (component *)instance;
    REQUIRE(exchanges(c), "fmi3EnterContinuousTimeMode: " EXCHANGE);
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance,
                                       fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation) {
    component *c = (component *)instance;
    (void)noSetFMUStatePriorToCurrentPoint;
    REQUIRE(exchanges(c), "fmi3CompletedIntegratorStep: " EXCHANGE);
    *enterEventMode = fmi3False;
    *terminateSimulation = fmi3False;
    return of_model(c, klack_complete_step(c->model));
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    component *c = (component *)instance;
    REQUIRE(exchanges(c), "fmi3SetTime: " EXCHANGE);
    return of_model(c, klack_set_time(c->model, time));
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
    component *c = (component *)instance;
    REQUIRE(exchanges(c) && nContinuousStates == klack_state_count(),
            "fmi3SetContinuousStates: all states, " EXCHANGE);
    return of_model(c, klack_set_states(c->model, continuousStates));
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
    component *c = (component *)instance;
    REQUIRE(nContinuousStates == klack_state_count(), "fmi3GetContinuousStates: all states.");
    return of_model(c, klack_get_states(c->model, continuousStates));
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
                                             size_t nContinuousStates) {
    component *c = (component *)instance;
    REQUIRE(nContinuousStates == klack_state_count(),
            "fmi3GetContinuousStateDerivatives: of all states.");
    return of_model(c, klack_get_derivatives(c->model, derivatives));
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[],
                                             size_t nContinuousStates) {
    component *c = (component *)instance;
    REQUIRE(nContinuousStates == klack_state_count(),
            "fmi3GetNominalsOfContinuousStates: of all states.");
    return of_model(c, klack_get_nominals(c->model, nominals));
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[],
                                  size_t nEventIndicators) {
    component *c = (component *)instance;
    REQUIRE(nEventIndicators == klack_event_count(), "fmi3GetEventIndicators: all of them.");
    return of_model(c, klack_get_events(c->model, eventIndicators));
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators) {
    if (!instance) return fmi3Error;
    *nEventIndicators = klack_event_count();
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates) {
    if (!instance) return fmi3Error;
    *nContinuousStates = klack_state_count();
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    return instance ? fmi3OK : fmi3Error;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime) {
    component *c = (component *)instance;
    if (!c) return fmi3Error;
    *discreteStatesNeedUpdate = *terminateSimulation = fmi3False;
    *nominalsOfContinuousStatesChanged = *valuesOfContinuousStatesChanged = fmi3False;
    *nextEventTimeDefined = fmi3False;
    *nextEventTime = 0.0;
    return c->at.phase == RUNNING ? of_model(c, klack_update_events(c->model)) : fmi3OK;
}

/* ---------------------------------------------------------------------------- co-simulation */

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    component *c = (component *)instance;
    REQUIRE(c->use == CO_SIMULATION && c->at.phase == RUNNING,
            "fmi3EnterStepMode: only in co-simulation, after initialization.");
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
    component *c = (component *)instance;
    int failure;
    (void)noSetFMUStatePriorToCurrentPoint;
    REQUIRE(c->use == CO_SIMULATION && c->at.phase == RUNNING,
            "fmi3DoStep: only in co-simulation, after initialization.");
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    failure = klack_do_step(c->model, currentCommunicationPoint, communicationStepSize);
    *lastSuccessfulTime = klack_get_time(c->model);
    if (failure > 1) c->at.phase = TERMINATED; /* the motion is lost: only a reset helps */
    return of_model(c, failure);
}

/* ---------------------------------------------------------------------------- not for this model */

static fmi3Status no_clocks(fmi3Instance instance, size_t count) {
    REQUIRE(count == 0, "This model has no clocks.");
    return fmi3OK;
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    return failed((component *)instance, "This model has no structural parameters.");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    return failed((component *)instance, "This model has no structural parameters.");
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, fmi3Clock values[]) {
    (void)valueReferences, (void)values;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, const fmi3Clock values[]) {
    (void)valueReferences, (void)values;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
    (void)valueReferences, (void)intervals, (void)qualifiers;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance,
                                   const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
    (void)valueReferences, (void)counters, (void)resolutions, (void)qualifiers;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, fmi3Float64 shifts[]) {
    (void)valueReferences, (void)shifts;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[]) {
    (void)valueReferences, (void)counters, (void)resolutions;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, const fmi3Float64 intervals[]) {
    (void)valueReferences, (void)intervals;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance,
                                   const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, const fmi3UInt64 counters[],
                                   const fmi3UInt64 resolutions[]) {
    (void)valueReferences, (void)counters, (void)resolutions;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, const fmi3Float64 shifts[]) {
    (void)valueReferences, (void)shifts;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, const fmi3UInt64 counters[],
                                const fmi3UInt64 resolutions[]) {
    (void)valueReferences, (void)counters, (void)resolutions;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime) {
    (void)clockReference, (void)activationTime;
    return failed((component *)instance, "This model has no scheduled execution.");
}
