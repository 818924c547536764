/* The mode after an event of one guard, by two normal velocities or the hold zone. */

/* Size of the smallest release guard, relative to all their coefficients, below which Python looks closer. */
#define HOLD_MARGIN 1e-9

/* Normal velocities of the guards of the mode in a row, where the run stands; counted. */
static const double *speeds_in(struct work *w, int64_t row)
{
    struct run *run = w->run;
    const double *constants = constants_of(w->tables, row, 1);
    mode_at(w, row)->normal_velocities(run->time, run->time_low, 1.0, w->x, constants, w->speeds);
    run->expansions += 1;
    return w->speeds + run->states;
}

/* +1 inside the hold zone of a surface, -1 outside, 0 where that is not clear; "stick": row of the mode that slides on
 * it. */
static int64_t inside_hold_zone(const struct work *w, int64_t surface, int64_t stick)
{
    const struct run *run = w->run;
    const struct mode *mode = mode_at(w, stick);
    const double *constants = constants_of(w->tables, stick, 0);
    mode->expansion(run->time, run->time_low, run->unit, w->x, constants, w->ahead);
    double lowest = 1e300, size = 0.0;
    for (int64_t g = 0; g < mode->guards; g++)
        if (mode->guard[g].kind == RELEASE && mode->guard[g].index == surface) {
            const double *row = row_ahead(w, run->states + g);
            lowest = smaller(lowest, row[0]);
            for (int64_t k = 0; k <= run->order; k++)
                size += fabs(row[k]);
        }
    if (!(fabs(lowest) > HOLD_MARGIN * size))
        return 0;
    return lowest > 0.0 ? 1 : -1;
}

/* What follows an event of one guard. */
struct change {
    int64_t kind;  /* of transition */
    int64_t mode;  /* row of the mode; -1 where it is not compiled */
    int64_t zeros; /* with which the surface is left; 0 at a release: to be measured */
};

/* Whether no guard of a mode that ends the run, as where its sliding does not attract, is close to zero here. */
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

/* Go over to the mode that several surfaces lead to; ON, or why Python is needed. */
static int64_t apply_selection(struct work *w)
{
    const struct selection *selection = &w->tables->selection;
    int64_t target, number = UNCLEAR;
    if (!selection->velocities)
        return SELECT_MODE;
    if (selection->contact) {
        number = mode_of_contacts(w);
        target = number < 0 ? UNCLEAR : selection->rows[number];
    } else {
        target = select_mode(w);
    }
    if (target < 0 && number >= 0) {
        w->run->pending_kind = SELECTED, w->run->pending_mode = number;
        return MODE_NOT_COMPILED;
    }
    if (target < 0 || !goes_on(w, target) || !change_mode(w, target))
        return SELECT_MODE;
    return events_accumulate(w->run) ? EVENTS_ACCUMULATE : ON;
}

/* What follows where one surface is reached; ON, or why Python is needed. */
static int64_t at_surface(struct work *w, struct change *found)
{
    struct run *run = w->run;
    const struct guard *guard = &w->mode->guard[run->guard];
    const double *speeds = speeds_in(w, run->mode);
    double inside = speeds[2 * run->guard], beyond = speeds[2 * run->guard + 1];
    if (!(inside > 0.0 && fabs(beyond) > TANGENT * inside))
        return SELECT_MODE;
    bool stuck = beyond < 0.0;
    if (guard->hold_zone == 1) {
        int64_t stick = guard->mode_stuck, zone = stick < 0 ? 0 : inside_hold_zone(w, guard->index, stick);
        if (zone == 0 || (stuck && zone < 0))
            return SELECT_MODE;
        stuck = zone > 0;
    }
    *found = stuck ? (struct change){STICK, guard->mode_stuck, 0} : (struct change){CROSSING, guard->mode_across, 1};
    return ON;
}

/* Change the mode at the event the run stands at; ON, or why Python is needed. */
static int64_t apply_event(struct work *w)
{
    struct run *run = w->run;
    const struct guard *guard = &w->mode->guard[run->guard];
    bool coincident = false;
    for (int64_t g = 0; g < w->mode->guards; g++)
        coincident = coincident || (w->hits[g] == 1 && g != run->guard);
    if (guard->kind == VALID)
        return LEFT_DOMAIN;
    struct change found = {RELEASED, guard->mode_across, guard->zeros_at_release};
    if (guard->kind == SURFACE) {
        if (guard->jump && !coincident)
            return jump_transition(w);
        if (coincident || guard->coupled != UNCOUPLED)
            return apply_selection(w);
        int64_t code = at_surface(w, &found);
        if (code != ON)
            return code;
    } else if (coincident || guard->coupled != UNCOUPLED) {
        return apply_selection(w);
    }
    if (found.mode < 0) {
        run->pending_kind = found.kind;
        return MODE_NOT_COMPILED;
    }
    const struct mode *after = mode_at(w, found.mode);
    if (found.zeros == 0 && found.kind == RELEASED) {
        found.zeros = zeros_at_release(after, guard->index, speeds_in(w, found.mode));
        if (found.zeros == 0)
            return SELECT_MODE;
    }
    record_transition(w, found.kind, guard->index, guard->side, run->mode, found.mode);
    run->mode = found.mode;
    set_known_zeros(w, after, guard->index, found.zeros);
    return events_accumulate(run) ? EVENTS_ACCUMULATE : ON;
}
