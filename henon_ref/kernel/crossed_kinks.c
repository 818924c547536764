/* The mode after kinks that are crossed at the same instant or while the mode slides.
 *
 * No mode slides on a kink (struct guard). So the mode in which all kinks are crossed is expanded at the present point:
 * each kink must be left with a speed, and the guards that end slides must be clearly above zero, so that these slides
 * continue. A further guard that falls at the same instant is decided in that mode, as if it fell just after the
 * kinks: the end of a slide by the value or the derivative of its guard, a surface by its normal velocities. The
 * resulting mode is expanded, too, because a force that jumps may reverse the speed at which a kink is left. Python
 * decides all other cases.
 */

/* Normal velocities of the guards of the mode in a row; counted as an expansion. */
static const double *speeds_in(struct work *w, int64_t row)
{
    struct run *run = w->run;
    const double *constants = constants_of(w->tables, row, 1);
    mode_at(w, row)->normal_velocities(run->time, run->time_low, 1.0, w->x, constants, w->speeds);
    run->expansions += 1;
    return w->speeds + run->states;
}

/* Row of a mode: the guard's link (mode_across, mode_stuck) if it has one, else looked up by the mode's number. */
static int64_t known_row(const struct work *w, int64_t link, int64_t number)
{
    return link >= 0 || w->mode->surfaces == 0 ? link : row_of_number(w, number);
}

/* Guards at zero at one instant. */
struct instant {
    int64_t kinks;  /* number of kinks crossed */
    int64_t other;  /* other guard of the mode that falls; -1: none */
    int64_t number; /* number of the mode in which all kinks are crossed, and nothing else is changed */
    int64_t row;    /* row of that mode */
};

/* Check whether a surface is a kink that is crossed. */
static bool is_crossed(const struct work *w, int64_t surface)
{
    bool found = false;
    for (int64_t g = 0; g < w->mode->guards; g++)
        found = found || (w->hits[g] == 1 && w->mode->guard[g].kink && is_on(&w->mode->guard[g], surface));
    return found;
}

/* Collect the guards at zero; false if they are not kinks and at most one guard that is decided alone. */
static bool read_instant(const struct work *w, struct instant *at)
{
    *at = (struct instant){0, -1, w->mode->number, -1};
    for (int64_t g = 0; g < w->mode->guards; g++) {
        const struct guard *guard = &w->mode->guard[g];
        if (w->hits[g] == 0)
            continue;
        if (guard->kink) {
            at->kinks += 1;
            at->row = at->kinks == 1 ? guard->mode_across : -1;
            at->number += (guard->to_sign - guard->side) * three_to(guard->index);
        } else if (at->other >= 0 || guard->kind == VALID || guard->coupled != UNCOUPLED) {
            return false;
        } else {
            at->other = g;
        }
    }
    at->row = known_row(w, at->row, at->number);
    return at->kinks > 0;
}

/* Expand the mode in a row; check whether it leaves all kinks with a speed and continues all slides except the one that
 * guard "ending" ends (-1: none). If "ending" is -1, it is set to the end of one slide that a jump of a force at the
 * kinks has put below zero. "length": see expand_mode. */
static bool kinks_behind(struct work *w, int64_t row, int64_t *ending, double *length)
{
    const struct mode *mode = mode_at(w, row);
    *length = expand_mode(w, row);
    bool behind = *length > 0.0;
    for (int64_t g = 0; behind && g < mode->guards; g++) {
        const struct guard *guard = &mode->guard[g];
        const double *ahead = row_ahead(w, w->run->states + g);
        double margin = CLEARLY_ABOVE * size_of_terms(ahead, 0, w->run->order, *length);
        bool ends = guard->kind == RELEASE && guard->coupled == UNCOUPLED && ahead[0] < -margin && *ending < 0;
        if (ends)
            *ending = g;
        else if (guard->kind == SURFACE)
            behind = !(guard->kink && is_crossed(w, guard->index)) || ahead[1] * *length > margin;
        else
            behind = g == *ending || ahead[0] > margin;
    }
    return behind;
}

/* Check whether a guard, if there is one, has the same index in the mode of a row: modes with the same slides have
 * their guards in the same order. */
static bool same_guard(const struct work *w, int64_t row, int64_t g)
{
    const struct mode *mode = mode_at(w, row);
    if (g < 0)
        return true;
    const struct guard *one = &w->mode->guard[g], *other = &mode->guard[g];
    return g < mode->guards && one->kind == other->kind && one->index == other->index;
}

/* Decide a slide whose end coincides with kinks, in the expanded mode after the kinks; ON, or the reason why Python is
 * needed. Kind GRAZE if the slide continues because its equivalent sign turns back. (The release condition of a
 * sliding override is an event and releases at once.) */
static int64_t at_end_of_slide(const struct work *w, const struct instant *at, double length, struct change *found)
{
    const struct run *run = w->run;
    const struct guard *guard = &mode_at(w, at->row)->guard[at->other];
    const double *row = row_ahead(w, run->states + at->other);
    double margin = CLEARLY_ABOVE * size_of_terms(row, 0, run->order, length);
    bool jumped = fabs(row[0]) > margin;
    double way = guard->rising_only ? -INFINITY : jumped ? row[0] : row[1] * length;
    if (!(fabs(way) > margin))
        return SELECT_MODE;
    *found = way > 0.0 ? (struct change){GRAZE, at->row, jumped ? 0 : 1}
                       : (struct change){RELEASED, guard->mode_across, jumped ? 1 : guard->zeros_at_release};
    return ON;
}

/* Enter the mode after the kinks and the other guard, and record the transitions; ON, or the reason to leave the
 * loop. */
static int64_t leave_instant(struct work *w, const struct instant *at, const struct change *found)
{
    struct run *run = w->run;
    const struct mode *target = mode_at(w, found->mode);
    const struct guard *other = at->other < 0 ? NULL : &w->mode->guard[at->other];
    bool told = other && found->kind != GRAZE;
    int64_t changes = at->kinks + (told ? 1 : 0), last = -1;
    if (run->transitions > 0 && run->transitions + changes > run->transition_capacity) {
        run->event_pending = 1;
        return BLOCK_FULL;
    }
    for (int64_t k = 0; k < changes; k++) { /* in the order of the surfaces */
        const struct guard *next = NULL;
        for (int64_t g = 0; g < w->mode->guards; g++) {
            const struct guard *guard = &w->mode->guard[g];
            bool changes_side = (w->hits[g] == 1 && guard->kink) || (told && g == at->other);
            if (changes_side && guard->index > last && !(next && next->index < guard->index))
                next = guard;
        }
        record_transition(w, next == other ? found->kind : CROSSING, next->index, next->side, run->mode, found->mode);
        last = next->index;
    }
    for (int64_t g = 0; g < target->guards; g++) {
        const struct guard *guard = &target->guard[g];
        bool crossed = guard->kink && guard->kind == SURFACE && is_crossed(w, guard->index);
        bool own = told ? is_on(guard, other->index) : other && g == at->other;
        w->known_zeros[g] = crossed ? 1 : own ? found->zeros : 0;
    }
    run->mode = found->mode;
    return events_accumulate(run) ? EVENTS_ACCUMULATE : ON;
}

/* Change the mode where kinks are crossed and at most one other guard falls; ON, or the reason why Python is needed. */
static int64_t cross_kinks(struct work *w)
{
    struct run *run = w->run;
    struct instant at;
    double length;
    if (!read_instant(w, &at))
        return SELECT_MODE;
    bool numbered = w->mode->surfaces > 0;
    if (at.row < 0)
        return numbered ? not_compiled(run, CROSSING, at.number) : SELECT_MODE;
    if (!kinks_behind(w, at.row, &at.other, &length) || !same_guard(w, at.row, at.other))
        return SELECT_MODE;
    struct change found = {CROSSING, at.row, 0};
    if (at.other >= 0) {
        const struct guard *guard = &w->mode->guard[at.other];
        const struct mode *behind = mode_at(w, at.row);
        int64_t code = guard->kind == RELEASE
                           ? at_end_of_slide(w, &at, length, &found)
                           : at_surface(w, behind, guard_on(behind, guard->index), speeds_in(w, at.row), &found);
        if (code != ON)
            return code;
        int64_t entry = found.kind == STICK ? 0 : guard->to_sign;
        int64_t number = at.number + (entry - guard->side) * three_to(guard->index);
        found.mode = known_row(w, found.mode, number);
        if (found.mode < 0)
            return numbered ? not_compiled(run, found.kind, number) : SELECT_MODE;
        int64_t ending = -1;
        if (found.kind != GRAZE && !(kinks_behind(w, found.mode, &ending, &length) && ending < 0))
            return SELECT_MODE;
        if (found.kind == RELEASED)
            found.zeros = zeros_ahead(w, mode_at(w, found.mode), guard->index, llabs(found.zeros), length);
        if (found.kind == RELEASED && found.zeros == 0)
            return SELECT_MODE;
    }
    return leave_instant(w, &at, &found);
}
