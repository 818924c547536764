/* Result of a run, and its output as a response (docs/protocol.md). */
#ifndef HENON_REF_RESPONSE_H
#define HENON_REF_RESPONSE_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <sundials/sundials_config.h>

#include "problem.h"

typedef struct {
    double time;
    int before, after;
    double state[STATES];
} Transition;

typedef struct {
    const char *status;
    char reason[200];
    Transition *events;
    long count, room, most;
    double time, state[STATES], drift;
    int mode;
    long steps, fields, guards;
} Run;

static double size_of(const double *x)
{
    double size = 0.0;
    for (int k = 0; k < STATES; k++) size = fmax(size, fabs(x[k]));
    return size;
}

static void print_state(const double *state)
{
    for (int k = 0; k < STATES; k++) printf("%s%.17g", k ? "," : "[", state[k]);
    printf("]");
}

static void print_response(const Run *run, const double *times, long timed)
{
    int finite = isfinite(size_of(run->state)) && isfinite(run->time);
    printf("{\"protocol\":1,\"program\":{\"name\":\"cvode.c\",\"version\":\"SUNDIALS %s\"},", SUNDIALS_VERSION);
    printf("\"status\":\"%s\",\"reason\":\"%s\",\"transitions\":[", run->status, run->reason);
    for (long k = 0; k < run->count; k++) {
        const Transition *event = &run->events[k];
        printf("%s{\"time\":%.17g,\"before\":%d,\"after\":%d,\"state\":", k ? "," : "", event->time, event->before,
               event->after);
        print_state(event->state);
        printf("}");
    }
    printf("],\"end\":");
    if (finite) {
        printf("{\"time\":%.17g,\"mode\":%d,\"state\":", run->time, run->mode);
        print_state(run->state);
        printf("}");
    } else
        printf("null");
    printf(",\"max_surface_drift\":%.17g,\"wall_s\":[", isfinite(run->drift) ? run->drift : 0.0);
    for (long k = 0; k < timed; k++) printf("%s%.9g", k ? "," : "", times[k]);
    printf("],\"work\":{\"steps\":%ld,\"fields\":%ld,\"guards\":%ld}}\n", run->steps, run->fields, run->guards);
}

static char *read_all(FILE *stream)
{
    size_t size = 0, room = 1 << 16, got;
    char *text = malloc(room + 1);
    while (text && (got = fread(text + size, 1, room - size, stream)) > 0)
        if ((size += got) == room) text = realloc(text, (room *= 2) + 1);
    if (text) text[size] = 0;
    return text;
}

#endif
