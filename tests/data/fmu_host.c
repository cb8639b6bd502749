/* Smallest importer of an FMI 2.0 co-simulation FMU, without any FMI library or header.

   host LIBRARY GUID STEP COUNT PEAK LIFT: steps from time 0; prints the largest value of the
   variable PEAK and the last value of LIFT (value references).                                */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#include <windows.h>
#define OPEN(path) LoadLibraryA(path)
#define FIND(library, name) (void *)GetProcAddress(library, name)
typedef HMODULE library_t;
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW)
#define FIND(library, name) dlsym(library, name)
typedef void *library_t;
#endif

typedef struct {
    void (*log)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} callbacks;

static void report(void *environment, const char *instance, int status, const char *category,
                   const char *text, ...) {
    va_list more;
    (void)environment, (void)instance, (void)category;
    va_start(more, text);
    fprintf(stderr, "status %d: ", status);
    vfprintf(stderr, text, more);
    fprintf(stderr, "\n");
    va_end(more);
}

#define CALL(expression)                                                                          \
    if ((expression) != 0) {                                                                      \
        fprintf(stderr, "failed: %s\n", #expression);                                             \
        return 1;                                                                                 \
    }

int main(int n, char **words) {
    callbacks back = {report, calloc, free, NULL, NULL};
    library_t library = n == 7 ? OPEN(words[1]) : NULL;
    if (!library) return fprintf(stderr, "cannot open the library\n"), 2;
    void *(*instantiate)(const char *, int, const char *, const char *, const callbacks *, int,
                         int) = FIND(library, "fmi2Instantiate");
    int (*set_up)(void *, int, double, double, int, double) = FIND(library, "fmi2SetupExperiment");
    int (*enter)(void *) = FIND(library, "fmi2EnterInitializationMode");
    int (*leave)(void *) = FIND(library, "fmi2ExitInitializationMode");
    int (*step)(void *, double, double, int) = FIND(library, "fmi2DoStep");
    int (*get)(void *, const unsigned *, size_t, double *) = FIND(library, "fmi2GetReal");
    int (*end)(void *) = FIND(library, "fmi2Terminate");
    void (*discard)(void *) = FIND(library, "fmi2FreeInstance");
    double h = atof(words[3]), values[2], peak = 0.0;
    int i, count = atoi(words[4]);
    unsigned references[2];
    void *model = instantiate("impact", 1, words[2], "", &back, 0, 1);
    if (!model) return 3;
    references[0] = (unsigned)atoi(words[5]);
    references[1] = (unsigned)atoi(words[6]);
    CALL(set_up(model, 0, 0.0, 0.0, 0, 0.0));
    CALL(enter(model));
    CALL(leave(model));
    for (i = 0; i < count; i++) {
        CALL(step(model, i * h, h, 0));
        CALL(get(model, references, 2, values));
        if (values[0] > peak) peak = values[0];
    }
    printf("%.17g %.17g\n", peak, values[1]);
    CALL(end(model));
    discard(model);
    return 0;
}
