/* Contacts that act on each other, decided at an event if double precision is sufficient.
 *
 * The rule is that of henon_ref/modes/held_groups.py and contact_problem.py: Gauss's principle with Coulomb's friction.
 * The relative accelerations of a group's contacts are affine in their forces, N = a - M f. Each force is between its
 * bounds, at the upper bound if N > 0, at the lower bound if N < 0 (Moreau 1985, Sec. 2; Glocker 2001, Ch. 6). Block
 * principal pivoting finds the contacts that hold (Judice and Pires, Comput. Oper. Res. 21 (1994) 587-596). A contact
 * at rest has the bounds of its static friction. If it slips in the solution and had not yet slipped at this instant,
 * its bounds change to kinetic friction, and the problem is solved again.
 *
 * Forces have the units of the equations: the load for a contact whose override defines the effect of a load ("push"),
 * else the equivalent sign, a load divided by the friction in sliding.
 *
 * Every number may be wrong by the part CLEAR_MARGIN of its terms, as the states are. Skeel's componentwise condition
 * (J. ACM 26 (1979) 494-526) bounds the effect on the forces to first order. If some sign is uncertain within these
 * bounds, Python decides.
 */

/* Tolerance of the bounds during the pivots, relative to the terms of a number. */
#define PIVOT_ROUNDING 1e-12
/* Pivots below this part of a contact's own inverse inertia count as zero: the part of M is singular. */
#define RANK 1e-8
/* Tolerance of the test that accelerations are affine, relative to the sum of their terms. */
#define SAME 1e-9
/* Block pivots in a row without progress before single pivots; largest number of pivots per contact. */
#define PATIENCE 10
#define MOST_PIVOTS 100

typedef double square[MOST_IN_GROUP][MOST_IN_GROUP];

/* Contact problem N = a - M f of a group. */
struct contact_problem {
    int64_t count;
    double a[MOST_IN_GROUP], lower[MOST_IN_GROUP], upper[MOST_IN_GROUP];
    square m;
};

/* Solution of a contact problem. */
struct accelerations {
    double force[MOST_IN_GROUP], speed[MOST_IN_GROUP], size[MOST_IN_GROUP]; /* f, N, sizes of N's terms */
    int64_t entry[MOST_IN_GROUP]; /* 0: force between its bounds; -1, +1: at the lower, at the upper bound */
};

/* Contacts that hold: their number and places, and the LU factors of their part of M. */
struct held_part {
    int64_t count, place[MOST_IN_GROUP], row[MOST_IN_GROUP];
    square lu;
};

/* LU factorisation, with row exchanges, of the held contacts' part of M; false if that is nearly singular. */
static bool factorised(const struct contact_problem *p, const int64_t *entry, struct held_part *held)
{
    held->count = 0;
    for (int64_t k = 0; k < p->count; k++)
        if (entry[k] == 0)
            held->place[held->count++] = k;
    int64_t count = held->count;
    for (int64_t r = 0; r < count; r++) {
        held->row[r] = r;
        for (int64_t q = 0; q < count; q++)
            held->lu[r][q] = p->m[held->place[r]][held->place[q]];
    }
    for (int64_t k = 0; k < count; k++) {
        int64_t pivot = k;
        for (int64_t r = k + 1; r < count; r++)
            if (fabs(held->lu[held->row[r]][k]) > fabs(held->lu[held->row[pivot]][k]))
                pivot = r;
        int64_t chosen = held->row[pivot];
        held->row[pivot] = held->row[k], held->row[k] = chosen;
        if (!(fabs(held->lu[chosen][k]) > RANK * p->m[held->place[k]][held->place[k]]))
            return false;
        for (int64_t r = k + 1; r < count; r++) {
            double *row = held->lu[held->row[r]];
            row[k] /= held->lu[chosen][k];
            for (int64_t q = k + 1; q < count; q++)
                row[q] -= row[k] * held->lu[chosen][q];
        }
    }
    return true;
}

/* Solve with these factors; x and the right side are in the order of the held contacts. */
static void solve_factorised(const struct held_part *held, const double *right, double *x)
{
    int64_t count = held->count;
    for (int64_t r = 0; r < count; r++) {
        x[r] = right[held->row[r]];
        for (int64_t q = 0; q < r; q++)
            x[r] -= held->lu[held->row[r]][q] * x[q];
    }
    for (int64_t r = count - 1; r >= 0; r--) {
        for (int64_t q = r + 1; q < count; q++)
            x[r] -= held->lu[held->row[r]][q] * x[q];
        x[r] /= held->lu[held->row[r]][r];
    }
}

/* Forces and accelerations for given entries; false if the held contacts' part of M is nearly singular. */
static bool balanced(const struct contact_problem *p, struct accelerations *s, struct held_part *held)
{
    int64_t count = p->count;
    double right[MOST_IN_GROUP] = {0.0}, found[MOST_IN_GROUP];
    if (!factorised(p, s->entry, held))
        return false;
    for (int64_t k = 0; k < count; k++)
        s->force[k] = s->entry[k] > 0 ? p->upper[k] : s->entry[k] < 0 ? p->lower[k] : 0.0;
    for (int64_t r = 0; r < held->count; r++) {
        int64_t k = held->place[r];
        right[r] = p->a[k];
        for (int64_t j = 0; j < count; j++)
            right[r] -= p->m[k][j] * s->force[j];
    }
    solve_factorised(held, right, found);
    for (int64_t r = 0; r < held->count; r++)
        s->force[held->place[r]] = found[r];
    for (int64_t k = 0; k < count; k++) {
        s->speed[k] = p->a[k], s->size[k] = fabs(p->a[k]);
        for (int64_t j = 0; j < count; j++) {
            s->speed[k] -= p->m[k][j] * s->force[j];
            s->size[k] += fabs(p->m[k][j] * s->force[j]);
        }
    }
    return true;
}

/* Check whether every sign that the solution relies on is certain if each number is wrong by the part CLEAR_MARGIN. */
static bool is_clear(const struct contact_problem *p, const struct accelerations *s, const struct held_part *held)
{
    double off[MOST_IN_GROUP] = {0.0}, right[MOST_IN_GROUP], column[MOST_IN_GROUP];
    for (int64_t c = 0; c < held->count; c++) { /* column c of the inverse */
        for (int64_t r = 0; r < held->count; r++)
            right[r] = r == c ? 1.0 : 0.0;
        solve_factorised(held, right, column);
        for (int64_t r = 0; r < held->count; r++)
            off[held->place[r]] += CLEAR_MARGIN * fabs(column[r]) * s->size[held->place[c]];
    }
    for (int64_t k = 0; k < p->count; k++) {
        double room, margin = off[k];
        if (s->entry[k] == 0) {
            room = smaller(p->upper[k] - s->force[k], s->force[k] - p->lower[k]);
            margin += CLEAR_MARGIN * larger(fabs(p->upper[k]), fabs(p->lower[k]));
        } else {
            room = (double)s->entry[k] * s->speed[k];
            margin = CLEAR_MARGIN * s->size[k];
            for (int64_t r = 0; r < held->count; r++)
                margin += fabs(p->m[k][held->place[r]]) * off[held->place[r]];
        }
        if (!(room > margin))
            return false;
    }
    return true;
}

/* Solve a contact problem by block principal pivoting; false if it has no clear solution. */
static bool clearly_solved(const struct contact_problem *p, struct accelerations *s)
{
    int64_t count = p->count, fewest = count + 1, patience = PATIENCE;
    struct held_part held;
    for (int64_t k = 0; k < count; k++)
        s->entry[k] = 0;
    for (int64_t pivots = 0; pivots < MOST_PIVOTS * (count + 1); pivots++) {
        if (!balanced(p, s, &held))
            return false;
        int64_t turned[MOST_IN_GROUP], wrong = 0, last = -1;
        for (int64_t k = 0; k < count; k++) {
            double tolerance = PIVOT_ROUNDING * (fabs(s->force[k]) + s->size[k] / p->m[k][k]);
            turned[k] = s->entry[k];
            if (s->entry[k] == 0)
                turned[k] = s->force[k] - p->upper[k] > tolerance ? 1 : p->lower[k] - s->force[k] > tolerance ? -1 : 0;
            else if ((double)s->entry[k] * s->speed[k] < -PIVOT_ROUNDING * s->size[k])
                turned[k] = 0;
            if (turned[k] != s->entry[k])
                wrong += 1, last = k;
        }
        if (wrong == 0)
            return is_clear(p, s, &held);
        patience = wrong < fewest ? PATIENCE : patience - 1;
        fewest = least(fewest, wrong);
        for (int64_t k = 0; k < count; k++)
            if (patience > 0 || k == last)
                s->entry[k] = turned[k];
    }
    return false;
}

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
    velocities_at(w, point, values);
    for (int64_t i = 0; i < surfaces; i++)
        if (selection->contact[i] & SECTION && g->open[i] && !((double)g->side[i] * values[w->run->states + 2 * surfaces + i] > 0.0))
            return false;
    return true;
}

/* Decide which contacts of a group hold, and how the others slip; false if that is not clear. */
static bool settled(const struct work *w, struct group *g, struct accelerations *s)
{
    if (!balance(w, g))
        return false;
    for (bool more = true; more;) {
        for (int64_t k = 0; k < g->count; k++) {
            bool fixed = kind_of(w, g, k) & FIXED && !g->slipped[k];
            g->problem.lower[k] = fixed ? g->least[k] : g->lower[k];
            g->problem.upper[k] = fixed ? g->most[k] : g->upper[k];
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
        int64_t found = affine_velocities(w, &p, &f) ? only_candidate(&f, p.count) : UNCLEAR;
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
