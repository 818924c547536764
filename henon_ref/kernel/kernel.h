/* Structures, enumerations and functions that the compiled loop and Python share.
 *
 * The compiler reads this file, and so does henon_ref.kernel.library, which derives NumPy's record types from it,
 * so that there is no second description. Lengths of arrays: n states, G guards of the largest mode, M compiled modes.
 * Times are in seconds; the "unit" is the unit of time of a run's Taylor coefficients, about the size of a step.
 */
#ifndef HENON_KERNEL_H
#define HENON_KERNEL_H

#include <stdint.h>

#include "run.h"

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

/* Reasons for which the compiled loop returns. Only the loop and the runs of many points use the last three: process an
 * event; continue; a step may be taken together with those of other runs. */
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
    BEYOND,
    EVENT = 20,
    ON = 21,
    BEFORE_STEP = 22
};

/* What a slot does when the runs of many points return: no point is left; its buffer may be too small for the next
 * transitions; a point was set aside, perhaps for a mode that Python can compile; it runs a point, or takes its next
 * step together with other slots (Python can check for interrupts). */
enum slot_code { DONE, BUFFER_FULL, ASIDE, RUNNING, WAITING };

/* How a run computes the coefficients of its next step: by itself, as those of all steps; together with other runs;
 * once by itself; not at all, since it has been done together with other runs. */
enum stepping { ALONE, TOGETHER, ONCE_ALONE, FROM_LANES };

enum {
    UNSETTLED = 2,         /* value of event_pending in struct run */
    REMEMBERED_STEPS = 64, /* modes of which a run keeps the last step, in the order of their first entry; a mode that
                              is entered again begins with its last step */
    CHUNK = 1024,          /* transitions in one block of memory */
    DEPTH = 64,            /* pieces that root isolation keeps at once: one per halving that a double can resolve */
    ALIGNMENT = 8,         /* doubles in a line of the processor's cache; the parts of a block begin with a line */
    LANES = 4,             /* doubles in a vector; rows of coefficients are whole vectors, padded with zeros */
    SLOTS = 16,            /* runs that are in progress at once; more than LANES, so that many are in the same mode */
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
/* The same for LANES runs in the lanes of vectors; times: t of each, then t_low, then the unit. */
typedef void (*lanes_code)(const double *times, const double *const *x, const double *const *constants,
                           double *const *out);
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
                                 is no release; -k: by derivatives from the k-th on (a lift-off) */
    int64_t side;             /* of its surface on which the mode is, -1 or +1; 0 if the guard is no surface's */
    int64_t to_sign;          /* entry of its surface after the event: the other side, or the side of the release */
    int64_t kink;             /* whether its surface is crossed whatever other surfaces do: the field is continuous
                                 there, or its normal velocity contains no sign */
    int64_t branches;         /* whether it has branch points of its own */
    int64_t put_on;           /* state that is put on its surface where an event ends the mode; -1: none */
    expand_code jump;         /* map of its surface, if that resets the state and compiled code makes the jump */
};

/* A compiled mode and its guards; a row of the table of modes has room for G guards. */
struct mode {
    int64_t guards; /* number of guards */
    expand_code expansion;
    lanes_code lanes;      /* null: not compiled */
    step_end_code step_end;
    expand_code normal_velocities; /* of each guard on a surface: speed towards it, and away from it beyond; of a guard
                                      with put_on: distance of that state from the surface, and 0 */
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
HENON_EXPORT int64_t run_points(struct slot *slots, int64_t count, struct points *points, const struct tables *tables);
HENON_EXPORT void keep_transitions(struct slot *slot, const struct points *points, const double *records,
                                   int64_t count);
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
