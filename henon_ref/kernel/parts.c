/* Parts that tests call on their own. */

HENON_EXPORT int64_t test_positive_by_bound(const double *q, const double *powers, int64_t degree)
{
    return positive_by_bound(q, powers, degree);
}

HENON_EXPORT struct first_root test_first_falling_root(const double *a, int64_t degree, double *stack, int64_t width)
{
    return first_falling_root(a, degree, stack, width);
}

HENON_EXPORT struct landed test_land(const double *q, int64_t degree, double low, double high, int64_t method)
{
    return land(q, degree, low, high, method);
}

HENON_EXPORT struct landed test_brent(const double *q, int64_t degree, double low, double high)
{
    return brent(q, degree, low, high);
}

/* Reads the run's time, mode, state, and the guards at zero (hits). */
HENON_EXPORT int64_t test_select_mode(struct run *run, const struct tables *tables)
{
    struct work work = work_of(run, tables);
    return select_mode(&work);
}

/* Solve a contact problem, m row by row; fills the entries, and returns whether they are clear. */
HENON_EXPORT int64_t test_clearly_solved(int64_t count, const double *a, const double *m, const double *lower,
                                         const double *upper, int64_t *entries)
{
    struct contact_problem problem = {.count = count};
    struct accelerations found;
    for (int64_t k = 0; k < count; k++) {
        problem.a[k] = a[k], problem.lower[k] = lower[k], problem.upper[k] = upper[k];
        for (int64_t j = 0; j < count; j++)
            problem.m[k][j] = m[count * k + j];
    }
    bool clear = clearly_solved(&problem, &found);
    for (int64_t k = 0; k < count; k++)
        entries[k] = found.entry[k];
    return clear;
}
