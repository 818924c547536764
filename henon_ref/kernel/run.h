/* Structures of a run, and of the runs of many points, that the compiled loop and Python share (see kernel.h). */
#ifndef HENON_RUN_H
#define HENON_RUN_H

#include <stdint.h>

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
    int64_t stepping;                  /* enum stepping */
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
    int64_t room;         /* 4 n + 5 G: change of the states over a step and lower bounds of the guards; a state; normal
                             velocities; rounding of the slopes. Or work space of mode selection */
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

/* End of a point's run. */
struct end {
    double time, time_low; /* s */
    int64_t code;          /* enum return_code, or SET_ASIDE */
    int64_t mode;          /* row; 0 with contacts */
    int64_t steps, expansions, guard_evaluations, transitions;
};

/* Many points of one system. */
struct points {
    int64_t count;
    int64_t next;            /* first point whose run has not begun */
    const double *start;     /* begin of a run's block, except the point's own numbers */
    const double *numbers;   /* (count, 2 + n, 2): horizon, initial time [s] and states, each with what rounding lost */
    int64_t *rows;           /* row of the mode at the start, or the words of its entries, which those of the mode at
                                the end overwrite; -1: the point is set aside */
    const int64_t *surfaces; /* surface on which the point starts, -1 if on none; "rows" then holds the mode below it */
    int64_t numbers_step;    /* doubles from one point's constants to the next point's; 0: the same for all */
    struct end *ends;        /* filled in */
    double *states;          /* (count, n): states at the ends, filled in */
    double after;            /* s: transitions before this time are not kept */
    int64_t open_sticks;     /* whether sticks that are open at "after" are kept, with their begin */
    int64_t steps;           /* steps after which the call returns for Python to check for interrupts */
    int64_t stop_aside;      /* whether the call returns when a point is set aside */
    int64_t width;           /* of a row of "kept" and "pending" in struct slot */
    int64_t surface_count;
};

/* One of the runs in progress, which takes one point after another. */
struct slot {
    double *block;             /* of the run, unchanged between calls until all points are done */
    int64_t code;              /* enum slot_code */
    int64_t point, running;    /* present point, and whether its run is in progress */
    double *kept;              /* (capacity, width): number of the point, an integer, then a struct transition */
    int64_t capacity;
    int64_t filled, finished;  /* rows of "kept" that are filled, and those of points that are done */
    double *pending;           /* (surface_count, width): the open stick of each surface, marked by a first number other
                                  than 0; only sticks from before "after" */
};

#endif
