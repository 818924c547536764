/* The mode after an event: of one guard, by two normal velocities or the hold zone; of several, by mode selection, or
 * as crossed kinks (crossed_kinks.c). Python decides all other cases.
 */

static int64_t cross_kinks(struct work *w);
static int64_t change_entries(struct work *w);

/* A hold zone is clear if the smallest release guard exceeds this part of all their coefficients' sizes. */
#define HOLD_MARGIN 1e-9
/* Largest number of times that the state is put on each surface. */
#define MOST_PUT 8

/* Normal velocities of the guards of the present mode at the present point. */
static const double *speeds_at(struct work *w)
{
    const struct run *run = w->run;
    const double *constants = w->constants + w->tables->length;
    w->mode->normal_velocities(run->time, run->time_low, 1.0, w->x, constants, w->speeds);
    return w->speeds + run->states;
}

/* Put the state on the surfaces on which the mode slides, one after another until it is on all of them.
 *
 * It is beside a surface that moves, by the error of the run; friction may change within less. Returns speeds_at for
 * the state, or null if they have not been computed.
 */
static const double *put_on_surfaces(struct work *w)
{
    const double *distances = NULL;
    bool moved = true;
    for (int pass = 0; pass < MOST_PUT && moved; pass++) {
        distances = NULL, moved = false;
        for (int64_t g = 0; g < w->mode->guards; g++) {
            int64_t i = w->mode->guard[g].put_on;
            if (i < 0)
                continue;
            distances = distances ? distances : speeds_at(w);
            if (fabs(distances[2 * g]) > STATE_ROUNDING * fabs(w->x[i]))
                w->x[i] -= distances[2 * g], w->x_low[i] = 0.0, moved = true;
        }
    }
    return moved ? NULL : distances;
}

/* +1 inside the hold zone of a surface, -1 outside, 0 if not clear; "stick": row of the mode that slides on the
 * surface. */
static int64_t inside_hold_zone(struct work *w, int64_t surface, int64_t stick)
{
    const struct run *run = w->run;
    int64_t back = go_over(w, surface, stick);
    const struct mode *mode = w->mode;
    mode->expansion(run->time, run->time_low, run->unit, w->x, w->constants, w->ahead);
    double lowest = 1e300, size = 0.0;
    for (int64_t g = 0; g < mode->guards; g++)
        if (mode->guard[g].kind == RELEASE && mode->guard[g].index == surface) {
            const double *row = row_ahead(w, run->states + g);
            lowest = smaller(lowest, row[0]);
            for (int64_t k = 0; k <= run->order; k++)
                size += fabs(row[k]);
        }
    go_over(w, surface, back);
    if (!(fabs(lowest) > HOLD_MARGIN * size))
        return 0;
    return lowest > 0.0 ? 1 : -1;
}

/* Result of an event of one guard. */
struct change {
    int64_t kind;  /* enum transition_kind */
    int64_t mode;  /* row of the mode; -1 if it is not compiled */
    int64_t zeros; /* known zeros with which the surface is left; 0 at a release: still to be determined */
};

/* Check whether all guards of a mode that would end the run (such as "attracts") are clearly above zero. */
static bool goes_on(const struct work *w, int64_t row)
{
    const struct run *run = w->run;
    const struct mode *mode = mode_at(w, row);
    bool expanded = false;
    for (int64_t g = 0; g < mode->guards; g++) {
        if (mode->guard[g].kind != VALID)
            continue;
        if (!expanded)
            mode->expansion(run->time, run->time_low, run->unit, w->x, constants_of(w->tables, row, 0), w->ahead);
        expanded = true;
        const double *values = row_ahead(w, run->states + g);
        double size = 0.0;
        for (int64_t k = 0; k <= run->order; k++)
            size += fabs(values[k]);
        if (!(values[0] > CLEAR_MARGIN * size))
            return false;
    }
    return true;
}

/* Enter the mode selected for several surfaces; ON, or the reason why Python is needed. */
static int64_t apply_selection(struct work *w)
{
    const struct selection *selection = &w->tables->selection;
    int64_t target, number = UNCLEAR;
    if (!selection->velocities)
        return SELECT_MODE;
    if (selection->contact) {
        number = mode_of_contacts(w);
        target = number < 0 ? UNCLEAR : row_of_number(w, number);
    } else {
        target = select_mode(w);
    }
    if (target < 0 && number >= 0)
        return not_compiled(w->run, SELECTED, number);
    if (target < 0 || !goes_on(w, target) || !change_mode(w, target))
        return SELECT_MODE;
    return events_accumulate(w->run) ? EVENTS_ACCUMULATE : ON;
}

/* Check whether a surface is never left on the other side of a guard because no force acts there: all derivatives of
 * its function are zero in doubles. */
static bool never_left(struct work *w, const struct guard *guard)
{
    const struct run *run = w->run;
    int64_t index = guard->index, row = guard->mode_across;
    if (row < 0 || guard->mode_stuck < 0)
        return false;
    int64_t back = go_over(w, index, row);
    w->mode->expansion(run->time, run->time_low, run->unit, w->x, w->constants, w->ahead);
    const double *ahead = row_ahead(w, run->states + guard_on(w->mode, index));
    bool found = true;
    for (int64_t k = 1; k <= run->order; k++)
        found = found && ahead[k] == 0.0;
    go_over(w, index, back);
    return found;
}

/* Decide an event of one surface h, reached from the side s (Filippov, 1988, Sec. 4). inside = -s h'(s) is the speed
 * towards the surface, beyond = -s h'(-s) the speed away from it on the other side. Sliding if inside > 0 > beyond,
 * crossing if both are > 0; a hold zone takes precedence. ON, or the reason why Python is needed. */
static int64_t at_surface(struct work *w, const struct mode *mode, int64_t g, const double *speeds,
                          struct change *found)
{
    const struct guard *guard = &mode->guard[g];
    double inside = speeds[2 * g], beyond = speeds[2 * g + 1];
    bool still = beyond == 0.0 && guard->hold_zone == 0 && never_left(w, guard); /* the limit of sliding */
    if (!(inside > 0.0 && (still || fabs(beyond) > TANGENT * inside)))
        return SELECT_MODE;
    bool stuck = still || beyond < 0.0;
    if (guard->hold_zone == 1) {
        int64_t stick = guard->mode_stuck, zone = stick < 0 ? 0 : inside_hold_zone(w, guard->index, stick);
        if (zone == 0 || (stuck && zone < 0))
            return SELECT_MODE;
        stuck = zone > 0;
    }
    *found = stuck ? (struct change){STICK, guard->mode_stuck, 0} : (struct change){CROSSING, guard->mode_across, 1};
    return ON;
}

/* Expand the mode in a row at the present point; the part of the unit on which its terms decrease, 0 if not finite. */
static double expand_mode(struct work *w, int64_t row)
{
    struct run *run = w->run;
    const struct mode *mode = mode_at(w, row);
    mode->expansion(run->time, run->time_low, run->unit, w->x, constants_of(w->tables, row, 0), w->ahead);
    run->expansions += 1;
    return length_ahead(w, run->states + mode->guards);
}

/* Known zeros with which a surface is left in the expanded mode, on a length: order >= "first" of the first coefficient
 * that is clearly not zero; 0 if the surface is not left, or that is not clear. */
static int64_t zeros_ahead(const struct work *w, const struct mode *mode, int64_t surface, int64_t first, double length)
{
    int64_t order = w->run->order;
    const double *row = row_ahead(w, w->run->states + guard_on(mode, surface));
    double size = size_of_terms(row, 0, order, length), power = 1.0;
    for (int64_t k = 1; k <= order; k++) {
        power *= length;
        if (k >= first && fabs(row[k]) * power > CLEARLY_ABOVE * size)
            return row[k] > 0.0 ? k : 0;
    }
    return 0;
}

/* Check whether the only event is that a surface on which the mode slides turns repelling, the fields on both sides at
 * once (a two-fold; Filippov, 1988, Sec. 19): both ends of the slide fall, and both slips leave the surface. */
static bool turns_repelling(struct work *w)
{
    const struct mode *mode = w->mode;
    int64_t index = mode->guard[w->run->guard].index, ends = 0;
    for (int64_t g = 0; g < mode->guards; g++) {
        const struct guard *guard = &mode->guard[g];
        if (guard->kind != RELEASE && w->hits[g] == 0)
            continue;
        if (w->words || w->hits[g] == 0 || guard->kind != RELEASE || guard->index != index
            || guard->zeros_at_release != 2 || guard->mode_across < 0)
            return false;
        double length = expand_mode(w, guard->mode_across);
        if (!(length > 0.0) || zeros_ahead(w, mode_at(w, guard->mode_across), index, 1, length) == 0)
            return false;
        ends += 1;
    }
    return ends == 2;
}

/* Change the mode at the present event; ON, or the reason why Python is needed. */
static int64_t apply_event(struct work *w)
{
    struct run *run = w->run;
    const struct guard *guard = &w->mode->guard[run->guard];
    bool coincident = false;
    leave(w);
    const double *speeds = put_on_surfaces(w);
    for (int64_t g = 0; g < w->mode->guards; g++)
        coincident = coincident || (w->hits[g] == 1 && g != run->guard);
    if (guard->kind == VALID)
        return LEFT_DOMAIN;
    if (w->words && (coincident || guard->coupled != UNCOUPLED))
        return change_entries(w);
    if (guard->jump && !coincident)
        return jump_transition(w);
    if (coincident && turns_repelling(w))
        return NOT_UNIQUE;
    if (coincident || guard->coupled != UNCOUPLED) {
        int64_t code = apply_selection(w);
        return code == SELECT_MODE ? cross_kinks(w) : code;
    }
    struct change found = {RELEASED, guard->mode_across, guard->zeros_at_release};
    if (guard->kind == SURFACE) {
        if (guard->hold_zone == 1 && guard->mode_stuck < 0 && w->words == 0)
            return not_compiled(run, STICK, -1); /* the zone is known from the equations of the stick */
        run->expansions += 1;
        int64_t code = at_surface(w, w->mode, run->guard, speeds ? speeds : speeds_at(w), &found);
        if (code != ON)
            return code;
    }
    if (found.mode < 0)
        return not_compiled(run, found.kind, -1);
    int64_t index = guard->index, side = guard->side, mode = run->mode;
    int64_t back = go_over(w, index, found.mode);
    if (found.kind == RELEASED && found.zeros < 0) {
        found.zeros = zeros_ahead(w, w->mode, index, -found.zeros, expand_mode(w, run->mode));
    } else if (found.kind == RELEASED && found.zeros == 0) {
        run->expansions += 1;
        found.zeros = zeros_at_release(w->mode, index, speeds_at(w));
    }
    if (found.kind == RELEASED && found.zeros == 0) {
        go_over(w, index, back);
        return SELECT_MODE;
    }
    record_transition(w, found.kind, index, side, mode, run->mode);
    set_known_zeros(w, w->mode, index, found.zeros);
    return events_accumulate(run) ? EVENTS_ACCUMULATE : ON;
}
