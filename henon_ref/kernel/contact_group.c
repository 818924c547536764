/* A group of contacts that act on each other, decided at an event if double precision is sufficient.
 *
 * The rule is that of henon_ref/modes/held_groups.py. The forces follow from a contact problem (contact_problem.c). A
 * contact at rest has the bounds of its static friction. If it slips in the solution and had not yet slipped at this
 * instant, its bounds change to kinetic friction, and the problem is solved again.
 *
 * Forces have the units of the equations: the load for a contact whose override defines the effect of a load ("push"),
 * else the equivalent sign, a load divided by the friction in sliding.
 */

/* Tolerance of the test that accelerations are affine, relative to the sum of their terms. */
#define SAME 1e-9

/* A group of contacts at the present point. */
struct group {
    int64_t side[MOST_IN_GROUP];    /* entry of every surface in the mode, after sections that are hit */
    bool open[MOST_IN_GROUP];       /* surfaces of the group, and sections that are hit */
    int64_t sections;               /* number of sections that are hit */
    int64_t count, contact[MOST_IN_GROUP]; /* contacts in play, in order */
    int64_t static_ones;            /* number of contacts with static friction */
    bool slipped[MOST_IN_GROUP];    /* whether a contact with static friction has reached its limit at this instant */
    double least[MOST_IN_GROUP], most[MOST_IN_GROUP]; /* range of forces that static friction allows */
    double lower[MOST_IN_GROUP], upper[MOST_IN_GROUP]; /* bounds of friction in sliding */
    struct contact_problem problem;
};

/* Numbers evaluated for a surface, in addition to its velocity dh/dt. */
enum { RISING_END, FALLING_END, INERTIA, KINETIC, OF_CONTACT }; /* same order as henon_ref/integrator/mode_code.py */

/* Properties of the contact at a place of the group: bits of enum contact. */
static int64_t kind_of(const struct work *w, const struct group *g, int64_t k)
{
    return w->tables->selection.contact[g->contact[k]];
}

/* Set the force of the contact at a place of the group. */
static void act(const struct work *w, const struct group *g, int64_t k, double *point, double force)
{
    int64_t loads = kind_of(w, g, k) & BY_LOAD ? w->tables->selection.surfaces : 0;
    point[w->run->states + loads + g->contact[k]] = force;
}

/* Bounds of a contact's force in sliding and by static friction, in units of its force; false if they are unknown.
 *
 * own: the contact's numbers without forces of the group. end_slopes: derivative of the guard of its end into the mode
 * +1 with respect to each force; divided by that of the acceleration, it gives the inertia if the override does not.
 */
static bool bound_forces(struct group *g, int64_t k, int64_t what, const double *own, const double *end_slopes)
{
    struct contact_problem *p = &g->problem;
    double inertia = own[INERTIA], largest = 0.0;
    g->upper[k] = 1.0, g->lower[k] = -1.0;
    if (!(what & FIXED))
        return true;
    for (int64_t j = 0; j < p->count && !(what & KNOWN_INERTIA); j++)
        if (j != k && fabs(p->m[k][j]) > largest)
            largest = fabs(p->m[k][j]), inertia = end_slopes[j] / p->m[k][j];
    if (what & BY_LOAD)
        g->upper[k] = inertia * own[KINETIC], g->lower[k] = -g->upper[k];
    g->most[k] = (own[RISING_END] + inertia * p->a[k]) / (inertia * p->m[k][k]);
    g->least[k] = -(own[FALLING_END] - inertia * p->a[k]) / (inertia * p->m[k][k]);
    return inertia > 0.0 && fabs(g->most[k]) < BLOWN_UP && fabs(g->least[k]) < BLOWN_UP;
}

/* Point at which velocities and numbers of all surfaces are evaluated, without forces of the group. */
static double *resting_point(const struct work *w, const struct group *g)
{
    const struct selection *selection = &w->tables->selection;
    int64_t n = w->run->states, surfaces = selection->surfaces;
    double *point = w->room;
    for (int64_t i = 0; i < n; i++)
        point[i] = w->x[i];
    for (int64_t i = 0; i < surfaces; i++) {
        point[n + i] = (double)g->side[i];
        point[n + surfaces + i] = 0.0;
    }
    for (int64_t k = 0; k < g->count; k++)
        point[n + g->contact[k]] = 0.0;
    return point;
}

/* Balance of a group's forces at the present point; false if the forces are not those of friction, or not finite. */
static bool balance(const struct work *w, struct group *g)
{
    int64_t surfaces = w->tables->selection.surfaces, count = g->count;
    double *point = resting_point(w, g), *values = point + w->run->states + 2 * surfaces;
    const double *speeds = values + w->run->states + 2 * surfaces, *numbers = speeds + surfaces;
    double own[MOST_IN_GROUP][OF_CONTACT];
    square end_slopes;
    struct contact_problem *p = &g->problem;
    p->count = count;
    velocities_at(w, point, values);
    for (int64_t k = 0; k < count; k++) {
        p->a[k] = speeds[g->contact[k]];
        memcpy(own[k], numbers + OF_CONTACT * g->contact[k], sizeof own[k]);
    }
    for (int64_t j = 0; j < count; j++) {
        act(w, g, j, point, 1.0);
        velocities_at(w, point, values);
        act(w, g, j, point, 0.0);
        for (int64_t k = 0; k < count; k++) {
            p->m[k][j] = p->a[k] - speeds[g->contact[k]];
            end_slopes[k][j] = numbers[OF_CONTACT * g->contact[k] + RISING_END] - own[k][RISING_END];
        }
    }
    for (int64_t j = 0; j < count; j++)
        act(w, g, j, point, 1.0);
    velocities_at(w, point, values);
    for (int64_t k = 0; k < count; k++) {
        double rest = speeds[g->contact[k]] - p->a[k], size = fabs(p->a[k]);
        for (int64_t j = 0; j < count; j++)
            rest += p->m[k][j], size += fabs(p->m[k][j]);
        if (!(fabs(rest) <= SAME * size && p->m[k][k] > SAME * size)) /* not affine, or not a contact */
            return false;
        if (!bound_forces(g, k, kind_of(w, g, k), own[k], end_slopes[k]))
            return false;
    }
    return true;
}

/* Entry of a surface in the present mode. */
static int64_t present_entry(const struct work *w, int64_t surface)
{
    return w->words ? entry_in(w->entries, surface) : entry_of(w->mode->number, surface);
}

/* Mark the surface "first" as open, or all surfaces that are hit (NOWHERE), and all surfaces slid on or at zero that
 * act on them, directly or through others; false if a guard at zero belongs to no surface. */
static bool mark_open(const struct work *w, struct group *g, int64_t first, bool *released)
{
    const struct selection *selection = &w->tables->selection;
    int64_t surfaces = selection->surfaces;
    bool zero[MOST_IN_GROUP], more = true;
    for (int64_t i = 0; i < surfaces; i++)
        zero[i] = g->side[i] == 0, g->open[i] = i == first, released[i] = false;
    for (int64_t k = 0; k < w->mode->guards; k++)
        if (w->hits[k] == 1) {
            int64_t i = w->mode->guard[k].index;
            if (w->mode->guard[k].kind == VALID)
                return false;
            zero[i] = !(w->words && selection->contact[i] & SECTION);
            g->open[i] = g->open[i] || first < 0;
            released[i] = released[i] || w->mode->guard[k].kind == RELEASE;
        }
    while (more) {
        more = false;
        for (int64_t i = 0; i < surfaces; i++)
            for (int64_t j = 0; j < surfaces; j++)
                if (g->open[i] && zero[j] && !g->open[j] && selection->beside[i * surfaces + j])
                    g->open[j] = more = true;
    }
    return true;
}

/* Contacts in play, of the group of one surface or of all surfaces that are hit (NOWHERE), after sections that are hit;
 * false if other surfaces are open. */
static bool find_group(const struct work *w, struct group *g, int64_t first)
{
    const struct selection *selection = &w->tables->selection;
    bool released[MOST_IN_GROUP];
    for (int64_t i = 0; i < selection->surfaces; i++)
        g->side[i] = present_entry(w, i);
    if (!mark_open(w, g, first, released))
        return false;
    g->count = g->static_ones = g->sections = 0;
    for (int64_t i = 0; i < selection->surfaces; i++) {
        bool fixed = selection->contact[i] & FIXED;
        if (g->open[i] && selection->contact[i] & SECTION) {
            if (g->side[i] == 0)
                return false;
            g->side[i] = -g->side[i], g->sections += 1;
        } else if (g->open[i]) {
            g->static_ones += fixed;
            g->slipped[g->count] = released[i] && fixed;
            g->contact[g->count++] = i;
        }
    }
    return true;
}

/* Check whether a load reaches its limit where a section is crossed: behind a kink the load may decrease. */
static bool load_may_turn(const struct work *w, const struct group *g)
{
    bool reached = false, section = false;
    for (int64_t k = 0; k < g->count; k++)
        reached = reached || g->slipped[k];
    for (int64_t k = 0; k < w->mode->guards; k++)
        section = section || (w->hits[k] == 1 && w->tables->selection.contact[w->mode->guard[k].index] & SECTION);
    return reached && section;
}

/* Check whether the sections that are hit are crossed with a speed. */
static bool sections_crossed(const struct work *w, const struct group *g)
{
    const struct selection *selection = &w->tables->selection;
    int64_t surfaces = selection->surfaces;
    double *point = resting_point(w, g), *values = point + w->run->states + 2 * surfaces;
    const double *velocity = values + w->run->states + 2 * surfaces;
    velocities_at(w, point, values);
    for (int64_t i = 0; i < surfaces; i++)
        if (selection->contact[i] & SECTION && g->open[i] && !((double)g->side[i] * velocity[i] > 0.0))
            return false;
    return true;
}

/* Decide which contacts of a group hold, and how the others slip; false if that is not clear, as where the normal force
 * of a contact returns from zero: the error of the time may have made it negative. */
static bool settled(const struct work *w, struct group *g, struct accelerations *s)
{
    if (!balance(w, g))
        return false;
    for (bool more = true; more;) {
        for (int64_t k = 0; k < g->count; k++) {
            bool fixed = kind_of(w, g, k) & FIXED && !g->slipped[k];
            g->problem.lower[k] = fixed ? g->least[k] : g->lower[k];
            g->problem.upper[k] = fixed ? g->most[k] : g->upper[k];
            if (!(g->problem.lower[k] < g->problem.upper[k]))
                return false;
        }
        if (!clearly_solved(&g->problem, s))
            return false;
        more = false;
        for (int64_t k = 0; k < g->count; k++)
            if (kind_of(w, g, k) & FIXED && !g->slipped[k] && s->entry[k] != 0)
                g->slipped[k] = more = true;
    }
    for (int64_t k = 0; k < g->count; k++) /* a contact that kinetic friction would hold may exceed static friction */
        if (g->slipped[k] && s->entry[k] == 0)
            return false;
    return true;
}

/* Decide the entries of a group's contacts, written to "side"; false if the decision is not clear. */
static bool group_decided(const struct work *w, struct group *g)
{
    struct accelerations s;
    if (load_may_turn(w, g) || (g->sections && !sections_crossed(w, g)))
        return false;
    if (w->words || g->static_ones || g->count > MOST_COUPLED) {
        if (!settled(w, g, &s))
            return false;
    } else { /* general forces, not only friction */
        struct in_play p = {.count = g->count, .first = w->run->states + 2 * w->tables->selection.surfaces};
        struct affine f;
        p.point = resting_point(w, g), p.values = p.point + p.first;
        for (int64_t k = 0; k < g->count; k++)
            p.surface[k] = g->contact[k];
        if (!affine_velocities(w, &p, &f))
            return false;
        find_multiples(w, &p, &f);
        int64_t found = only_candidate(&f, p.count);
        if (found < 0)
            return false;
        for (int64_t k = 0; k < g->count; k++)
            s.entry[k] = choice(found, k);
    }
    for (int64_t k = 0; k < g->count; k++)
        g->side[g->contact[k]] = s.entry[k];
    return true;
}

/* Number of the mode that follows from the guards at zero (hits) of the present mode, a row, in a system with static
 * friction; UNCLEAR if the decision is not clear. */
static int64_t mode_of_contacts(const struct work *w)
{
    struct group g;
    int64_t number = 0;
    if (!find_group(w, &g, NOWHERE) || !group_decided(w, &g))
        return UNCLEAR;
    for (int64_t i = w->mode->surfaces - 1; i >= 0; i--)
        number = 3 * number + g.side[i] + 1;
    return number;
}
