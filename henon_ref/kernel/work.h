/* Work space of a run: the parts of its block of memory, and the compiled modes. */
#ifndef HENON_WORK_H
#define HENON_WORK_H

#include <stddef.h>

#include "kernel.h"
#include "numbers.h"

/* Rows that root isolation needs in the band: powers, a scaled guard, and pieces. */
#define ROOT_ROWS (4 + DEPTH)
/* Sizes of a transition and of a stored step before the state or the coefficients, in doubles. */
#define TRANSITION_PLACES ((int64_t)(offsetof(struct transition, state) / sizeof(double)))
#define STEP_PLACES ((int64_t)(sizeof(struct step) / sizeof(double)))
/* Relative normal velocity below which Python selects the mode of a contact. */
#define TANGENT 1e-9
/* A guard, or a coefficient, is clearly not zero above this part of the sum of its terms' sizes on a step. */
#define CLEARLY_ABOVE 1e-9
/* A larger state has blown up (no smaller bound is safe in all units). */
#define BLOWN_UP 1e100
/* Relative error that a state may have: at least sixteen units in its last place. */
#define STATE_ROUNDING (16.0 * EPS)
/* Relative rounding error of one operation of an expression: a fourth of that, because an expression has several. */
#define OWN_ROUNDING (0.25 * STATE_ROUNDING)
/* Smaller absolute errors are negligible: doubles lose their digits below 1e-308. */
#define NO_ACCOUNT 0x1p-1000

/* Parts of a run's block (struct places), the compiled modes, and the present mode. */
struct work {
    struct run *run;
    double *last_steps;
    double *x, *x_low, *x_before; /* state, what rounding lost of it, and the state before the last jump */
    int64_t *known_zeros, *hits, *faint;
    double *since;
    double *c, *ahead;              /* expansions: of the step, and at the end of a step that is checked */
    bool hidden;                    /* series of the step have hidden terms (validation.c) */
    double *powers, *scaled, *stack;
    double *room;                   /* all of the following */
    double *change, *lower;         /* changes of the states over a step; lower bounds of the guards */
    double changed_by;              /* theta of "change" and "lower"; -1 if they are not those of c */
    double *point, *speeds, *own_rounding;
    double *origin;
    int64_t *remembered;
    int64_t *entries, *left;        /* words of the present mode's entries, and of the mode that an event has ended */
    int64_t words;                  /* number of words; 0 if a mode is a row */
    struct mode *own;               /* with contacts: the present mode, and its constants */
    double *own_constants;
    double *records;
    int64_t record_width;
    int64_t width;                  /* of a row of c, ahead and stack */
    const struct tables *tables;
    const struct mode *mode;        /* present mode */
    const double *constants;        /* of the present mode's expansion */
    double *samples;                /* (sample_count, 1 + n + 1): times of the samples; their states and modes */
    int64_t sample_count;
};

/* Doubles from one row of coefficients to the next: a whole number of vectors. */
HENON_EXPORT int64_t row_length(int64_t order)
{
    return order ? (order + LANES) / LANES * LANES : 1;
}

/* Number of words for the entries of a mode. */
HENON_EXPORT int64_t words_of(int64_t contacts)
{
    return (contacts + ENTRIES_IN_WORD - 1) / ENTRIES_IN_WORD;
}

/* Size of a mode's record, in doubles. */
static inline int64_t mode_size(int64_t guards)
{
    return (int64_t)((sizeof(struct mode) + (size_t)guards * sizeof(struct guard)) / sizeof(double));
}

/* Places of the parts of a block (struct places). */
HENON_EXPORT struct places places_of(int64_t states, int64_t guards, int64_t order, int64_t contacts,
                                     int64_t constants)
{
    struct places p;
    int64_t words = words_of(contacts);
    p.last_steps = sizeof(struct run) / sizeof(double);
    p.state = p.last_steps + REMEMBERED_STEPS;
    p.known_zeros = p.state + 3 * states;
    p.entries = p.known_zeros + 3 * guards;
    p.since = p.entries + words;
    p.end_of_state = p.since + guards;
    p.width = row_length(order);
    p.band = (p.end_of_state + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    p.room = p.band + (2 * (states + guards + 1) + ROOT_ROWS) * p.width;
    p.origin = p.room + 4 * states + 5 * guards;
    p.remembered = p.origin + 3 * states + 3;
    p.left = p.remembered + REMEMBERED_STEPS * (words ? words : 1);
    p.own = p.left + words;
    p.constants = p.own + (contacts ? mode_size(guards) : 0);
    p.records = p.constants + constants;
    p.record_width = TRANSITION_PLACES + states + 2 * words;
    p.size = p.records + CHUNK * p.record_width;
    return p;
}

static inline struct places places_of_run(const struct run *run)
{
    return places_of(run->states, run->guards, run->order, run->contacts, run->constants);
}

/* Record of the mode in a row of the tables. */
static inline const struct mode *mode_in(const struct tables *tables, int64_t row, int64_t guards)
{
    return (const struct mode *)(tables->modes + row * mode_size(guards) * (int64_t)sizeof(double));
}

/* Constants of a mode's tape: 0 is its expansion, 1 the normal velocities, 2 the maps of resets. */
static inline const double *constants_of(const struct tables *tables, int64_t row, int64_t tape)
{
    return tables->numbers + (row * tables->tapes + tape) * tables->length;
}

static inline const struct mode *mode_at(const struct work *w, int64_t row)
{
    return mode_in(w->tables, row, w->run->guards);
}

static inline int64_t three_to(int64_t exponent)
{
    int64_t power = 1;
    for (; exponent > 0; exponent--)
        power *= 3;
    return power;
}

/* Entry of a surface in the mode with a number (henon_ref.modes.mode.mode_number). */
static inline int64_t entry_of(int64_t number, int64_t surface)
{
    return number / three_to(surface) % 3 - 1;
}

/* Row of the mode with a number; -1 if it is not compiled. */
static inline int64_t row_of_number(const struct work *w, int64_t number)
{
    for (int64_t row = 0; row < w->tables->count; row++)
        if (mode_at(w, row)->number == number)
            return row;
    return -1;
}

/* Make the run's mode the present one; with contacts put_together has assembled it before. */
static inline void enter(struct work *w)
{
    w->mode = w->words ? w->own : mode_at(w, w->run->mode);
    w->constants = w->words ? w->own_constants : constants_of(w->tables, w->run->mode, 0);
}

/* Work space of a run's block. */
static inline struct work work_of(struct run *run, const struct tables *tables)
{
    int64_t n = run->states, most = run->guards;
    const struct places p = places_of(n, most, run->order, run->contacts, run->constants);
    double *block = (double *)run;
    struct work w = {.run = run, .tables = tables, .width = p.width, .record_width = p.record_width};
    w.changed_by = -1.0;
    w.last_steps = block + p.last_steps;
    w.x = block + p.state, w.x_low = w.x + n, w.x_before = w.x + 2 * n;
    w.known_zeros = (int64_t *)(block + p.known_zeros), w.hits = w.known_zeros + most, w.faint = w.hits + most;
    w.since = block + p.since;
    w.c = block + p.band, w.ahead = w.c + (n + most + 1) * p.width;
    w.powers = w.ahead + (n + most + 1) * p.width, w.scaled = w.powers + p.width, w.stack = w.scaled + p.width;
    w.room = w.change = block + p.room, w.lower = w.change + n, w.point = w.lower + most;
    w.speeds = w.change + 2 * n + most, w.own_rounding = w.speeds + n + 4 * most;
    w.origin = block + p.origin;
    w.remembered = (int64_t *)(block + p.remembered);
    w.entries = (int64_t *)(block + p.entries), w.left = (int64_t *)(block + p.left);
    w.words = words_of(run->contacts);
    w.own = (struct mode *)(block + p.own), w.own_constants = block + p.constants;
    w.records = block + p.records;
    enter(&w);
    return w;
}

/* Row of coefficients of the step's expansion: of state r, or of guard r - n. */
static inline const double *row_of(const struct work *w, int64_t r)
{
    return w->c + r * w->width;
}

/* Row of coefficients of the expansion ahead. */
static inline double *row_ahead(const struct work *w, int64_t r)
{
    return w->ahead + r * w->width;
}

/* Row of a guard of the present mode. */
static inline const double *guard_row(const struct work *w, int64_t guard)
{
    return row_of(w, w->run->states + guard);
}

/* Expand the present mode at the present time and a state, into rows. */
static inline void expand(const struct work *w, const double *x, double *rows)
{
    const struct run *run = w->run;
    w->mode->expansion(run->time, run->time_low, run->unit, x, w->constants, rows);
}

/* Compute the changes over a step of theta units, and the lower bounds, unless they are known. */
static inline void change_over(struct work *w, double theta)
{
    if (w->changed_by != theta)
        w->mode->step_end(theta, w->c, w->change);
    w->changed_by = theta;
}

/* Check whether a set contains an index; bit 63 stands for all indices from 63 on. */
static inline bool has_bit(int64_t set, int64_t index)
{
    return set >> (index < 63 ? index : 63) & 1;
}

#endif
