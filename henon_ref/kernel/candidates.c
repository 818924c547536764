/* Candidate modes where surfaces act on each other (see selection.c).
 *
 * At a point the normal velocities are affine in the signs of the surfaces in play, N = a + B s. For each candidate the
 * equivalent signs of its sliding surfaces solve B s = -a; the remaining velocities must point into the candidate.
 */

/* Smallest relative distance from a tie at which double precision decides. */
#define CLEAR_MARGIN 1e-6

/* Surfaces in play at an event, and the work space for their normal velocities. */
struct in_play {
    int64_t surface[MOST_SURFACES];
    int64_t released[MOST_SURFACES]; /* side to which the surface is released; 0 if it is not */
    int64_t releases, hits;          /* number of surfaces released, and of surfaces hit in slip */
    int64_t count;
    int64_t first;            /* index of the first velocity among the values */
    double *point;            /* states, then the sign of every surface */
    double *values, *others;  /* states, signs, then normal velocities, for two choices of signs */
};

/* Normal velocities of the surfaces in play, a + B s; and the work space for one candidate: its signs s, and the linear
 * system of its sliding surfaces (m, index). */
struct affine {
    double a[MOST_COUPLED], b[MOST_COUPLED][MOST_COUPLED];
    double size[MOST_COUPLED]; /* sum of the sizes of a velocity's terms */
    double lean[MOST_COUPLED]; /* sign of a velocity that has the same sign for all s; else 0 */
    bool idle[MOST_COUPLED];   /* whether no velocity has the surface's sign: a section, or a kink of another rate */
    int64_t same[MOST_COUPLED]; /* first surface of which this one is a multiple; in "turned" the sign of the factor */
    double turned[MOST_COUPLED];
    double s[MOST_COUPLED];
    double m[MOST_COUPLED][MOST_COUPLED + 1];
    int64_t index[MOST_COUPLED];
};

/* Entry of the k-th surface in play in a candidate (a number of base 3). */
static int64_t choice(int64_t candidate, int64_t k)
{
    return candidate / three_to(k) % 3 - 1;
}

/* Evaluate the normal velocities, for the signs in "point", into "values". */
static void velocities_at(const struct work *w, const double *point, double *values)
{
    const struct selection *selection = &w->tables->selection;
    selection->velocities(w->run->time, w->run->time_low, 1.0, point, selection->constants, values);
}

/* Determine a and B from the velocities at all choices of signs -1, +1; false if the velocities are not affine. */
static bool affine_velocities(const struct work *w, const struct in_play *p, struct affine *f)
{
    int64_t n = w->run->states, count = p->count, corners = (int64_t)1 << count;
    double found[1 << MOST_COUPLED][MOST_COUPLED];
    for (int64_t corner = 0; corner < corners; corner++) {
        for (int64_t k = 0; k < count; k++)
            p->point[n + p->surface[k]] = corner >> k & 1 ? 1.0 : -1.0;
        velocities_at(w, p->point, p->values);
        for (int64_t k = 0; k < count; k++)
            found[corner][k] = p->values[p->first + p->surface[k]];
    }
    for (int64_t k = 0; k < count; k++) {
        f->a[k] = 0.0;
        for (int64_t j = 0; j < count; j++)
            f->b[k][j] = 0.0;
        for (int64_t corner = 0; corner < corners; corner++) {
            f->a[k] += found[corner][k] / (double)corners;
            for (int64_t j = 0; j < count; j++)
                f->b[k][j] += (corner >> j & 1 ? found[corner][k] : -found[corner][k]) / (double)corners;
        }
        f->size[k] = fabs(f->a[k]);
        for (int64_t j = 0; j < count; j++)
            f->size[k] += fabs(f->b[k][j]);
        bool leans = 2.0 * fabs(f->a[k]) - f->size[k] > CLEAR_MARGIN * f->size[k];
        f->lean[k] = !leans ? 0.0 : f->a[k] > 0.0 ? 1.0 : -1.0;
        for (int64_t corner = 0; corner < corners; corner++) {
            double rest = found[corner][k] - f->a[k];
            for (int64_t j = 0; j < count; j++)
                rest -= corner >> j & 1 ? f->b[k][j] : -f->b[k][j];
            if (!(fabs(rest) <= 1e-3 * CLEAR_MARGIN * f->size[k])) /* not affine, or not a number */
                return false;
        }
    }
    for (int64_t j = 0; j < count; j++) {
        f->idle[j] = true;
        for (int64_t k = 0; k < count; k++)
            f->idle[j] = f->idle[j] && fabs(f->b[k][j]) <= 1e-3 * CLEAR_MARGIN * f->size[k];
    }
    return true;
}

/* Guard of a surface that is at zero; -1 if the mode slides on the surface. */
static int64_t guard_hit(const struct work *w, int64_t surface)
{
    for (int64_t g = 0; g < w->mode->guards; g++)
        if (w->hits[g] == 1 && w->mode->guard[g].index == surface)
            return g;
    return -1;
}

/* Sign of the factor if the function of surface k is a multiple of that of surface j; else 0. The test is numerical:
 * the velocities are proportional for all signs, and so are the two series, up to sign, in the mode that ends. */
static double factor_of(const struct work *w, const struct in_play *p, const struct affine *f, int64_t k, int64_t j)
{
    int64_t own = guard_hit(w, p->surface[k]), other = guard_hit(w, p->surface[j]), largest = 0;
    if (own < 0 || other < 0)
        return 0.0;
    for (int64_t i = 1; i < p->count; i++)
        largest = fabs(f->b[j][i]) > fabs(f->b[j][largest]) ? i : largest;
    double factor = f->b[k][largest] / f->b[j][largest], level = 1e-3 * CLEAR_MARGIN * f->size[k];
    bool same = fabs(factor) > 0.0 && fabs(f->a[k] - factor * f->a[j]) <= level;
    for (int64_t i = 0; i < p->count; i++)
        same = same && fabs(f->b[k][i] - factor * f->b[j][i]) <= level;
    const double *row = row_ahead(w, w->run->states + own), *first = row_ahead(w, w->run->states + other);
    double along = fabs(factor), size = 0.0, off = 0.0;
    for (int64_t i = 1; i <= w->run->order; i++)
        size += fabs(row[i]), off += fabs(row[i] - along * first[i]);
    return !(same && off <= 1e-3 * CLEAR_MARGIN * size) ? 0.0 : factor > 0.0 ? 1.0 : -1.0;
}

/* Find the surfaces that are multiples of other surfaces: a mode slides either on both or on none. */
static void find_multiples(const struct work *w, const struct in_play *p, struct affine *f)
{
    bool expanded = false;
    for (int64_t k = 0; k < p->count; k++) {
        f->same[k] = k, f->turned[k] = 1.0;
        for (int64_t j = 0; j < k && f->same[k] == k; j++) {
            if (f->same[j] != j || f->idle[j] || f->idle[k])
                continue;
            if (!expanded)
                expand(w, w->x, w->ahead);
            expanded = true;
            double turned = factor_of(w, p, f, k, j);
            if (turned != 0.0)
                f->same[k] = j, f->turned[k] = turned;
        }
    }
}

/* Gauss-Jordan elimination in the linear system of a candidate's sliding surfaces; false if it is nearly singular. */
static bool eliminated(struct affine *f, int64_t sliding)
{
    for (int64_t r = 0; r < sliding; r++) {
        int64_t pivot = r;
        for (int64_t q = r + 1; q < sliding; q++)
            if (fabs(f->m[q][r]) > fabs(f->m[pivot][r]))
                pivot = q;
        double largest = 0.0;
        for (int64_t q = 0; q <= sliding; q++) {
            double other = f->m[r][q];
            f->m[r][q] = f->m[pivot][q], f->m[pivot][q] = other;
            largest = larger(largest, fabs(f->m[r][q]));
        }
        if (fabs(f->m[r][r]) <= CLEAR_MARGIN * largest)
            return false;
        for (int64_t q = 0; q < sliding; q++) {
            double factor = f->m[q][r] / f->m[r][r];
            if (q != r)
                for (int64_t p = 0; p <= sliding; p++)
                    f->m[q][p] -= factor * f->m[r][p];
        }
    }
    return true;
}

/* Signs of a candidate, those of its sliding surfaces from B s = -a; false if the system is nearly singular. */
static bool solved(struct affine *f, int64_t count, int64_t candidate)
{
    int64_t sliding = 0;
    for (int64_t k = 0; k < count; k++) {
        f->s[k] = (double)choice(candidate, k);
        if (f->s[k] == 0.0 && f->same[k] == k)
            f->index[sliding++] = k;
    }
    for (int64_t r = 0; r < sliding; r++) {
        int64_t k = f->index[r];
        f->m[r][sliding] = -f->a[k];
        for (int64_t j = 0; j < count; j++)
            f->m[r][sliding] -= f->b[k][j] * f->s[j];
        for (int64_t q = 0; q < sliding; q++) {
            f->m[r][q] = 0.0;
            for (int64_t j = 0; j < count; j++)
                f->m[r][q] += f->same[j] == f->index[q] ? f->turned[j] * f->b[k][j] : 0.0;
        }
    }
    if (!eliminated(f, sliding))
        return false;
    for (int64_t r = 0; r < sliding; r++)
        f->s[f->index[r]] = f->m[r][sliding] / f->m[r][r];
    for (int64_t k = 0; k < count; k++)
        if (f->same[k] != k)
            f->s[k] = f->turned[k] * f->s[f->same[k]];
    return true;
}

/* 1 if a candidate's own field keeps it, -1 if not, 0 if that is not clear.
 *
 * Surfaces that are multiples of each other have the same entry, up to the factor's sign. No candidate slides on an
 * idle surface: its sign changes no velocity, so that the velocity is the same on both sides, and the candidates with
 * the two slips show whether it is clearly nonzero.
 */
static int64_t consistent(struct affine *f, int64_t count, int64_t candidate)
{
    for (int64_t k = 0; k < count; k++) {
        double side = (double)choice(candidate, k);
        bool apart = side != f->turned[k] * (double)choice(candidate, f->same[k]);
        if (apart || (f->idle[k] && side == 0.0) || (f->lean[k] != 0.0 && f->lean[k] != side))
            return -1;
    }
    bool unclear = !solved(f, count, candidate);
    for (int64_t k = 0; k < count; k++) {
        int64_t side = choice(candidate, k);
        double speed = f->a[k], coupling = 0.0, own = f->b[k][k], clear;
        for (int64_t j = 0; j < count; j++) {
            speed += f->b[k][j] * f->s[j];
            coupling += j != k ? fabs(f->b[k][j]) : 0.0;
        }
        if (side != 0) /* not clear if the equivalent signs are unknown */
            clear = !unclear && f->size[k] > 0.0 ? (double)side * speed / f->size[k] : 0.0;
        else if (-own > CLEAR_MARGIN * f->size[k])
            clear = unclear ? 0.0 : 1.0 - fabs(f->s[k]);
        else if (coupling == 0.0 && f->size[k] > 0.0) /* no attraction: one of the two fields points away */
            clear = smaller(-(f->a[k] + own), f->a[k] - own) / f->size[k];
        else
            clear = 0.0;
        if (clear < -CLEAR_MARGIN)
            return -1;
        unclear = unclear || !(clear > CLEAR_MARGIN);
    }
    return unclear ? 0 : 1;
}

/* The only clearly consistent candidate; -1 if there is none, there are several, or one is unclear. */
static int64_t only_candidate(struct affine *f, int64_t count)
{
    int64_t best = -1, candidates = three_to(count);
    for (int64_t candidate = 0; candidate < candidates; candidate++) {
        int64_t holds = consistent(f, count, candidate);
        if (holds == 0 || (holds > 0 && best >= 0))
            return -1;
        if (holds > 0)
            best = candidate;
    }
    return best;
}
