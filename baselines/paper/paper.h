/* The paper's two programs: its method, implemented correctly (henon-rk4), and the appendix as printed (henon-listing).

   This header defines the interface to Python (baselines/paper/__init__.py reads it). Times are in s. */
#ifndef HENON_PAPER_H
#define HENON_PAPER_H

#include <stdint.h>

/* Machine code of a tape. It writes a copy of x, followed by the outputs at (t_hi + t_lo, x), to `values`.
   `constants` are the tape's constants rounded to double, followed by their rounding remainders. */
typedef void (*rk4_values)(double t_hi, double t_lo, double unit, const double *x, const double *constants,
                           double *values);

/* One mode of a Filippov system. */
struct rk4_mode {
    int64_t states;               /* n */
    int64_t guards;               /* m */
    rk4_values field;             /* n outputs: x' */
    rk4_values guard;             /* m outputs: the guards, positive inside the mode */
    const double *field_constants;
    const double *guard_constants;
    const uint8_t *rising_only;   /* (m): whether the guard counts only once it has been positive */
};

enum rk4_ending {
    RK4_DONE = 0,
    RK4_EVENT = 1,       /* the next step crosses a guard */
    RK4_NOT_FINITE = 2,  /* the next step's end is not finite */
    RK4_NO_GUARD = 3     /* a guard is not a number at the next step's end */
};

/* Steps k = first ... last - 1 of one mode, from base + k h to base + (k + 1) h. */
struct rk4_steps {
    double base, h;
    int64_t first, last;
    double *x;              /* (n): state before the step */
    double *new_state;      /* (n): state after the step */
    uint8_t *armed;         /* (m): whether the guard has been positive in this mode */
    const double *wanted;   /* (count): times of samples */
    int64_t count;
    double *samples;        /* (count, n) */
    int64_t filled;         /* number of samples filled */
    double *room;           /* (4 n + m): work space */
};

/* Take one step of length h from (t, x) and write the state to `out`; `room` as above. */
void rk4_step(const struct rk4_mode *mode, double *room, double t, const double *x, double h, double *out);

/* Write a copy of x, followed by the guards at (t, x), to `out` (n + m numbers). */
void rk4_guards(const struct rk4_mode *mode, double t, const double *x, double *out);

/* Take the steps up to `last`, or up to a step that is an event or not finite; return an rk4_ending.
   Updates `first` (number of steps done), `x`, `armed`, `samples` and `filled`. */
int64_t rk4_advance(const struct rk4_mode *mode, struct rk4_steps *steps);

/* Parameters of Fig. 8. */
struct belt {
    double m, k1, k2, mu0, vp, A, w;
};

struct belt_state {
    double time, position, velocity;
};

struct mode_change {
    double step, time, position, velocity, mode;
};

/* Mistakes of the appendix that change its result; DEFECTS of listing.py describes them. */
struct defects {
    uint8_t aliased_steps, one_sided_release, exit_side, frozen_forcing, frozen_tangent, quantised_release,
        landing_sign, rounded_sixth;
};

struct listing_end {
    int64_t changes, path, slips, landings, mode;
};

/* Run the program of the appendix with some of its mistakes from *x, which is updated: `passes` passes of its loop, or
   up to the time `until`, or until `changes`, with room for `changes_room` changes of mode, is full. `edges` are the
   six tangent points, highest first; `path` has room for `path_room` states, one per pass from `path_from` on. */
struct listing_end listing_run(struct belt_state *x, int64_t sticking, int64_t passes, double until, double h,
                               const double *edges, const struct belt *belt, const struct defects *defects,
                               struct mode_change *changes, int64_t changes_room, struct belt_state *path,
                               int64_t path_room, double path_from);

/* Name and version of the compiler. */
const char *paper_compiler(void);

#endif
