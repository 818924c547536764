/* Jump of the state at one surface that resets it, and the mode after the jump, if double precision decides them.
 *
 * This is the common case of henon_ref/modes/after_jump.py: one surface alone is at zero, the map keeps no surface on
 * which the mode slides, and carries none with a reset of its own through zero. The map is evaluated at the compensated
 * state, to the rounding of its own terms, as a step is. The mode after the jump is then expanded there. Every guard
 * must be clearly above zero, but for one surface on which the map puts the state: there two normal velocities decide.
 * A surface whose function the map keeps must be left with a speed, so that the following flights last longer than a
 * rest and no other stop is met sooner, or by the acceleration alone if the impact absorbs the whole speed. Or the body
 * continues to fall through the surface, or it is clearly pressed on and stays, because the impact absorbs the whole
 * speed or the impacts have come to their limit; then the mode below, or at rest, is expanded, too. All other cases are
 * left to Python, before anything is changed.
 */

/* The flights clearly continue if all later ones together last this many times the longest rest. */
#define LASTING (1.0 + 1e-6)

/* A state below this part of its former value counts as zero: it is the rest of a cancellation in double-double. */
#define OF_NOTHING 0x1p-100

/* Result of an impact on a surface whose function the map keeps; Python decides NOT_CLEAR. */
enum impact { NOT_CLEAR, RESTS, LEAVES, LIFTS_OFF, FALLS };

/* A jump under examination. */
struct jump {
    int64_t surface;
    double speed;                /* speed at which the surface is reached */
    double *state, *low;         /* state after the jump, and what rounding lost of it */
    double *values;              /* of surfaces after the jump, 0: same side; then the ratio of an impact, else 1 */
    bool kept;                   /* whether the map keeps the surface's function */
    int64_t landed;              /* another surface on which the map puts the state; -1 if none */
    int64_t landed_zeros;        /* known zeros with which that surface is left; 0 if the mode slides on it */
    int64_t number;              /* number of the mode after the jump */
    int64_t target, end;         /* rows of that mode, and of the one that follows at once */
    int64_t expanded;            /* number of expansions made */
    int64_t zeros;               /* known zeros with which a surface that the map keeps is left */
    double flights;              /* s: duration of all later flights together, if the body comes to rest */
    double rise;                 /* rate, by the unit, with which the last impact leaves the surface */
    double length;               /* part of the unit on which the terms of the last expansion decrease */
};

/* Write the state after the jump, what rounding lost of it, and new values of surfaces into the room; false if they are
 * not finite, or an operation has left the range of doubles. The value of a surface whose function the map keeps is 0.
 * The map of a surface (henon_ref/integrator/mode_code.py) does not write what it does not change. */
static bool map_state(const struct work *w, const struct jump *jump)
{
    const struct run *run = w->run;
    int64_t n = run->states, surfaces = w->mode->surfaces;
    for (int64_t i = 0; i < 2 * n; i++)
        w->room[i] = w->x[i];
    for (int64_t j = 0; j < surfaces; j++)
        jump->values[j] = 0.0;
    const double *constants = constants_of(w->tables, run->mode, 2);
    lower_range_flags();
    w->mode->guard[run->guard].jump(run->time, run->time_low, 1.0, w->x, constants, w->room);
    bool bounded = raised_range_flags() == 0;
    for (int64_t i = 0; i < n; i++) {
        double x = jump->state[i], total = x + jump->low[i], part = total - x;
        jump->low[i] = (x - (total - part)) + (jump->low[i] - part);
        jump->state[i] = total;
        bounded = bounded && fabs(total) < BLOWN_UP;
    }
    for (int64_t j = 0; j < surfaces; j++)
        bounded = bounded && fabs(jump->values[j]) < BLOWN_UP;
    return bounded;
}

/* Number of the mode on the sides to which a jump leads; above a slide on which it puts the state (lands decides). */
static int64_t number_after(const struct work *w, const double *values)
{
    int64_t number = w->mode->number, power = 1;
    for (int64_t j = 0; j < w->mode->surfaces; j++) {
        int64_t before = entry_of(w->mode->number, j);
        if (values[j] != 0.0)
            number += ((values[j] > 0.0 ? 1 : -1) - before) * power;
        else if (before == 0)
            number += power;
        power *= 3;
    }
    return number;
}

/* Check whether a map carries another surface that resets the state below zero. */
static bool carries_another(const struct work *w, const struct jump *jump)
{
    for (int64_t g = 0; g < w->mode->guards; g++) {
        const struct guard *guard = &w->mode->guard[g];
        bool resets = guard->kind == SURFACE && guard->coupled == RESETTING;
        if (resets && guard->index != jump->surface && jump->values[guard->index] < 0.0)
            return true;
    }
    return false;
}

/* Guard of a surface on which a mode does not slide. */
static int64_t guard_on(const struct mode *mode, int64_t surface)
{
    int64_t g = 0;
    while (!is_on(&mode->guard[g], surface))
        g += 1;
    return g;
}

/* Clear result of an impact: the body leaves the surface, rests on it, or falls through it.
 *
 * row: coefficients of the surface's function after the impact. turned: whether another surface changes its side.
 */
static enum impact after_impact(const struct run *run, struct jump *jump, const double *row, double ratio, bool turned)
{
    double speed = jump->speed, margin = CLEARLY_ABOVE * size_of_terms(row, 2, run->order, jump->length);
    if (ratio == 0.0)
        return row[2] < -margin ? RESTS : row[2] > margin ? LIFTS_OFF : NOT_CLEAR;
    /* All later flights last 2 v / (a (1 - r)) together: see henon_ref/modes/resets.py. If friction has reversed its
     * direction, the way up alone lasts v / a. */
    double rise = row[1], reached = speed * run->unit;
    if (rise < -TANGENT * reached)
        return ratio > 0.0 ? FALLS : NOT_CLEAR;
    double ending = larger(-row[2], 0.0) * (turned ? 2.0 : larger(1.0 - rise / reached, 0.0));
    if (!(rise > TANGENT * reached))
        return NOT_CLEAR;
    if (run->unit * rise > LASTING * longest_rest(run) * ending)
        return LEAVES;
    jump->flights = run->unit * rise / ending, jump->rise = rise;
    bool told = !turned && ratio != 1.0 && row[2] < -margin && LASTING * jump->flights < longest_rest(run);
    return told && jump->flights < remaining(run) ? RESTS : NOT_CLEAR;
}

/* Expand the mode in a row at the state after the jump, on a step of that mode, which may be much shorter than the last
 * one; check whether all its guards, but those of a surface and of the one landed on, are clearly above zero. */
static bool holds(const struct work *w, struct jump *jump, int64_t row, int64_t surface)
{
    const struct run *run = w->run;
    const struct mode *mode = mode_at(w, row);
    mode->expansion(run->time, run->time_low, run->unit, jump->state, constants_of(w->tables, row, 0), w->ahead);
    jump->length = length_ahead(w, run->states + mode->guards);
    bool clear = jump->length > 0.0;
    for (int64_t g = 0; g < mode->guards; g++) {
        const double *ahead = row_ahead(w, run->states + g);
        double size = size_of_terms(ahead, 0, run->order, jump->length);
        bool left = is_on(&mode->guard[g], surface) || is_on(&mode->guard[g], jump->landed);
        clear = clear && (left || ahead[0] > CLEARLY_ABOVE * size);
    }
    return clear;
}

/* Decide the mode on another surface, on which the map puts the state, by its normal velocities, as row_on_surface in
 * start.c; false if there is none, or that is not clear. The target mode, which has been expanded, becomes the one that
 * follows; -1 if that is not compiled. */
static bool lands(const struct work *w, struct jump *jump)
{
    const struct run *run = w->run;
    const struct mode *mode = mode_at(w, jump->target);
    const double *constants = constants_of(w->tables, jump->target, 1);
    int64_t n = run->states, at = 0, found = 0;
    for (int64_t g = 0; g < mode->guards; g++)
        if (row_ahead(w, n + g)[0] == 0.0 && !is_on(&mode->guard[g], jump->surface))
            at = g, found += 1;
    const struct guard *guard = &mode->guard[at];
    if (found != 1 || guard->kind != SURFACE || guard->hold_zone || guard->coupled != UNCOUPLED)
        return false;
    mode->normal_velocities(run->time, run->time_low, 1.0, jump->state, constants, w->speeds);
    double inside = w->speeds[n + 2 * at], beyond = w->speeds[n + 2 * at + 1];
    double margin = CLEAR_MARGIN * larger(fabs(inside), fabs(beyond));
    if (!(fabs(inside) > margin && fabs(beyond) > margin) || (inside < 0.0 && beyond > 0.0))
        return false;
    jump->landed = guard->index, jump->landed_zeros = inside > 0.0 && beyond < 0.0 ? 0 : 1, jump->expanded += 2;
    if (inside > 0.0) {
        int64_t entry = beyond < 0.0 ? 0 : guard->to_sign;
        jump->number += (entry - entry_of(jump->number, guard->index)) * three_to(guard->index);
        jump->target = jump->end = row_of_number(w, jump->number);
    }
    return true;
}

/* Largest change of the rate of another stop, as a multiple of that of the surface, when the body has come to rest. */
#define OTHER_STOP 16.0

/* Check whether no guard of the expanded mode, except that of the surface, reaches zero during the last flights; if the
 * body leaves it, whether no other stop is met so soon that both may have a limit of impacts together. */
static bool undisturbed(const struct work *w, const struct jump *jump, bool leaves)
{
    const struct mode *mode = mode_at(w, jump->target);
    double time = (leaves ? longest_rest(w->run) : jump->flights) / w->run->unit;
    bool found = true;
    for (int64_t g = 0; g < mode->guards; g++) {
        const double *row = row_ahead(w, w->run->states + g);
        bool stop = mode->guard[g].coupled == RESETTING, passed = leaves && !stop;
        double more = stop && !leaves ? OTHER_STOP * jump->rise : 0.0;
        bool clear = fabs(row[0]) > (fabs(row[1]) + more) * time + fabs(row[2]) * time * time;
        found = found && (clear || passed || is_on(&mode->guard[g], jump->surface));
    }
    return found;
}

/* Have Python compile the mode of a number; the loop then repeats the event, of a kind. */
static int64_t not_compiled(struct run *run, int64_t kind, int64_t number)
{
    run->pending_kind = kind, run->pending_mode = number, run->event_pending = 1;
    return MODE_NOT_COMPILED;
}

/* Determine what follows at once on a surface whose function the map keeps; ON, or the reason why Python is needed. */
static int64_t follow_impact(struct work *w, struct jump *jump, int64_t changes)
{
    struct run *run = w->run;
    int64_t n = run->states, index = jump->surface;
    const double *row = row_ahead(w, n + guard_on(mode_at(w, jump->target), index));
    enum impact found = after_impact(run, jump, row, jump->values[w->mode->surfaces], changes > 1);
    bool leaves = found == LEAVES, alone = !(leaves || found == RESTS) || undisturbed(w, jump, leaves);
    if (found == NOT_CLEAR || !alone || (!leaves && jump->landed >= 0))
        return SELECT_MODE;
    jump->zeros = found == LIFTS_OFF ? 2 : 1;
    if (leaves || found == LIFTS_OFF)
        return ON;
    bool falls = found == FALLS;
    int64_t lower = jump->number - three_to(index) * (falls ? 2 : 1);
    jump->end = row_of_number(w, lower);
    if (jump->end < 0)
        return not_compiled(run, RESET, lower);
    jump->expanded = 3;
    if (!holds(w, jump, jump->end, falls ? index : -1))
        return SELECT_MODE;
    if (falls) {
        row = row_ahead(w, n + guard_on(mode_at(w, jump->end), index));
        if (!(row[1] > TANGENT * jump->speed * run->unit))
            return SELECT_MODE;
        jump->number = lower, jump->target = jump->end;
    }
    return ON;
}

/* Continue to the point where impacts that have come to their limit leave a body at rest: along the motion at rest,
 * from the state without the speed of the last impact, which is in the room. (The error is about the square of the
 * duration; see henon_ref/modes/resets.py.) */
static void come_to_rest(struct work *w, const struct jump *jump)
{
    struct run *run = w->run;
    int64_t n = run->states;
    double part = jump->flights / run->unit;
    const struct mode *slip = mode_at(w, jump->target), *rest = mode_at(w, jump->end);
    const double *constants = constants_of(w->tables, jump->target, 0);
    slip->expansion(run->time, run->time_low, run->unit, jump->state, constants, w->ahead);
    double left = row_ahead(w, n + guard_on(slip, jump->surface))[1] / jump->rise; /* rest left by rounding */
    for (int64_t i = 0; i < n; i++) {
        struct pair moved = pair_sum(jump->state[i], left * (jump->state[i] - w->x[i]) + jump->low[i]);
        bool nothing = fabs(moved.high) <= OF_NOTHING * fabs(w->x[i]);
        jump->state[i] = nothing ? 0.0 : moved.high, jump->low[i] = nothing ? 0.0 : moved.low;
    }
    rest->expansion(run->time, run->time_low, run->unit, jump->state, constants_of(w->tables, jump->end, 0), w->ahead);
    run->expansions += 2;
    for (int64_t i = 0; i < n; i++) {
        double *row = row_ahead(w, i);
        row[0] = 0.0;
        struct pair there = added((struct pair){jump->state[i], jump->low[i]},
                                  (struct pair){value(row, run->order, part), 0.0});
        jump->state[i] = there.high, jump->low[i] = there.low;
    }
    if (run->dense)
        record_line(w, jump->flights, jump->state, jump->target);
    for (int64_t i = 0; i < n; i++)
        w->x[i] = jump->state[i], w->x_low[i] = jump->low[i];
    add_to_time(run, jump->flights);
}

/* Set the state after the jump, and record the transitions; ON, or EVENTS_ACCUMULATE. */
static int64_t make_jump(struct work *w, const struct jump *jump)
{
    struct run *run = w->run;
    int64_t n = run->states, mode = run->mode, before = w->mode->number;
    double ratio = jump->values[w->mode->surfaces];
    struct pair left = divided((struct pair){ratio, 0.0}, pair_sum(1.0, -ratio));
    for (int64_t i = 0; i < n; i++) {
        struct pair old = {w->x[i], w->x_low[i]}, new = {jump->state[i], jump->low[i]};
        struct pair still = added(new, multiplied(added(new, negative(old)), left));
        w->x_before[i] = w->x[i];
        w->x[i] = new.high, w->x_low[i] = new.low;
        jump->state[i] = still.high, jump->low[i] = still.low; /* without the speed after the impact */
    }
    for (int64_t j = 0; j < w->mode->surfaces; j++) {
        int64_t entry = entry_of(before, j);
        if (j == jump->surface || entry != entry_of(jump->number, j)) {
            int64_t other = entry == 0 ? RELEASED : entry_of(jump->number, j) == 0 ? STICK : CROSSING;
            int64_t kind = j == jump->surface ? RESET : other;
            record_transition(w, kind, j, entry, mode, jump->target);
        }
    }
    int64_t accumulate = events_accumulate(run);
    if (jump->end != jump->target) {
        if (jump->flights > 0.0)
            come_to_rest(w, jump);
        record_transition(w, STICK, jump->surface, 1, jump->target, jump->end);
        accumulate = events_accumulate(run);
    }
    run->mode = jump->end, run->more_digits = 0;
    const struct mode *now = mode_at(w, jump->end);
    set_known_zeros(w, now, jump->surface, jump->end == jump->target ? jump->zeros : 0);
    for (int64_t g = 0; g < now->guards; g++)
        if (is_on(&now->guard[g], jump->landed))
            w->known_zeros[g] = jump->landed_zeros;
    return accumulate ? EVENTS_ACCUMULATE : ON;
}

/* Make the jump at the present event of one guard; ON, or the reason why Python is needed. */
static int64_t jump_transition(struct work *w)
{
    struct run *run = w->run;
    int64_t n = run->states, mode = run->mode, before = w->mode->number;
    struct jump jump = {.surface = w->mode->guard[run->guard].index, .expanded = 2, .landed = -1};
    jump.state = w->room, jump.low = w->room + n, jump.values = w->room + 2 * n;
    w->mode->normal_velocities(run->time, run->time_low, 1.0, w->x, constants_of(w->tables, mode, 1), w->speeds);
    jump.speed = w->speeds[n + 2 * run->guard];
    if (!(map_state(w, &jump) && jump.speed > 0.0))
        return SELECT_MODE;
    jump.number = number_after(w, jump.values), jump.kept = jump.values[jump.surface] == 0.0;
    if (carries_another(w, &jump))
        return SELECT_MODE;
    jump.target = jump.end = row_of_number(w, jump.number);
    if (jump.target < 0)
        return not_compiled(run, RESET, jump.number);
    int64_t own = jump.kept ? jump.surface : -1, changes = 0;
    bool clear = holds(w, &jump, jump.target, own);
    if (!clear && lands(w, &jump)) {
        if (jump.target < 0)
            return not_compiled(run, RESET, jump.number);
        clear = holds(w, &jump, jump.target, own);
    }
    if (!clear)
        return SELECT_MODE;
    for (int64_t j = 0; j < w->mode->surfaces; j++)
        changes += j == jump.surface || entry_of(before, j) != entry_of(jump.number, j) ? 1 : 0;
    if (jump.kept) {
        int64_t code = follow_impact(w, &jump, changes);
        if (code != ON)
            return code;
    }
    changes += jump.end != jump.target ? 1 : 0;
    if (run->dense && jump.flights > 0.0 && run->dense_steps >= run->dense_capacity) {
        run->event_pending = 1;
        return STEPS_FULL;
    }
    /* An empty block has memory for all transitions, however small its capacity. */
    if (run->transitions > 0 && run->transitions + changes > run->transition_capacity) {
        run->event_pending = 1;
        return BLOCK_FULL;
    }
    /* Normal velocities and modes, counted only now, because the event might have been postponed. */
    run->expansions += jump.expanded;
    return make_jump(w, &jump);
}
