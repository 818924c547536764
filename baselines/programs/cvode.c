/* CVODE from C: repeated runs of one problem, whose equations are in problem.h.
 *
 * The program reads the request from standard input and writes the response to standard output (docs/protocol.md).
 * Argument: adams or bdf. A run makes one CVODE object per mode; after every event CVodeReInit starts the next mode.
 * Newton's iteration with a dense Jacobian solves implicit steps, also for Adams: a fixed-point iteration takes as many
 * steps, a third more right-hand sides, and at loose tolerances 1.5 times the time.
 *
 * A guard that starts at zero, because its surface has just been left, is lifted by the error that the tolerances allow
 * until it has risen above this error: the first steps after a restart leave an error of about this size.
 */
#include <math.h>
#include <time.h>

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "json.h"
#include "problem.h"
#include "response.h"

#define EPS 2.220446049250313e-16
#define LIMIT 1e100        /* a larger state has diverged */
#define LEFT 0.16          /* error of a guard after the first steps, as a part of the tolerances */
#define ROUNDINGS 16.0     /* rounding error of a guard, in roundings of its terms */
#define WINDOW 36          /* events accumulate if so many of them lie within ... */
#define ULPS 64.0          /* ... this number of roundings of the time, or ... */
#define SPAN 1e-12         /* ... this part of the run */
#define STEPS 2000         /* largest number of steps between two checks of the clock */
#define LOST 16.0          /* a run fails if its steps move the time by fewer roundings than this */

typedef struct {
    int lifted;   /* index of the lifted guard; -1: none */
    int unarmed;  /* guards that must be positive once before they count: one bit each */
    double lift;
} Gate;

typedef struct {
    const ModeTable *mode;
    void *memory;
    N_Vector x;
    SUNMatrix matrix;
    SUNLinearSolver linear;
    Gate gate;
    const double *parameters;
} Solver;

typedef struct {
    int adams;
    double rtol, atol, start, until, seconds;
    double initial[STATES], parameters[PARAMETERS + 1];
    int mode;
    SUNContext context;
} Task;

static double now(clockid_t clock)
{
    struct timespec time;
    clock_gettime(clock, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static int right_hand_side(double t, N_Vector x, N_Vector rate, void *data)
{
    Solver *own = data;
    double *out = N_VGetArrayPointer(rate);
    own->mode->field(t, N_VGetArrayPointer(x), own->parameters, out);
    for (int k = 0; k < own->mode->unknowns; k++)
        if (!isfinite(out[k])) return 1; /* CVODE then shortens the step */
    return 0;
}

static int jacobian(double t, N_Vector x, N_Vector rate, SUNMatrix out, void *data, N_Vector a, N_Vector b, N_Vector c)
{
    Solver *own = data;
    int entries = own->mode->unknowns * own->mode->unknowns;
    (void)rate, (void)a, (void)b, (void)c;
    own->mode->jacobian(t, N_VGetArrayPointer(x), own->parameters, SM_DATA_D(out));
    for (int k = 0; k < entries; k++)
        if (!isfinite(SM_DATA_D(out)[k])) return 1; /* with an infinite Jacobian CVODE accepts any step */
    return 0;
}

static int guards(double t, N_Vector vector, double *out, void *data)
{
    Solver *own = data;
    const double *x = N_VGetArrayPointer(vector);
    int count = own->mode->guards;
    Gate *gate = &own->gate;
    own->mode->values(t, x, own->parameters, out);
    for (int k = 0; k < count; k++)
        if (isnan(out[k])) return 1; /* the guard has no sign, and the run ends */
    if (gate->lifted >= 0) {
        if (out[gate->lifted] > gate->lift) gate->lifted = -1;
        else out[gate->lifted] += gate->lift;
    }
    for (int k = 0; gate->unarmed && k < count; k++)
        if (gate->unarmed & 1 << k) {
            if (out[k] > 0.0) gate->unarmed &= ~(1 << k);
            else out[k] = -1.0;
        }
    out[count] = LIMIT;
    for (int k = 0; k < STATES; k++) out[count] -= fabs(x[k]);
    return 0;
}

static int make_solver(Solver *own, const Task *task, int index)
{
    int unknowns = MODES[index].unknowns, directions[MOST_GUARDS + 1];
    own->mode = &MODES[index];
    own->parameters = task->parameters;
    own->x = N_VNew_Serial(unknowns, task->context);
    own->memory = CVodeCreate(task->adams ? CV_ADAMS : CV_BDF, task->context);
    N_VConst(0.0, own->x);
    for (int k = 0; k <= own->mode->guards; k++) directions[k] = -1;
    if (CVodeInit(own->memory, right_hand_side, task->start, own->x) || CVodeSetUserData(own->memory, own)
        || CVodeSStolerances(own->memory, task->rtol, task->atol) || CVodeSetMaxNumSteps(own->memory, STEPS)
        || CVodeRootInit(own->memory, own->mode->guards + 1, guards)
        || CVodeSetRootDirection(own->memory, directions) || CVodeSetNoInactiveRootWarn(own->memory)
        || CVodeSetErrFile(own->memory, NULL))
        return 0;
    own->matrix = SUNDenseMatrix(unknowns, unknowns, task->context);
    own->linear = SUNLinSol_Dense(own->x, own->matrix, task->context);
    return !CVodeSetLinearSolver(own->memory, own->linear, own->matrix) && !CVodeSetJacFn(own->memory, jacobian);
}

static void free_solver(Solver *own)
{
    if (!own->memory) return;
    CVodeFree(&own->memory);
    if (own->linear) SUNLinSolFree(own->linear);
    if (own->matrix) SUNMatDestroy(own->matrix);
    N_VDestroy(own->x);
    memset(own, 0, sizeof *own);
}

static int index_of(int mode)
{
    for (int k = 0; k < MODE_COUNT; k++)
        if (MODES[k].mode == mode) return k;
    return -1;
}

static void count_work(Run *run, void *memory)
{
    long steps = 0, fields = 0, roots = 0;
    CVodeGetNumSteps(memory, &steps);
    CVodeGetNumRhsEvals(memory, &fields);
    CVodeGetNumGEvals(memory, &roots);
    run->steps += steps;
    run->fields += fields;
    run->guards += roots;
}

/* Error of h by the tolerances and by rounding. */
static double lift_of(const Task *task, double t, const double *x)
{
    double gradient[STATES], lift = 0.0;
    surface_gradient(t, x, task->parameters, gradient);
    for (int k = 0; k < STATES; k++)
        lift += fabs(gradient[k]) * (LEFT * (task->rtol * fabs(x[k]) + task->atol) + ROUNDINGS * EPS * fabs(x[k]));
    return lift;
}

/* Start a mode at the run's current point; `left`: the surface has just been left. */
static int begin(Solver *own, const Task *task, const Run *run, int left)
{
    double *x = N_VGetArrayPointer(own->x);
    memcpy(x, run->state, sizeof run->state);
    own->mode->start(run->time, x, task->parameters, x + STATES);
    own->gate.lifted = left ? own->mode->surface_guard : -1;
    own->gate.unarmed = own->mode->unarmed;
    own->gate.lift = lift_of(task, run->time, x);
    return CVodeReInit(own->memory, run->time, own->x) || CVodeSetStopTime(own->memory, task->until);
}

/* Project the state onto the surface by one Newton step along the gradient. */
static void project(const Task *task, Run *run)
{
    double gradient[STATES], square = 0.0, h = surface(run->time, run->state, task->parameters);
    surface_gradient(run->time, run->state, task->parameters, gradient);
    for (int k = 0; k < STATES; k++) square += gradient[k] * gradient[k];
    if (fabs(h) > run->drift) run->drift = fabs(h);
    if (square > 0.0 && isfinite(square) && isfinite(h))
        for (int k = 0; k < STATES; k++) run->state[k] -= h * gradient[k] / square;
}

static int ended(Run *run, const char *status, const char *reason)
{
    run->status = status;
    snprintf(run->reason, sizeof run->reason, "%s", reason);
    return 1;
}

static int accumulated(const Run *run, const Task *task)
{
    double t = run->time, span = SPAN * (task->until - task->start), ulps = ULPS * EPS * fabs(t);
    return run->count > WINDOW && t - run->events[run->count - 1 - WINDOW].time <= (span > ulps ? span : ulps);
}

/* Log the event of a guard that has fallen and select the next mode; return 1 if the run ends. */
static int follow(Run *run, const Task *task, const ModeTable *mode, int guard)
{
    int next;
    if (mode->kinds[guard] != VALID) project(task, run);
    next = mode->successor(guard, run->time, run->state, task->parameters);
    if (next == INVALID) return ended(run, "invalid", "the model ends: its valid expression fell to 0");
    if (next == NONUNIQUE) return ended(run, "nonunique", "the future is not unique: both fields leave the surface");
    if (next == NONE) return ended(run, "failed", "no successor's conditions hold at the surface");
    if (run->count == run->most) return ended(run, "failed", "more transitions than the request allows");
    if (run->count == run->room) {
        Transition *more = realloc(run->events, sizeof *more * (size_t)(run->room = 2 * run->room + 64));
        if (!more) return ended(run, "failed", "no memory is left");
        run->events = more;
    }
    Transition *event = &run->events[run->count++];
    event->time = run->time, event->before = run->mode, event->after = next;
    memcpy(event->state, run->state, sizeof run->state);
    run->mode = next;
    return accumulated(run, task) ? ended(run, "failed", "events accumulate") : 0;
}

/* End a run at which CVODE gave up: a blow-up, or a failure with CVODE's message. */
static int gave_up(Run *run, const Task *task, const Solver *own, int flag, double size)
{
    double rate[STATES + MOST_GUARDS];
    char words[120], *name = CVodeGetReturnFlagName(flag);
    own->mode->field(run->time, N_VGetArrayPointer(own->x), task->parameters, rate);
    snprintf(words, sizeof words, "CVode: %s at t = %.17g", name, run->time);
    free(name);
    for (int k = 0; k < STATES; k++)
        if (fabs(run->state[k]) > 8.0 * size
            && fabs(rate[k]) * 1024.0 * EPS * fabs(run->time) > 1e-3 * fabs(run->state[k]))
            return ended(run, "diverged", words);
    return ended(run, "failed", words);
}

/* Copy CVODE's state to the run. */
static void take(Run *run, const Solver *own)
{
    memcpy(run->state, N_VGetArrayPointer(own->x), sizeof run->state);
}

/* Integrate one mode to its end; return 1 if the run ends. */
static int advance(Run *run, const Task *task, Solver *own, double stop_at)
{
    int fallen[MOST_GUARDS + 1], flag, guard = -1, count = own->mode->guards;
    double size = size_of(run->state), last;
    do {
        last = run->time;
        flag = CVode(own->memory, task->until, own->x, &run->time, CV_NORMAL);
        if (now(CLOCK_PROCESS_CPUTIME_ID) > stop_at) {
            take(run, own);
            return ended(run, "timeout", "the time that a run may take has passed");
        }
    } while (flag == CV_TOO_MUCH_WORK && run->time - last > LOST * STEPS * EPS * fabs(last));
    take(run, own);
    if (flag != CV_ROOT_RETURN) {
        if (flag < 0) return gave_up(run, task, own, flag, size);
        if (own->mode->mode == 0) project(task, run);
        return ended(run, "ok", "");
    }
    CVodeGetRootInfo(own->memory, fallen);
    if (fallen[count]) return ended(run, "diverged", "a state passed 1e100");
    for (int k = count - 1; k >= 0; k--)
        if (fallen[k] && (guard < 0 || own->mode->kinds[k] == VALID || own->mode->kinds[guard] != VALID)) guard = k;
    if (guard < 0) return ended(run, "failed", "CVode names no root");
    return follow(run, task, own->mode, guard);
}

static void do_run(Run *run, const Task *task)
{
    Solver solvers[MODE_COUNT];
    double stop_at = now(CLOCK_PROCESS_CPUTIME_ID) + task->seconds;
    int over = 0, left = surface(task->start, task->initial, task->parameters) == 0.0;
    memset(solvers, 0, sizeof solvers);
    run->count = run->steps = run->fields = run->guards = 0;
    run->drift = 0.0, run->time = task->start, run->mode = task->mode;
    memcpy(run->state, task->initial, sizeof run->state);
    while (!over) {
        int index = index_of(run->mode);
        Solver *own = &solvers[index < 0 ? 0 : index];
        if (index < 0) over = ended(run, "failed", "the next mode has no equations");
        else if (task->until - run->time <= 2.0 * EPS * fabs(task->until)) over = ended(run, "ok", "");
        else if (!own->memory && !make_solver(own, task, index)) over = ended(run, "failed", "CVODE cannot be set up");
        else if (begin(own, task, run, left)) over = ended(run, "failed", "CVodeReInit refuses the start");
        else {
            over = advance(run, task, own, stop_at);
            count_work(run, own->memory);
            left = 1;
        }
    }
    for (int k = 0; k < MODE_COUNT; k++) free_solver(&solvers[k]);
}

int main(int count, char **arguments)
{
    char *request = read_all(stdin);
    const char *problem = json_member(request, "problem"), *start = json_member(problem, "start");
    long untimed = (long)json_number(json_member(request, "untimed"));
    long timed = (long)json_number(json_member(request, "timed"));
    double *times = calloc((size_t)timed + 1, sizeof *times);
    Task task = {.adams = count > 1 && !strcmp(arguments[1], "adams")};
    Run run = {.status = "failed"};
    if (!problem || !start || !times || json_number(json_member(request, "protocol")) != 1.0
        || json_numbers(json_member(start, "state"), task.initial, STATES) != STATES
        || json_numbers(json_member(problem, "parameters"), task.parameters, PARAMETERS) != PARAMETERS) {
        fprintf(stderr, "the request is not one for this problem\n");
        return 2;
    }
    task.rtol = fmax(json_number(json_member(request, "rtol")), 1e-15);
    task.atol = json_number(json_member(request, "atol"));
    task.seconds = json_number(json_member(request, "seconds"));
    task.start = json_number(json_member(start, "time"));
    task.mode = (int)json_number(json_member(start, "mode"));
    task.until = json_number(json_member(problem, "until"));
    run.most = (long)json_number(json_member(request, "most_transitions"));
    if (SUNContext_Create(NULL, &task.context)) return 3;
    for (long k = -untimed; k < timed; k++) {
        double began = now(CLOCK_MONOTONIC);
        do_run(&run, &task);
        if (k >= 0) times[k] = now(CLOCK_MONOTONIC) - began;
    }
    print_response(&run, times, timed);
    return 0;
}
