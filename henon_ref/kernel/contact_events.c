/* Events of contacts whose modes are numbers (contacts.c), if guards of several surfaces are at zero at one instant, or
 * other contacts act on the one that is hit.
 *
 * First the kinks (struct guard) are crossed, because no mode slides on them. Then the contacts are decided: a contact
 * alone if no other contact in play acts on it, else its whole group (contact_group.c). In the resulting mode the
 * kinks must be left with a speed, and slides that nothing has ended must clearly continue. If that is not clear, the
 * mode is restored, and Python decides.
 *
 * For each surface i the places 2 i and 2 i + 1 of "faint", which the next step overwrites, hold the known zeros with
 * which the surface is left, and its state (END_FALLS, DECIDED).
 */
enum { END_FALLS = 1, DECIDED = 2 };

/* Cross the kinks that are hit, and mark the ends of slides whose guards fall through zero after the kinks; false if a
 * guard at zero belongs to no surface, or both guards of one surface are at zero (one may be so at all times). */
static bool kinks_crossed(struct work *w, int64_t *kinks)
{
    const struct run *run = w->run;
    int64_t ends = 0;
    *kinks = 0;
    for (int64_t g = 0; g < w->mode->guards; g++)
        w->faint[g] = 0;
    for (int64_t g = 0; g < w->mode->guards; g++) {
        const struct guard *guard = &w->mode->guard[g];
        if (w->hits[g] != 1)
            continue;
        if (g >= 2 * run->contacts || w->hits[g ^ 1] != 0)
            return false;
        ends += guard->kind == RELEASE ? 1 : 0;
        if (guard->kink) {
            w->faint[2 * guard->index] = 1, w->faint[2 * guard->index + 1] = DECIDED;
            go_over(w, guard->index, guard->mode_across);
            *kinks += 1;
        }
    }
    if (ends > 0)
        expand(w, w->x, w->ahead);
    for (int64_t g = 0; g < w->mode->guards && ends > 0; g++) {
        const double *row = row_ahead(w, run->states + g);
        if (w->hits[g] == 1 && w->mode->guard[g].kind == RELEASE) {
            if (row_ahead(w, run->states + (g ^ 1))[0] == 0.0)
                return false;
            bool falls = *kinks == 0 && g == run->guard;
            if (falls || row[1] < -TANGENT * size_of_terms(row, 1, run->order, 1.0))
                w->faint[2 * w->mode->guard[g].index + 1] = END_FALLS;
        }
    }
    return true;
}

/* Decide a contact whose guard is at zero, and on which no other contact in play acts, and change its entry; false if
 * the decision is not clear. */
static bool alone_decided(struct work *w, int64_t g)
{
    const struct guard *guard = &w->mode->guard[g];
    int64_t index = guard->index;
    struct change found = {RELEASED, guard->mode_across, guard->zeros_at_release};
    if (guard->kind == SURFACE ? at_surface(w, w->mode, g, speeds_at(w), &found) != ON
                               : w->faint[2 * index + 1] != END_FALLS)
        return false;
    go_over(w, index, found.mode);
    if (found.zeros == 0 && found.kind == RELEASED)
        found.zeros = zeros_at_release(w->mode, index, speeds_at(w));
    w->faint[2 * index] = found.zeros, w->faint[2 * index + 1] = DECIDED;
    return found.kind == STICK || found.zeros > 0;
}

/* Decide a contact together with all contacts in play that act on it; false if the decision is not clear. */
static bool contact_decided(struct work *w, int64_t g)
{
    struct group group = {.count = 1};
    int64_t index = w->mode->guard[g].index;
    if (w->faint[2 * index + 1] == DECIDED)
        return true;
    if (w->tables->selection.contact && !find_group(w, &group, index))
        return false;
    if (group.count == 1)
        return alone_decided(w, g);
    if (!group_decided(w, &group))
        return false;
    for (int64_t k = 0; k < group.count; k++) { /* left with a speed: the decision is clear */
        int64_t i = group.contact[k], entry = group.side[i];
        go_over(w, i, entry + 1);
        w->faint[2 * i] = entry != 0, w->faint[2 * i + 1] = DECIDED;
    }
    return true;
}

/* Check whether the entered mode leaves the kinks, and nothing ends the mode, or a slide in it, at once. */
static bool entered_clearly(struct work *w, int64_t kinks)
{
    const struct run *run = w->run;
    if (kinks == 0 && w->mode->guards == 2 * run->contacts)
        return true;
    expand(w, w->x, w->ahead);
    double length = length_ahead(w, run->states + w->mode->guards);
    bool clear = length > 0.0;
    for (int64_t g = 0; g < w->mode->guards && clear; g++) {
        const struct guard *guard = &w->mode->guard[g];
        const double *row = row_ahead(w, run->states + g);
        double margin = CLEARLY_ABOVE * size_of_terms(row, 0, run->order, length);
        bool decided = guard->kind != VALID && w->faint[2 * guard->index + 1] == DECIDED;
        if (guard->kind == VALID || (guard->kind == RELEASE && !decided && kinks > 0))
            clear = row[0] > margin;
        else if (guard->kink && decided)
            clear = row[1] * length > margin;
    }
    return clear;
}

/* Change the entries of all surfaces with an event here; ON, or the reason why Python is needed, the mode restored. */
static int64_t change_entries(struct work *w)
{
    struct run *run = w->run;
    int64_t kinks, changes = 0;
    bool clear = kinks_crossed(w, &kinks);
    for (int64_t g = 0; g < w->mode->guards && clear; g++)
        clear = w->hits[g] != 1 || contact_decided(w, g);
    clear = clear && entered_clearly(w, kinks);
    for (int64_t i = 0; i < run->contacts; i++)
        changes += entry_in(w->entries, i) != entry_in(w->left, i);
    bool full = clear && run->transitions > 0 && run->transitions + changes > run->transition_capacity;
    if (!clear || full || changes == 0) {
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
        if (now != 0)
            w->known_zeros[2 * i] = w->faint[2 * i];
        if (before != now)
            record_transition(w, now == 0 ? STICK : before == 0 ? RELEASED : CROSSING, i, before, 0, 0);
    }
    return events_accumulate(run) ? EVENTS_ACCUMULATE : ON;
}
