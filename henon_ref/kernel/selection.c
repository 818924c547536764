/* Mode selection where several surfaces meet or slide, in machine code if the decision is clear.
 *
 * The rule is that of henon_ref/modes/selection.py: of all candidate modes, take the one that its own field keeps. If
 * no normal velocity contains the sign of another surface, each surface is decided alone, by its velocities on both
 * sides; otherwise by candidates.c. Python decides all unclear cases: a number within CLEAR_MARGIN of a tie, no or
 * several consistent modes, products of signs.
 */

/* Candidate of surfaces that do not act on each other, by their velocities on both sides; -1 if it is not clear. */
static int64_t each_alone(const struct work *w, const struct in_play *p)
{
    for (int side = 0; side < 2; side++) {
        for (int64_t i = w->run->states; i < p->first; i++)
            p->point[i] = 2.0 * side - 1.0;
        velocities_at(w, p->point, side == 0 ? p->values : p->others);
    }
    int64_t found = 0, power = 1;
    for (int64_t k = 0; k < p->count; k++) {
        int64_t surface = p->surface[k], entry;
        double below = p->values[p->first + surface], above = p->others[p->first + surface];
        double margin = CLEAR_MARGIN * larger(fabs(below), fabs(above));
        if (p->released[k] != 0)
            entry = p->released[k];
        else if (below > margin && above < -margin)
            entry = 0;
        else if (entry_of(w->mode->number, surface) == 0) /* not hit: it slides on, if it is far from its own release */
            return -1;
        else if (smaller(below, above) > margin)
            entry = 1;
        else if (larger(below, above) < -margin)
            entry = -1;
        else
            return -1;
        found += (entry + 1) * power;
        power *= 3;
    }
    return found;
}

/* Check whether all guards at zero that end slides fall through zero, at most one of each contact. */
static bool ends_fall(struct work *w)
{
    const struct run *run = w->run;
    bool found = true, expanded = false;
    for (int64_t g = 0; g < w->mode->guards; g++) {
        if (w->hits[g] != 1)
            continue;
        found = found && w->mode->guard[g].kind != VALID;
        for (int64_t other = 0; other < g; other++)
            found = found && !(w->hits[other] == 1 && w->mode->guard[other].index == w->mode->guard[g].index);
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

/* Collect the surfaces that the mode slides on or whose guards are at zero; false if a guard that ends the run is at
 * zero, or the end of a slide after which other forces jump. */
static bool surfaces_in_play(const struct work *w, struct in_play *p)
{
    p->count = p->releases = p->hits = 0;
    for (int64_t i = 0; i < w->tables->selection.surfaces; i++) {
        bool involved = entry_of(w->mode->number, i) == 0;
        p->released[p->count] = 0;
        for (int64_t g = 0; g < w->mode->guards; g++) {
            const struct guard *guard = &w->mode->guard[g];
            if (w->hits[g] == 1 && guard->kind == VALID)
                return false;
            if (w->hits[g] != 1 || guard->index != i)
                continue;
            bool ends = guard->kind == RELEASE && guard->coupled == UNCOUPLED && guard->zeros_at_release > 0;
            if (guard->kind != SURFACE && !ends)
                return false;
            involved = true;
            p->released[p->count] = ends ? guard->to_sign : 0;
            p->releases += ends ? 1 : 0, p->hits += ends ? 0 : 1;
        }
        if (involved)
            p->surface[p->count++] = i;
    }
    return true;
}

/* Candidate in which slides have ended and nothing else has changed. */
static int64_t released(const struct in_play *p)
{
    int64_t found = 0;
    for (int64_t k = p->count - 1; k >= 0; k--)
        found = 3 * found + p->released[k] + 1;
    return found;
}

/* Row of the mode that follows from the guards at zero (hits); UNCLEAR if that is not clear, or the mode not
 * compiled. */
static int64_t select_mode(struct work *w)
{
    const struct selection *selection = &w->tables->selection;
    int64_t n = w->run->states, surfaces = selection->surfaces, number = w->mode->number, found;
    struct in_play p = {.first = n + surfaces, .point = w->room};
    p.values = p.point + n + surfaces, p.others = p.values + n + 2 * surfaces;
    if (!surfaces_in_play(w, &p) || (p.releases > 0 && !ends_fall(w)))
        return UNCLEAR;
    for (int64_t i = 0; i < n; i++)
        p.point[i] = w->x[i];
    for (int64_t i = 0; i < surfaces; i++)
        p.point[n + i] = (double)entry_of(number, i);
    if (selection->decoupled) {
        found = each_alone(w, &p);
    } else if (p.hits == 0) { /* equivalent signs at their limits: no force jumps, so that each slide ends alone */
        found = released(&p);
    } else {
        struct affine f;
        if (p.releases > 0 || p.count > MOST_COUPLED || !affine_velocities(w, &p, &f))
            return UNCLEAR;
        find_multiples(w, &p, &f);
        found = only_candidate(&f, p.count);
    }
    if (found < 0)
        return UNCLEAR;
    for (int64_t k = 0; k < p.count; k++) {
        int64_t i = p.surface[k];
        number += (choice(found, k) - entry_of(w->mode->number, i)) * three_to(i);
    }
    return row_of_number(w, number);
}
