/* Output of a run: transitions, samples and steps; and the mode that is entered with a transition. */

/* Number of consecutive events, each closer to the last one than the resolution of time, that count as accumulating. */
#define MOST_AT_ONCE 64

/* Place of a surface, or of an expression that ends the run ("valid"), in the times "since" (struct places). */
HENON_EXPORT int64_t rounding_place(int64_t valid, int64_t index, int64_t guards)
{
    return valid ? guards - 1 - index : index;
}

/* Transition k of the block. */
static inline struct transition *transition_at(const struct work *w, int64_t k)
{
    return (struct transition *)(w->records + k * w->record_width);
}

/* Record a transition, and stop the run if it is to end on that surface. side: from which it came, 0 for a release. */
static void record_transition(struct work *w, int64_t kind, int64_t index, int64_t side, int64_t source, int64_t target)
{
    struct run *run = w->run;
    struct transition *made = transition_at(w, run->transitions);
    made->time = run->time, made->time_low = run->time_low;
    made->kind = (int8_t)kind, made->surface = (int16_t)index, made->landing = (int8_t)run->landing;
    made->from_mode = (int32_t)source, made->to_mode = (int32_t)target;
    for (int64_t i = 0; i < run->states; i++)
        made->state[i] = w->x[i];
    int64_t *words = (int64_t *)(made->state + run->states);
    for (int64_t k = 0; k < w->words; k++)
        words[k] = w->left[k], words[w->words + k] = w->entries[k];
    run->transitions += 1;
    int64_t ends_here = side > 0 ? run->stop_falling : side < 0 ? run->stop_rising : 0;
    if (ends_here != 0 && has_bit(ends_here, index) && run->stopped == 0)
        run->stopped = 1 + index;
}

/* Count consecutive events that a double's time does not resolve; 1 if there are too many. */
HENON_EXPORT int64_t events_accumulate(struct run *run)
{
    double gap = (run->time - run->event_time) + (run->time_low - run->event_time_low);
    run->events_at_once = gap <= 2.0 * EPS * fabs(run->time) ? run->events_at_once + 1 : 0;
    run->event_time = run->time, run->event_time_low = run->time_low;
    return run->events_at_once >= MOST_AT_ONCE;
}

/* Next sample: its time, then room for states and mode; NULL if there is none. */
static double *wanted_sample(const struct work *w)
{
    int64_t places = 1 + w->run->states + (w->words ? w->words : 1), next = w->run->next_sample;
    return next < w->sample_count ? w->samples + next * places : NULL;
}

/* Write the mode after a sample's states, and advance to the next sample. */
static void end_sample(struct work *w, double *sample)
{
    double *mode = sample + 1 + w->run->states;
    if (w->words)
        memcpy(mode, w->entries, (size_t)w->words * sizeof(int64_t));
    else
        *mode = (double)w->run->mode;
    w->run->next_sample += 1;
}

/* Fill the samples on the step just taken, up to "part" (in the unit). */
static void fill_samples(struct work *w, double part)
{
    const struct run *run = w->run;
    for (double *sample; (sample = wanted_sample(w)) != NULL; end_sample(w, sample)) {
        double at = ((sample[0] - run->time) - run->time_low) / run->unit;
        if (at > part)
            return;
        for (int64_t i = 0; i < run->states; i++)
            sample[1 + i] = value(row_of(w, i), run->order, larger(at, 0.0));
    }
}

/* Fill the remaining samples with the state at the horizon, to which a nearby event has brought the run. */
static void fill_samples_at_horizon(struct work *w)
{
    for (double *sample; (sample = wanted_sample(w)) != NULL && sample[0] <= w->run->horizon; end_sample(w, sample))
        memcpy(sample + 1, w->x, (size_t)w->run->states * sizeof(double));
}

/* Record the step of a length that is about to be taken; true if there is no room for a further step. */
static bool record_step(struct work *w, double length)
{
    struct run *run = w->run;
    int64_t n = run->states, columns = run->order + 1;
    struct step *step = (struct step *)(run->dense + run->dense_steps * (STEP_PLACES + n * columns));
    step->time = run->time, step->time_low = run->time_low;
    step->length = length, step->unit = run->unit, step->mode = run->mode;
    for (int64_t i = 0; i < n; i++)
        for (int64_t k = 0; k < columns; k++)
            step->coefficients[i * columns + k] = row_of(w, i)[k];
    run->dense_steps += 1;
    return run->dense_steps >= run->dense_capacity;
}

/* Record a step that has no series, as a straight line from the present state to "state". */
static void record_line(struct work *w, double length, const double *state, int64_t mode)
{
    struct run *run = w->run;
    int64_t n = run->states, columns = run->order + 1;
    struct step *step = (struct step *)(run->dense + run->dense_steps * (STEP_PLACES + n * columns));
    record_step(w, length);
    step->mode = mode;
    for (int64_t i = 0; i < n; i++) {
        double *row = step->coefficients + i * columns;
        memset(row, 0, (size_t)columns * sizeof(double));
        row[0] = w->x[i], row[1] = (state[i] - w->x[i]) * (run->unit / length);
    }
}

/* Check whether a guard is that of a surface. */
static inline bool is_on(const struct guard *guard, int64_t surface)
{
    return guard->kind == SURFACE && guard->index == surface;
}

/* Set the known zeros of the guards at the start of a mode: those of the surface just left. */
static inline void set_known_zeros(struct work *w, const struct mode *mode, int64_t surface, int64_t zeros)
{
    for (int64_t g = 0; g < mode->guards; g++)
        w->known_zeros[g] = is_on(&mode->guard[g], surface) ? zeros : 0;
}

/* Enter the mode in row "target", in which several surfaces may have changed, and record the transitions; false if
 * Python has to record them. */
static bool change_mode(struct work *w, int64_t target)
{
    struct run *run = w->run;
    const struct mode *after = mode_at(w, target);
    int64_t before[MOST_SURFACES], now[MOST_SURFACES], surfaces = w->mode->surfaces, mode = run->mode, changes = 0;
    for (int64_t i = 0; i < surfaces; i++) {
        before[i] = entry_of(w->mode->number, i), now[i] = entry_of(after->number, i);
        changes += before[i] != now[i] ? 1 : 0;
    }
    if (changes == 0 || run->transitions + changes > run->transition_capacity)
        return false;
    for (int64_t i = 0; i < surfaces; i++)
        if (before[i] != now[i]) {
            int64_t kind = now[i] == 0 ? STICK : before[i] == 0 ? RELEASED : CROSSING;
            record_transition(w, kind, i, before[i], mode, target);
        }
    for (int64_t g = 0; g < after->guards; g++) {
        w->known_zeros[g] = 0;
        if (after->guard[g].kind != SURFACE)
            continue;
        int64_t surface = after->guard[g].index; /* left with a speed: the decision was clear */
        w->known_zeros[g] = before[surface] == 0 ? 1 : 0;
        for (int64_t k = 0; k < w->mode->guards; k++) {
            const struct guard *hit = &w->mode->guard[k];
            if (w->hits[k] == 1 && hit->index == surface) /* so is the end of a slide at which no force jumps */
                w->known_zeros[g] = hit->kind == RELEASE && hit->zeros_at_release > 0 ? hit->zeros_at_release : 1;
        }
    }
    run->mode = target;
    return true;
}
