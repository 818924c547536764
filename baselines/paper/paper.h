/* The paper's two programs, compiled: its method done right (henon-rk4), and the appendix as printed (henon-listing).

   This header is the one description of what Python hands over (baselines/paper/compiled.py reads it). Times are in s. */
#ifndef HENON_PAPER_H
#define HENON_PAPER_H

#include <stdint.h>

/* Machine code of a tape: values of its outputs at (t_hi + t_lo, x), behind a copy of x.
   `constants` are those of the tape rounded to double, then what that rounding lost. */
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
    const uint8_t *rising_only;   /* (m): the guard may be negative until it has been positive */
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
    double *x;              /* (n): the state before the step */
    double *new_state;      /* (n): the state after it */
    uint8_t *armed;         /* (m): whether the guard has been positive in this mode */
    const double *wanted;   /* (count): times of samples */
    int64_t count;
    double *samples;        /* (count, n) */
    int64_t filled;         /* samples there are by now */
    double *room;           /* (4 n + m): what the steps work with */
};

/* One step of length h from (t, x), written to `out`; `room` as above. */
void rk4_step(const struct rk4_mode *mode, double *room, double t, const double *x, double h, double *out);

/* Guards at (t, x), written to out[n] ... out[n + m - 1], behind a copy of x. */
void rk4_guards(const struct rk4_mode *mode, double t, const double *x, double *out);

/* Steps until `last`, or until one that does not count: an rk4_ending.
   Moves `first` to the steps done, and `x`, `armed`, `samples`, `filled`. */
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

struct listing_end {
    int64_t changes, mode, slips, landings;
};

/* The appendix as printed: `passes` passes of its loop from *x, which is moved.
   `edges`: the six tangent points, highest first. `changes` has room for `changes_room` changes of mode, `path` for
   `path_room` states, one a pass. */
struct listing_end listing_run(struct belt_state *x, const double *edges, double h, int64_t passes,
                               const struct belt *belt, struct mode_change *changes, int64_t changes_room,
                               struct belt_state *path, int64_t path_room);

/* Each mistake of the appendix that changes what it computes; in words: DEFECTS of listing_variants.py. */
struct defects {
    uint8_t aliased_steps, one_sided_release, exit_side, frozen_forcing, frozen_tangent, quantised_release,
        landing_sign, rounded_sixth;
};

enum variant_ending { VARIANT_DONE = 0, VARIANT_CHATTERS = 1, VARIANT_NOT_FINITE = 2 };

struct variant_end {
    int64_t changes, path, ending;
};

/* The same program with some of the mistakes, from *x to the time `until`; the path is kept from `path_from` on. */
struct variant_end variant_run(struct belt_state *x, int64_t sticking, double until, double h, const double *edges,
                               const struct belt *belt, const struct defects *defects, struct mode_change *changes,
                               int64_t changes_room, struct belt_state *path, int64_t path_room, double path_from);

/* What compiled this: name and version. */
const char *paper_compiler(void);

#endif
