/* Structures, enumerations and functions that the compiled loop and Python share.
 *
 * The compiler reads this file, and so does henon_ref.kernel.library, which derives NumPy's record types from it,
 * so that there is no second description. Lengths of arrays: n states, G guards of the largest mode, M compiled modes.
 * Times are in seconds; the "unit" is the unit of time of a run's Taylor coefficients, about the size of a step.
 */
#ifndef HENON_KERNEL_H
#define HENON_KERNEL_H

#include <stdint.h>

/* Visible to Python. "protected": calls within the library stay within, because the C library has an advance(), too. */
#ifdef __ELF__
#define HENON_EXPORT __attribute__((visibility("protected")))
#else
#define HENON_EXPORT __attribute__((visibility("default")))
#endif

/* Kinds of guards. The run ends at VALID guards: valid expressions, "attracts", and all guards of
 * henon_ref.modes.equations with "ends", including those of surfaces. */
enum guard_kind { SURFACE, RELEASE, VALID };

/* Kinds of transitions. */
enum transition_kind { STICK, RELEASED, CROSSING, GRAZE, RESET };

/* Surfaces whose events are not decided by two normal velocities alone: they act on each other, or reset the state. */
enum coupling { UNCOUPLED, COUPLED, RESETTING };

/* Properties of a surface in a system with static friction. FIXED: a contact with static friction; KNOWN_INERTIA: the
 * growth of its load with its acceleration is known; BY_LOAD: the effect of a load is known; SECTION: no contact, no
 * force acts on its velocity. */
enum contact { FIXED = 1, KNOWN_INERTIA = 2, BY_LOAD = 4, SECTION = 8 };

/* Methods of landing. */
enum landing { HENON, NEWTON, BRENT, BRACKET };

/* Results of a search for the first falling root (SUBDIVIDE: the signs do not decide). */
enum roots_outcome { NO_ROOT, ROOT, TANGENTIAL, SUBDIVIDE };

/* Operations of programs in double-double; POWER has an integer exponent instead of its second register. */
enum operation { ADD, MULTIPLY, POWER, SQRT };

/* Operations of tapes, with the names of henon_ref.taylor.tape; a square is a product. */
enum tape_kind {
    TAPE_STATE, TAPE_CONSTANT, TAPE_CLOCK, TAPE_ADD, TAPE_SUB, TAPE_SCALE, TAPE_SHIFT, TAPE_RSUB, TAPE_MUL, TAPE_DIV,
    TAPE_RECIP, TAPE_SQRT, TAPE_POWER, TAPE_EXP, TAPE_LOG, TAPE_SIN, TAPE_COS
};

/* Reasons for which the compiled loop returns. Only the loop uses the last two: process an event, or continue. */
enum return_code {
    HORIZON,
    SELECT_MODE,
    BLOCK_FULL,
    DIVERGED,
    STALLED,
    BUDGET_SPENT,
    LEFT_DOMAIN,
    EVENTS_ACCUMULATE,
    UNDECIDED_EVENT,
    MODE_NOT_COMPILED,
    STEPS_FULL,
    STOPPED,
    OUT_OF_RANGE,
    NOT_UNIQUE,
    EVENT = 20,
    ON = 21
};

/* Reasons for which the runs of many points return: all points are done; the buffer may be too small for the next
 * transitions; Python can check for interrupts; a point was set aside, perhaps for a mode that Python can compile. */
enum points_code { DONE, BUFFER_FULL, PAUSE, ASIDE };

enum {
    UNSETTLED = 2,         /* value of event_pending in struct run */
    REMEMBERED_STEPS = 64, /* modes of which a run keeps the last step, in the order of their first entry; a mode that
                              is entered again begins with its last step */
    CHUNK = 1024,          /* transitions in one block of memory */
    DEPTH = 64,            /* pieces that root isolation keeps at once: one per halving that a double can resolve */
    ALIGNMENT = 8,         /* doubles in a line of the processor's cache; the parts of a block begin with a line */
    LANES = 4,             /* doubles in a vector; rows of coefficients are whole vectors, padded with zeros */
    MOST_SURFACES = 39,    /* largest number for which the number of a mode fits an integer, 3^39 < 2^63 */
    MOST_IN_GROUP = 64,    /* largest number of contacts decided together */
    ENTRIES_IN_WORD = 32,  /* entries of a mode of contacts in a word, two bits each */
    MOST_COUPLED = 4,      /* surfaces in play that act on each other; for more, Python searches the candidates */
    PAIR_ROWS = 64,        /* states and guards of a mode that is expanded in double-double */
    NOWHERE = -1,          /* instead of the guard last hit: none was hit, a guard is at zero where a step begins */
    UNCLEAR = -1,          /* instead of a mode's row: Python must decide, or the mode is not compiled */
    SELECTED = -1,         /* instead of a transition's kind: the selected mode is not compiled yet */
    SET_ASIDE = -1,        /* instead of a return code: Python must finish this point */
    UNCLEAR_SIGN = 2       /* sign of a number that may be zero */
};

/* Machine code of a mode (henon_ref.taylor.llvm). */

/* Compute Taylor coefficients, or values, at time t + t_low and state x, in a unit of time; row after row in out. */
typedef void (*expand_code)(double t, double t_low, double unit, const double *x, const double *constants, double *out);
/* Compute the change of each state, and a lower bound of each guard, on a step of theta units. */
typedef void (*step_end_code)(double theta, const double *c, double *out);
/* Compute scaled coefficients a and Bernstein coefficients b of a guard q on a step; return an enum roots_outcome. */
typedef int64_t (*bernstein_code)(const double *q, const double *powers, int64_t degree, double *a, double *b);

/* An operation of a tape. */
struct tape_operation {
    int64_t operation;       /* enum tape_kind */
    int64_t first, second;   /* operations that it reads; the second of a function is the factor of its derivative */
    int64_t constant, slope; /* constants that it reads */
    int64_t sign, divides;   /* of a function y of a: y' = sign a' factor; or y' factor = sign a' */
    int64_t degree;          /* in time; a large number if it is not a polynomial */
};

/* Field and guards of a mode as a list of operations, beginning with the states. Two lists of integers follow the
 * operations: those that are the derivatives of the states, and those that are the guards. */
struct tape {
    int64_t operations, constants, states, outputs;
    int64_t degree; /* of states and guards if they are polynomials in time; else 0 */
    struct tape_operation operation[];
};

/* A guard of a compiled mode. */
struct guard {
    int64_t kind;             /* enum guard_kind */
    int64_t index;            /* of the surface, or of the valid expression */
    int64_t valid;            /* whether the index is that of a valid expression */
    int64_t rising_only;      /* whether it may begin below zero, and counts only after it has risen */
    int64_t held;             /* whether it is the distance of a load from the limit of static friction */
    int64_t hold_zone;        /* whether a hold zone decides the mode after it */
    int64_t coupled;          /* COUPLED if its surface acts on one that the mode slides on, or the reverse; or
                                 RESETTING */
    int64_t mode_across;      /* row of the mode after a crossing or a release; -1 if not compiled */
    int64_t mode_stuck;       /* row of the mode that slides on its surface; -1 if not compiled */
    int64_t zeros_at_release; /* known zeros with which its surface is left; 0: by the normal velocities, or the guard
                                 is no release; -1: by the derivatives, as a body lifts off */
    int64_t side;             /* of its surface on which the mode is, -1 or +1; 0 if the guard is no surface's */
    int64_t to_sign;          /* entry of its surface after the event: the other side, or the side of the release */
    int64_t kink;             /* whether its surface is crossed whatever other surfaces do: the field is continuous
                                 there, or its normal velocity contains no sign */
    int64_t branches;         /* whether it has branch points of its own */
    expand_code jump;         /* map of its surface, if that resets the state and compiled code makes the jump */
};

/* A compiled mode and its guards; a row of the table of modes has room for G guards. */
struct mode {
    int64_t guards; /* number of guards */
    expand_code expansion;
    step_end_code step_end;
    expand_code normal_velocities; /* of each guard on a surface: speed towards it, and away from it beyond */
    expand_code rounding; /* bounds of the effects of rounding (given the rounding of one operation) and of underflow,
                             on each x' and then on each guard */
    bernstein_code bernstein;
    int64_t polynomial_degree; /* of the motion, if it is a polynomial that the expansion holds completely; else 0 */
    expand_code slopes;        /* values and first derivatives alone */
    const struct tape *tape;   /* for events that double-double decides; else null */
    int64_t branches;          /* whether the field or some guard has branch points */
    int64_t guards_branch;     /* whether some guard has branch points */
    int64_t number;            /* of the mode (henon_ref.modes.mode.mode_number) */
    int64_t surfaces;          /* of the system; 0, and no number, if it has too many for numbers */
    struct guard guard[];
};

/* Selection of a mode at an event of several surfaces. */
struct selection {
    expand_code velocities;  /* normal velocities of all surfaces, from states and signs; null: Python decides. With
                                static friction from states, signs and loads, followed by numbers of each contact */
    const double *constants; /* of the velocities */
    int64_t surfaces;
    int64_t decoupled; /* whether no normal velocity depends on the sign of another surface */
    const int64_t *contact; /* of each surface: bits of enum contact; null if none has static friction */
    const int64_t *beside;  /* (surfaces, surfaces): whether two act on each other; null if none has static friction */
};

/* The compiled modes for given parameter values. */
struct tables {
    const char *modes;     /* M records, each a struct mode with G guards */
    int64_t count;         /* M */
    const double *numbers; /* (M, tapes, length): constants of each mode's expansion, of its normal velocities, and of
                              the maps of resets; a tape's constants are followed by what their rounding to double
                              lost */
    int64_t tapes, length;
    struct selection selection;
    /* With many contacts a mode is a number, made of the entry of each contact. Rows 0, 1 and 2 are then the modes in
     * which every entry is -1, 0 and +1. A run assembles its mode's record and constants from these three; a guard's
     * mode_across and mode_stuck name the row from which the part of its contact comes next (kernel/contacts.c). */
    int64_t contacts;          /* number of contacts; 0 if a mode is a row */
    const int64_t *owned_ends; /* of each contact, the end of its places in "owned" */
    const int64_t *owned;      /* places in a row of "numbers", contact after contact */
};

/* Program for constants in parameters (henon_ref.integrator.constant_program), and their places (point_tables). */
struct program {
    const int64_t *operations; /* (count, 4): see run_operations */
    const double *registers;   /* (width, 3): all registers before a run, the inputs first */
    const int64_t *outputs;    /* (results): registers of the constants */
    const int64_t *sources;    /* (places): number written to each place: 0 for a zero, else 1 + 2 k for constant k, and
                                  2 + 2 k for what its rounding lost */
    int64_t count, width, inputs, results, places;
};

/* A recorded transition. */
struct transition {
    double time, time_low;      /* s, and what rounding lost of it */
    int32_t from_mode, to_mode; /* rows of the compiled modes; 0 with contacts */
    int16_t surface;
    int8_t kind;    /* enum transition_kind */
    int8_t landing; /* enum landing */
    double state[]; /* n; with contacts followed by the words of the mode before and after */
};

/* A recorded step. */
struct step {
    double time, time_low; /* s: start, and what rounding lost of it */
    double length;         /* s: length taken */
    double unit;           /* s: of the coefficients */
    int64_t mode;          /* row of the compiled modes; 0 with contacts */
    double coefficients[]; /* (n, order + 1): x_i(time + tau unit) = sum over k of coefficients[i, k] tau^k */
};

/* Scalars of a run, the same for every system; its vectors follow in the same block (struct places). */
struct run {
    double time, time_low;             /* s, and what rounding lost of it */
    double unit;                       /* s: of the expansion */
    double begin;                      /* s: start of the run */
    double rest_part;                  /* later flights that last at most this part of the run together are a rest */
    double event_time, event_time_low; /* s: last event */
    double suspect;                    /* s: place of an undecided event, from the step's start */
    double step_length;                /* s: length of a step that is undecided or OUT_OF_RANGE */
    double natural_length;             /* s: length of an undecided step before it was cut at the horizon */
    double longest_step;               /* s: limit of the first step in a mode, and of steps near branch points */
    double horizon, horizon_low;       /* s */
    double tolerance;                  /* local error, relative to each row's size on the step */
    int64_t mode, steps, expansions, guard_evaluations, transitions;
    int64_t below_rounding;            /* surfaces, and expressions that end the run, that were below their rounding */
    int64_t guard, landing;            /* last guard hit, and its landing */
    int64_t stalled;                   /* weighted count of steps that a double's time does not resolve */
    int64_t events_at_once;            /* consecutive events that a double's time does not resolve */
    int64_t next_sample;
    int64_t stepped_mode;              /* mode of the last step, -1 before the first */
    int64_t remembered;                /* number of modes of which the last step is kept */
    int64_t step_place;                /* place of the present mode among them */
    int64_t pending_kind;              /* kind of the event that leads to a mode without a row */
    int64_t pending_mode;              /* number of that mode; -1: the one across the guard last hit */
    int64_t event_pending;             /* 1 if the present event has not been processed yet, UNSETTLED if a mode that
                                          was not compiled kept double-double from deciding it */
    int64_t order;
    int64_t method;                    /* of landing */
    int64_t transition_capacity;       /* of a block of memory, in transitions */
    int64_t states, guards;            /* n and G */
    int64_t stop_falling, stop_rising; /* surfaces, one bit each, at which the run ends */
    int64_t stopped;                   /* 1 + the first of these surfaces that the run has reached; 0: none */
    int64_t more_digits;               /* 1 if the motion may be computed with more digits from the run's start, while
                                          the run is in its first mode */
    int64_t most_steps;                /* largest number of steps */
    int64_t within_range;              /* 1 + steps at which Python last found overflow and underflow negligible */
    double *dense;                     /* recorded steps; null: none are recorded */
    int64_t dense_steps, dense_capacity;
    int64_t contacts;                  /* number of contacts whose entries are the mode ("mode" is then 0), or 0 */
    int64_t constants;                 /* with contacts: doubles in a row of the modes' constants, of all tapes */
};

/* Places of the parts of a run's block of memory, in doubles from its begin (struct run). */
struct places {
    int64_t last_steps;   /* REMEMBERED_STEPS: last steps of modes [s] */
    int64_t state;        /* n: x; then n: what rounding lost of it; then n: x before the last jump */
    int64_t known_zeros;  /* G integers: known zeros of each guard, the order to which it vanishes at the present point
                             (1: its surface was just left with a speed, 2: tangentially), divided out; then G: 1 if the
                             guard is at zero; then G: 1 if the guard is below its own rounding on the present step */
    int64_t entries;      /* words: entries of the contacts, which are the mode; none without contacts */
    int64_t since;        /* G: first time at which each guard was below its rounding [s], infinite if it was not */
    int64_t end_of_state; /* a run's start defines all before this place; the rest is work space */
    int64_t band;         /* rows: Taylor coefficients of states and guards in the unit, then the norms of the last
                             ones; the same at the end of a step that is checked; work space of root isolation */
    int64_t width;        /* length of a row of the band */
    int64_t room;         /* 4 n + 6 G: change of the states over a step and lower bounds of the guards; a state; normal
                             velocities; rounding of slopes and guards. Or work space of mode selection */
    int64_t origin;       /* 3 n + 3: the motion from the run's start in double-double: time, and what rounding lost of
                             it; 1 if the motion is known; states, what rounding lost of them, bounds of their errors */
    int64_t remembered;   /* REMEMBERED_STEPS modes of which the run keeps the last step: rows, or words of entries */
    int64_t left;         /* with contacts: words of the mode that an event has ended */
    int64_t own;          /* with contacts: the present mode's record (struct mode) */
    int64_t constants;    /* with contacts: the present mode's constants */
    int64_t records;      /* CHUNK transitions (struct transition) */
    int64_t record_width; /* length of a transition */
    int64_t size;         /* of the whole block */
};

/* Progress of the runs of many points, and which transitions are kept. */
struct progress {
    double after;              /* s: transitions before this time are not kept */
    int64_t point;             /* present or next point */
    int64_t running;           /* whether its run has begun */
    int64_t kept, kept_before; /* transitions in the buffer, and those of all points before this one */
    int64_t open_sticks;       /* whether sticks that are open at "after" are kept, with their begin */
    int64_t steps;             /* steps after which the call returns for Python to check for interrupts */
    int64_t stop_aside;        /* whether the call returns when a point is set aside */
};

/* End of a point's run. */
struct end {
    double time, time_low; /* s */
    int64_t code;          /* enum return_code, or SET_ASIDE */
    int64_t mode;          /* row; 0 with contacts */
    int64_t steps, expansions, guard_evaluations, transitions;
};

/* Buffer for the transitions of many points. */
struct buffer {
    double *kept; /* (capacity, width): number of the point, an integer, then a struct transition */
    int64_t capacity, width;
    double *pending; /* (surfaces, width): the open stick of each surface, marked by a first number other than 0; only
                        sticks from before "after" */
    int64_t surfaces;
};

/* Many points of one system. */
struct points {
    int64_t count;
    double *block;           /* block of the present run, unchanged between calls until all points are done */
    const double *start;     /* begin of a run's block, except the point's own numbers */
    const double *numbers;   /* (count, 2 + n, 2): horizon, initial time [s] and states, each with what rounding lost */
    int64_t *rows;           /* row of the mode at the start, or the words of its entries, which those of the mode at
                                the end overwrite; -1: the point is set aside */
    const int64_t *surfaces; /* surface on which the point starts, -1 if on none; "rows" then holds the mode below it */
    int64_t numbers_step;    /* doubles from one point's constants to the next point's; 0: the same for all */
    struct end *ends;        /* filled in */
    double *states;          /* (count, n): states at the ends, filled in */
};

/* First falling root: an enum roots_outcome, and the interval that contains it (equal ends if the root is exact). */
struct first_root {
    int64_t outcome;
    double low, high;
};

/* A root, the method of landing used, and the number of evaluations of the polynomial (with its derivatives, one). */
struct landed {
    double tau;
    int64_t used, evaluations;
};

/* Bounds and levels that Python reads, too. */
struct levels {
    double eps;              /* distance from 1 to the next double */
    double blown_up;         /* a larger state has blown up */
    double state_rounding;   /* relative error that a state may have */
    double known_zero_level; /* known zeros of order m are divided out if coefficients 0 to m - 1 are below this part of
                                coefficient m */
    double operation_error;  /* bound of the relative error of one operation in double-double */
    double accurate;         /* largest relative error of a constant */
    double clearance;        /* a touch is no larger than this multiple of the noise */
    double no_account;       /* smaller absolute errors are negligible */
    double equal_part;       /* a force that differs from the friction by no more than this part of it equals it */
    double held_tolerances;  /* a constant held load exceeds its limit by no more than this many tolerances */
};

HENON_EXPORT struct levels levels(void);
HENON_EXPORT struct places places_of(int64_t states, int64_t guards, int64_t order, int64_t contacts,
                                     int64_t constants);
HENON_EXPORT int64_t row_length(int64_t order);
HENON_EXPORT int64_t words_of(int64_t contacts);

HENON_EXPORT int64_t advance(struct run *run, const struct tables *tables, double *samples, int64_t count);
HENON_EXPORT int64_t whole_run(struct run *run, const struct run *start, const struct tables *tables);
HENON_EXPORT int64_t run_points(struct progress *progress, const struct points *points, const struct tables *tables,
                                const struct buffer *buffer);
HENON_EXPORT void keep_transitions(struct progress *progress, const double *records, int64_t count,
                                   const struct buffer *buffer);
HENON_EXPORT int64_t start_run(struct run *run, const double *template, const struct tables *tables,
                               const struct program *program, int64_t surfaces, const char *numbers, double *room);
HENON_EXPORT int64_t enter_at_start(struct run *run, const struct tables *tables, const int64_t *mode, int64_t surface);
HENON_EXPORT int64_t events_accumulate(struct run *run);
HENON_EXPORT int64_t rounding_place(int64_t valid, int64_t index, int64_t guards);

HENON_EXPORT void run_operations(const int64_t *operations, int64_t count, double *registers, int64_t width,
                                 int64_t points);
HENON_EXPORT struct tables *point_tables(const struct tables *template, const struct program *program,
                                         const char *inputs, double *block);
HENON_EXPORT void signs_of(const double *registers, int64_t width, int64_t points, const int64_t *sources,
                           int64_t count, int64_t *signs);

/* Parts that tests call on their own: the functions of these names without "test_". */
HENON_EXPORT int64_t test_positive_by_bound(const double *q, const double *powers, int64_t degree);
HENON_EXPORT struct first_root test_first_falling_root(const double *a, int64_t degree, double *stack, int64_t width);
HENON_EXPORT struct landed test_land(const double *q, int64_t degree, double low, double high, int64_t method);
HENON_EXPORT struct landed test_brent(const double *q, int64_t degree, double low, double high);
HENON_EXPORT int64_t test_select_mode(struct run *run, const struct tables *tables);
HENON_EXPORT int64_t test_clearly_solved(int64_t count, const double *a, const double *m, const double *lower,
                                         const double *upper, int64_t *entries);

#endif
