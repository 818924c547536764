/* Contact problem of a group: the forces of contacts that act on each other, and the contacts that hold.
 *
 * The rule is that of henon_ref/modes/contact_problem.py: Gauss's principle with Coulomb's friction. The relative
 * accelerations of a group's contacts are affine in their forces, N = a - M f. Each force is between its bounds, at the
 * upper bound if N > 0, at the lower bound if N < 0 (Moreau 1985, Sec. 2; Glocker 2001, Ch. 6). Block principal
 * pivoting finds the contacts that hold (Judice and Pires, Comput. Oper. Res. 21 (1994) 587-596).
 *
 * Every number may be wrong by the part CLEAR_MARGIN of its terms, as the states are. Skeel's componentwise condition
 * (J. ACM 26 (1979) 494-526) bounds the effect on the forces to first order. If some sign is uncertain within these
 * bounds, Python decides.
 */

/* Tolerance of the bounds during the pivots, relative to the terms of a number. */
#define PIVOT_ROUNDING 1e-12
/* Pivots below this part of a contact's own inverse inertia count as zero: the part of M is singular. */
#define RANK 1e-8
/* Block pivots in a row without progress before single pivots; largest number of pivots per contact. */
#define MAX_BLOCK_PIVOTS 10
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
    int64_t count = p->count, fewest = count + 1, patience = MAX_BLOCK_PIVOTS;
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
        patience = wrong < fewest ? MAX_BLOCK_PIVOTS : patience - 1;
        fewest = least(fewest, wrong);
        for (int64_t k = 0; k < count; k++)
            if (patience > 0 || k == last)
                s->entry[k] = turned[k];
    }
    return false;
}
