/* The mode after an event of one guard, by two normal velocities or the hold zone. */

/* Size of the smallest release guard, relative to all their coefficients, below which Python looks closer. */
#define HOLD_MARGIN 1e-9

/* Normal velocities of the guards of the present mode, where the run stands. */
static const double *speeds_at(struct work *w)
{
    const struct run *run = w->run;
    const double *constants = w->constants + w->tables->length;
    w->mode->normal_velocities(run->time, run->time_low, 1.0, w->x, constants, w->speeds);
    return w->speeds + run->states;
}

/* +1 inside the hold zone of a surface, -1 outside, 0 where that is not clear; "stick": row of the mode that slides on
 * it. */
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

/* What follows an event of one guard. */
struct change {
    int64_t kind;  /* of transition */
    int64_t mode;  /* row of the mode; -1 where it is not compiled */
    int64_t zeros; /* with which the surface is left; 0 at a release: to be measured */
};

/* Go over to the mode that several surfaces lead to; ON, or why Python is needed. */
static int64_t apply_selection(struct work *w)
{
    if (!w->tables->selection.velocities)
        return SELECT_MODE;
    int64_t target = select_mode(w);
    if (target < 0 || !change_mode(w, target))
        return SELECT_MODE;
    return events_accumulate(w->run) ? EVENTS_ACCUMULATE : ON;
}

/* What follows where the surface of a guard is reached alone, at these normal velocities; ON, or why Python is
 * needed. */
static int64_t at_surface(struct work *w, int64_t g, const double *speeds, struct change *found)
{
    const struct guard *guard = &w->mode->guard[g];
    double inside = speeds[2 * g], beyond = speeds[2 * g + 1];
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

/* Whether all slides' ends that are at zero fall through it, and each contact has one guard there at most. */
static bool ends_fall(struct work *w)
{
    const struct run *run = w->run;
    bool found = true, expanded = false;
    for (int64_t g = 0; g < w->mode->guards; g++) {
        if (w->hits[g] != 1)
            continue;
        found = found && g < 2 * run->contacts && w->hits[g ^ 1] == 0;
        if (w->mode->guard[g].kind == SURFACE || g == run->guard)
            continue;
        if (!expanded)
            w->mode->expansion(run->time, run->time_low, run->unit, w->x, w->constants, w->ahead);
        expanded = true;
        const double *row = row_ahead(w, run->states + g);
        double size = 0.0;
        for (int64_t k = 1; k <= run->order; k++)
            size += fabs(row[k]);
        found = found && row[1] < -TANGENT * size;
    }
    return found;
}

/* What follows where a contact's guard is at zero, whatever the others do, noted in its entry; false where that is not
 * clear. */
static bool contact_changes(struct work *w, int64_t g, const double *speeds)
{
    int64_t index = w->mode->guard[g].index;
    struct change found = {RELEASED, w->mode->guard[g].mode_across, w->mode->guard[g].zeros_at_release};
    if (w->mode->guard[g].kind == SURFACE && at_surface(w, g, speeds, &found) != ON)
        return false;
    go_over(w, index, found.mode);
    if (found.zeros == 0 && found.kind == RELEASED)
        found.zeros = zeros_at_release(w->mode, index, speeds_at(w));
    w->faint[2 * index] = found.zeros;
    return found.kind == STICK || found.zeros > 0;
}

/* Change the entries of all contacts whose guards are at zero at one instant, each by itself: they do not act on each
 * other. ON, or why Python is needed, the mode then being as it was. */
static int64_t apply_to_each(struct work *w)
{
    struct run *run = w->run;
    const double *speeds = speeds_at(w);
    int64_t changes = 0;
    bool clear = ends_fall(w);
    for (int64_t g = 0; g < w->mode->guards && clear; g++)
        if (w->hits[g] == 1) {
            clear = contact_changes(w, g, speeds);
            changes += 1;
        }
    bool full = clear && run->transitions > 0 && run->transitions + changes > run->transition_capacity;
    if (!clear || full) {
        for (int64_t i = 0; i < run->contacts; i++)
            if (entry_in(w->entries, i) != entry_in(w->left, i))
                go_over(w, i, entry_in(w->left, i) + 1);
        run->event_pending = full ? 1 : 0;
        return full ? BLOCK_FULL : SELECT_MODE;
    }
    for (int64_t g = 0; g < w->mode->guards; g++)
        w->known_zeros[g] = 0;
    for (int64_t i = 0; i < run->contacts; i++) {
        int64_t before = entry_in(w->left, i), now = entry_in(w->entries, i);
        if (before == now)
            continue;
        w->known_zeros[2 * i] = now == 0 ? 0 : w->faint[2 * i];
        record_transition(w, now == 0 ? STICK : before == 0 ? RELEASED : CROSSING, i, before, 0, 0);
    }
    return events_accumulate(run) ? EVENTS_ACCUMULATE : ON;
}

/* Change the mode at the event the run stands at; ON, or why Python is needed. */
static int64_t apply_event(struct work *w)
{
    struct run *run = w->run;
    const struct guard *guard = &w->mode->guard[run->guard];
    bool coincident = false;
    leave(w);
    for (int64_t g = 0; g < w->mode->guards; g++)
        coincident = coincident || (w->hits[g] == 1 && g != run->guard);
    if (guard->kind == VALID)
        return LEFT_DOMAIN;
    if (coincident && w->words)
        return apply_to_each(w);
    struct change found = {RELEASED, guard->mode_across, guard->zeros_at_release};
    if (guard->kind == SURFACE) {
        if (guard->jump && !coincident)
            return jump_transition(w);
        if (coincident || guard->coupled != UNCOUPLED)
            return apply_selection(w);
        run->expansions += 1;
        int64_t code = at_surface(w, run->guard, speeds_at(w), &found);
        if (code != ON)
            return code;
    } else if (coincident || guard->coupled != UNCOUPLED) {
        return SELECT_MODE;
    }
    if (found.mode < 0) {
        run->pending_kind = found.kind;
        return MODE_NOT_COMPILED;
    }
    int64_t index = guard->index, side = guard->side, mode = run->mode;
    int64_t back = go_over(w, index, found.mode);
    if (found.zeros == 0 && found.kind == RELEASED) {
        run->expansions += 1;
        found.zeros = zeros_at_release(w->mode, index, speeds_at(w));
        if (found.zeros == 0) {
            go_over(w, index, back);
            return SELECT_MODE;
        }
    }
    record_transition(w, found.kind, index, side, mode, run->mode);
    set_known_zeros(w, w->mode, index, found.zeros);
    return events_accumulate(run) ? EVENTS_ACCUMULATE : ON;
}
