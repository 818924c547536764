/* What the compiled loop and Python share: structures, numbers with names, and the functions that Python calls.
 *
 * The compiler reads this file, and so does cffi (henon_ref.kernel.library), from which NumPy's record types are made
 * (henon_ref.kernel.shared): there is no second description. Lengths of arrays: n states, G guards of the largest
 * mode, M modes that are compiled. Times are in seconds; the "unit" is the unit of time in which a run's Taylor
 * coefficients are, about the size of a step.
 */
#ifndef HENON_KERNEL_H
#define HENON_KERNEL_H

#include <stdint.h>

/* Python sees it, and calls from within stay within: "protected", as the C library has an advance() of its own. */
#ifdef __ELF__
#define HENON_EXPORT __attribute__((visibility("protected")))
#else
#define HENON_EXPORT __attribute__((visibility("default")))
#endif

/* Kinds of guards. VALID is every guard at which the run ends: a valid expression, "attracts", and any guard of
 * henon_ref.modes.equations that has "ends", a surface's as well. */
enum guard_kind { SURFACE, RELEASE, VALID };

/* Kinds of transitions. */
enum transition_kind { STICK, RELEASED, CROSSING, GRAZE, RESET };

/* Surfaces whose event is not decided by two normal velocities alone: they act on each other, or reset the state. */
enum coupling { UNCOUPLED, COUPLED, RESETTING };

/* What is known of a surface in a system with static friction: whether it is a contact that has some, and then how its
 * load grows with its acceleration, and what a load does; whether it is no contact, no force acting on its velocity. */
enum contact { FIXED = 1, KNOWN_INERTIA = 2, BY_LOAD = 4, SECTION = 8 };

/* Ways of landing. */
enum landing { HENON, NEWTON, BRENT, BRACKET };

/* What a search for the first falling root comes to (SUBDIVIDE: the signs leave it open). */
enum roots_outcome { NO_ROOT, ROOT, TANGENTIAL, SUBDIVIDE };

/* Operations of programs in double-double; POWER has a whole number in place of its second register. */
enum operation { ADD, MULTIPLY, POWER, SQRT };

/* Operations of tapes (henon_ref.taylor.tape), by the names that they have there; a square is a product. */
enum tape_kind {
    TAPE_STATE, TAPE_CONSTANT, TAPE_CLOCK, TAPE_ADD, TAPE_SUB, TAPE_SCALE, TAPE_SHIFT, TAPE_RSUB, TAPE_MUL, TAPE_DIV,
    TAPE_RECIP, TAPE_SQRT, TAPE_POWER, TAPE_EXP, TAPE_LOG, TAPE_SIN, TAPE_COS
};

/* Why the compiled loop returned; the last two are its own: an event is to be gone through, or there is nothing to
 * say. */
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

/* Why the runs of many points come back: all points are done; there may be no room for the next transitions; Python may
 * look at interrupts; a point was set aside, perhaps for a mode that can be compiled before the next one. */
enum points_code { DONE, BUFFER_FULL, PAUSE, ASIDE };

enum {
    REMEMBERED_STEPS = 64, /* modes of which a run keeps the last step, the first that it comes to: one seen before
                              begins with it */
    CHUNK = 1024,          /* transitions kept in one block of memory */
    DEPTH = 64,            /* pieces that root isolation keeps at once: as many halvings as a double has room for */
    ALIGNMENT = 8,         /* doubles in a line of the processor's cache: the parts of a block begin with one */
    LANES = 4,             /* doubles in a vector: rows of coefficients are whole vectors, padded with zeros */
    MOST_SURFACES = 39,    /* with more an integer holds no number of a mode that is a row */
    MOST_IN_GROUP = 64,    /* contacts that act on each other and are decided together */
    ENTRIES_IN_WORD = 32,  /* entries of a mode of contacts, two bits each */
    MOST_COUPLED = 4,      /* surfaces in play that act on each other; with more the candidates are searched, not
                              tried (Python does) */
    PAIR_ROWS = 64,        /* states and guards of a mode that is gone through in double-double */
    NOWHERE = -1,          /* in place of the guard last hit: nothing was hit, one is at zero where a step begins */
    UNCLEAR = -1,          /* in place of a mode's row: Python has to decide, or the mode is not compiled */
    SELECTED = -1,         /* in place of a transition's kind: a mode that was selected is not compiled yet */
    SET_ASIDE = -1,        /* in place of a return code: Python has to do this point */
    UNCLEAR_SIGN = 2       /* of a number that may be zero */
};

/* Machine code of a mode (henon_ref.taylor.llvm, henon_ref.roots.bernstein). */

/* Taylor coefficients, or values, at time t + t_low and state x, in a unit of time; rows one after the other in out. */
typedef void (*expand_code)(double t, double t_low, double unit, const double *x, const double *constants, double *out);
/* Of a step of theta units: change of each state, and a bound from below for each guard. */
typedef void (*step_end_code)(double theta, const double *c, double *out);
/* Scaled coefficients a and Bernstein coefficients b of a guard q on a step, and what their signs tell. */
typedef int64_t (*bernstein_code)(const double *q, const double *powers, int64_t degree, double *a, double *b);

/* An operation of a tape. */
struct tape_operation {
    int64_t operation;       /* enum tape_kind */
    int64_t first, second;   /* operations that it reads; of a function the second is its derivative's factor */
    int64_t constant, slope; /* constants that it reads */
    int64_t sign, divides;   /* of a function y of a: y' = sign a' factor; or y' factor = sign a' */
    int64_t degree;          /* in time; a large number for what is no polynomial */
};

/* Field and guards of a mode as a list of operations, the states first. Behind them stand, as integers, those that are
 * the states' derivatives, and those that are guards. */
struct tape {
    int64_t operations, constants, states, outputs;
    int64_t degree; /* of states and guards where they are polynomials in time; else 0 */
    struct tape_operation operation[];
};

/* A guard of a compiled mode. */
struct guard {
    int64_t kind;             /* enum guard_kind */
    int64_t index;            /* of the surface, or of the valid expression */
    int64_t valid;            /* whether the index is that of a valid expression */
    int64_t rising_only;      /* whether it may begin below zero, and counts once it has risen */
    int64_t hold_zone;        /* whether the mode after it is decided by a hold zone */
    int64_t coupled;          /* COUPLED where its surface and one that the mode slides on act on each other; or
                                 RESETTING */
    int64_t mode_across;      /* row of the mode after a crossing or a release; -1 where not compiled */
    int64_t mode_stuck;       /* row of the mode that slides on its surface; -1 where not compiled */
    int64_t zeros_at_release; /* with which its surface is left; 0: by the normal velocities, or the guard is no
                                 release; -1: by the derivatives, as a body lifts off */
    int64_t side;             /* of its surface on which the mode is, -1 or +1; 0 for guards that are no surface's */
    int64_t to_sign;          /* entry of its surface beyond it: the other side, or the one that it is released into */
    int64_t kink;             /* whether its surface is crossed whatever happens beside it: the field is continuous
                                 there, or no sign is in its normal velocity */
    int64_t branches;         /* whether it has branch points of its own */
    expand_code jump;         /* the map of its surface, if that resets the state and compiled code makes the jump */
};

/* A compiled mode, with its guards: a row of the modes' table has room for G. */
struct mode {
    int64_t guards; /* how many there are */
    expand_code expansion;
    step_end_code step_end;
    expand_code normal_velocities; /* of each guard on a surface: speed towards it, and away from it beyond */
    expand_code rounding; /* bounds of what the operations' own rounding, by the unit, and underflow make of each x', and
                             of each guard, one after the other */
    bernstein_code bernstein;
    int64_t polynomial_degree; /* of the motion, if that is a polynomial which the expansion holds whole; else 0 */
    expand_code slopes;        /* where there are branch points, the first coefficients alone */
    const struct tape *tape;   /* where what double precision does not decide is gone through in double-double; else
                                  null */
    int64_t guards_branch;     /* whether some guard has branch points */
    int64_t number;            /* of the mode (henon_ref.modes.mode.mode_number) */
    int64_t surfaces;          /* of the system; 0, and no number, where there are more than numbers are for */
    struct guard guard[];
};

/* What decides an event of several surfaces. */
struct selection {
    expand_code velocities;  /* normal velocities of all surfaces, in states and signs; null: Python decides. In a system
                                with static friction in states, signs and loads, and numbers of each contact behind
                                them */
    const double *constants; /* theirs */
    int64_t surfaces;
    int64_t decoupled; /* whether no normal velocity has the sign of another surface in it */
    const int64_t *contact; /* of each surface bits of enum contact; null where none has static friction */
    const int64_t *beside;  /* (surfaces, surfaces): whether two act on each other, likewise */
};

/* The compiled modes at given parameter values. */
struct tables {
    const char *modes;     /* M records: a struct mode with G guards each */
    int64_t count;         /* M */
    const double *numbers; /* (M, tapes, length): constants of each mode's expansion, of its normal velocities, and of
                              the maps of resets; behind them what their rounding to double lost */
    int64_t tapes, length;
    struct selection selection;
    /* Of many contacts a mode is the entry of each, a number. Rows 0, 1 and 2 are then those
     * in which every entry is -1, 0 and +1; a run puts its mode's record and constants together from these three, and
     * a guard's mode_across and mode_stuck say from which one its contact's part comes next (kernel/contacts.c). */
    int64_t contacts;          /* how many; 0 where a mode is a row */
    const int64_t *owned_ends; /* of each contact, where its constants end among the next ones */
    const int64_t *owned;      /* places in a row of "numbers", contact by contact */
};

/* Constants in parameters as a program (henon_ref.integrator.constant_program), and where they go (point_tables). */
struct program {
    const int64_t *operations; /* (count, 4): see run_operations */
    const double *registers;   /* (width, 3): all of them before a run, the inputs first */
    const int64_t *outputs;    /* (results): registers of the constants */
    const int64_t *sources;    /* (places): of each place the number that is put there: 0 for a zero, else 1 + 2 k for
                                  constant k, and 2 + 2 k for what its rounding lost */
    int64_t count, width, inputs, results, places;
};

/* A transition that is written down. */
struct transition {
    double time, time_low;      /* s, and what rounding it lost */
    int32_t from_mode, to_mode; /* rows of the compiled modes; where modes are entries of contacts, 0 */
    int16_t surface;
    int8_t kind;    /* enum transition_kind */
    int8_t landing; /* enum landing */
    double state[]; /* n; where modes are entries of contacts, behind it the words of the mode before and after */
};

/* A step that was taken. */
struct step {
    double time, time_low; /* s: its start, and what rounding it lost */
    double length;         /* s: taken */
    double unit;           /* s: of the coefficients */
    int64_t mode;          /* row of the compiled modes; where modes are entries of contacts, 0 */
    double coefficients[]; /* (n, order + 1): x_i(time + tau unit) = sum over k of coefficients[i, k] tau^k */
};

/* A run's scalars, the same for every system; the vectors stand behind them (struct places). */
struct run {
    double time, time_low;             /* s, and what rounding it lost */
    double unit;                       /* s: of the expansion */
    double begin;                      /* s: of the run */
    double rest_part;                  /* of the run that later flights may last together where impacts have come to
                                          their limit */
    double event_time, event_time_low; /* s: last event */
    double suspect;                    /* s: where an undecided event is, from the step's start */
    double step_length;                /* s: of an undecided step, or one that is OUT_OF_RANGE */
    double longest_step;               /* s: that a mode just entered, or one with branch points, may begin with */
    double horizon, horizon_low;       /* s */
    double tolerance;                  /* local error, relative to each row's size on the step */
    int64_t mode, steps, expansions, guard_evaluations, transitions;
    int64_t below_rounding;            /* surfaces, and expressions of the model's end, that have been below their
                                          rounding */
    int64_t guard, landing;            /* last guard hit, and its landing */
    int64_t stalled;                   /* steps that time cannot tell apart */
    int64_t events_at_once;            /* events that it cannot tell apart */
    int64_t next_sample;
    int64_t stepped_mode;              /* mode of the last step, -1 before the first */
    int64_t remembered;                /* modes of which the last step is kept */
    int64_t step_place;                /* of the present one among them */
    int64_t pending_kind;              /* of the event that leads to a mode without a row */
    int64_t pending_mode;              /* number of that mode; -1: the one behind the guard last hit */
    int64_t event_pending;             /* 1 where the event that the run stands at is still to be gone through */
    int64_t order;
    int64_t method;                    /* of landing */
    int64_t transition_capacity;       /* of a block of memory */
    int64_t states, guards;            /* n and G */
    int64_t stop_falling, stop_rising; /* surfaces, a bit each, on which the run ends */
    int64_t stopped;                   /* 1 once it has come to one */
    int64_t more_digits;               /* 1 where multiprecision may go from the start to where the run is in its first
                                          mode */
    int64_t most_steps;                /* after which the run is to end */
    int64_t within_range;              /* 1 + steps at which Python last saw that what has left the range of doubles is
                                          of no account */
    double *dense;                     /* where steps are kept; null: they are not */
    int64_t dense_steps, dense_capacity;
    int64_t contacts;                  /* whose entries the mode is ("mode" is then 0); 0: a mode is a row */
    int64_t constants;                 /* doubles of a row of the modes' constants, of all tapes; without contacts 0 */
};

/* Where the parts of a run's block of memory stand, in doubles from its begin (struct run). */
struct places {
    int64_t last_steps;   /* REMEMBERED_STEPS: last step of modes [s] */
    int64_t state;        /* n: x; then n: what rounding it lost; then n: x before the last jump */
    int64_t known_zeros;  /* G integers: known zeros of each guard: the order to which it vanishes where the run stands
                             (1: its surface was just left with a speed, 2: tangentially),
                             divided out; then G: 1 for one that is at zero; then G: 1 for one that is below its own
                             rounding on the present step */
    int64_t entries;      /* words: the entries of contacts that are the mode, none without contacts */
    int64_t since;        /* G: since when guards have been below their rounding [s], infinite where they have not */
    int64_t end_of_state; /* all before this is what a run's start says; what follows is work space */
    int64_t band;         /* rows: Taylor coefficients of states and guards in the unit, then the norms of the last
                             ones; the same at the end of a step that is checked; what isolating roots needs */
    int64_t width;        /* length of a row of the band */
    int64_t room;         /* 3 n + 5 G: change of the states over a step and bounds of the guards from below; a state;
                             normal velocities. Or what the selection of a mode needs */
    int64_t origin;       /* 3 n + 3: the motion from the run's start in double-double: time, and what rounding lost of
                             it; 1 where it is known; states, what rounding lost of them, bounds of their errors */
    int64_t remembered;   /* REMEMBERED_STEPS modes whose last step the run keeps: rows, or words of entries */
    int64_t left;         /* with contacts: words of the mode that an event has ended */
    int64_t own;          /* with contacts: the present mode's record (struct mode) */
    int64_t constants;    /* with contacts: its constants */
    int64_t records;      /* CHUNK transitions (struct transition), one after the other */
    int64_t record_width; /* length of one */
    int64_t size;         /* of the whole block */
};

/* Where the runs of many points stand, and what is to be kept. */
struct progress {
    double after;              /* s: transitions before this time are not kept */
    int64_t point;             /* that is at work, or comes next */
    int64_t running;           /* whether its run has begun */
    int64_t kept, kept_before; /* transitions in the buffer, and those of the points before this one */
    int64_t open_sticks;       /* whether sticks that are open at "after" are kept, with their begin */
    int64_t steps;             /* after which the call comes back, so that Python can look at interrupts */
    int64_t stop_aside;        /* whether it comes back where a point is set aside */
};

/* How the run of a point ended. */
struct end {
    double time, time_low; /* s */
    int64_t code;          /* of return, or SET_ASIDE */
    int64_t mode;          /* its row; where modes are entries of contacts, 0 */
    int64_t steps, expansions, guard_evaluations, transitions;
};

/* Where transitions of many points go. */
struct buffer {
    double *kept; /* (capacity, width): number of the point, an integer, then a struct transition */
    int64_t capacity, width;
    double *pending; /* (surfaces, width): per surface the stick that is open, its first number not 0; those before
                        "after" only */
    int64_t surfaces;
};

/* Many points of one system. */
struct points {
    int64_t count;
    double *block;           /* of a run, which must be the same until all points are done */
    const double *start;     /* what a run's block begins with, but for the point's own numbers */
    const double *numbers;   /* (count, 2 + n, 2): horizon, initial time [s] and states, each with what rounding lost */
    int64_t *rows;           /* row of the mode at the start, or the words of its entries, which those of the mode at
                                the end overwrite; -1: the point is set aside */
    const int64_t *surfaces; /* surface on which the point starts, -1 where it is on none; "rows" then has the mode
                                below it */
    int64_t numbers_step;    /* doubles from one point's constants to the next one's; 0: all the same */
    struct end *ends;        /* filled */
    double *states;          /* (count, n): filled with the states there */
};

/* The first falling root: an enum roots_outcome, and the interval that it lies in (equal ends where it was hit). */
struct first_root {
    int64_t outcome;
    double low, high;
};

/* A root, the way of landing that was used, and evaluations of the polynomial (its derivatives counted as one). */
struct landed {
    double tau;
    int64_t used, evaluations;
};

/* Bounds and levels that Python reads, too. */
struct levels {
    double eps;              /* distance from 1 to the next double */
    double blown_up;         /* a state beyond this has blown up */
    double state_rounding;   /* part of its size by which a state may be off */
    double known_zero_level; /* up to this part of what follows them, coefficients of known zeros are divided out */
    double operation_error;  /* bound of the relative error of one operation in double-double */
    double accurate;         /* bound of the relative error that a constant may have */
    double clearance;        /* a touch is no larger than so many times noise */
    double no_account;       /* what is below this is of no account */
};

HENON_EXPORT struct levels levels(void);
HENON_EXPORT struct places places_of(int64_t states, int64_t guards, int64_t order, int64_t contacts,
                                     int64_t constants);
HENON_EXPORT int64_t row_length(int64_t order);
HENON_EXPORT int64_t words_of(int64_t contacts);

HENON_EXPORT int64_t advance(struct run *run, const struct tables *tables, double *samples, int64_t count);
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

/* Parts that tests call by themselves: the functions of these names, without "test_". */
HENON_EXPORT int64_t test_positive_by_bound(const double *q, const double *powers, int64_t degree);
HENON_EXPORT struct first_root test_first_falling_root(const double *a, int64_t degree, double *stack, int64_t width);
HENON_EXPORT struct landed test_land(const double *q, int64_t degree, double low, double high, int64_t method);
HENON_EXPORT struct landed test_brent(const double *q, int64_t degree, double low, double high);
HENON_EXPORT int64_t test_select_mode(struct run *run, const struct tables *tables);
HENON_EXPORT int64_t test_clearly_solved(int64_t count, const double *a, const double *m, const double *lower,
                                         const double *upper, int64_t *entries);

#endif
