/* Terms of a Taylor polynomial on a step: whether the last ones decrease as those of a converged series do, and how
 * many digits are lost where terms cancel. */

/* Factor of one shortening while terms grow; also the largest ratio of the last two terms of a step without a check. */
#define SHORTER 0.7
/* Terms that decrease by less than this factor over two orders have not converged. */
#define SLOW 0.5
/* Relative error, of a row's size on a step, that rounding may always cause in a polynomial motion. */
#define ROUNDING (1e3 * EPS)
/* Number of places on a step at which the size of a row is sampled. */
#define SIZE_POINTS 4

/* Behaviour of the last terms on a step (tail_shape). */
enum tail { DECREASING, NOT_DECREASING, ENDS_IN_GAP };

/* Longest step, theta at most, on which the terms of a polynomial do not cancel by more digits than can be spared.
 *
 * No coefficient limits the step of a motion that is a polynomial by its form.
 */
static double cancellation_limit(const struct work *w, int64_t rows, double theta)
{
    int64_t degree = w->mode->polynomial_degree;
    double spare = larger(w->run->tolerance, ROUNDING) / EPS;
    for (int64_t r = 0; r < rows; r++) {
        const double *row = row_of(w, r);
        while (true) {
            double terms = 0.0, size = 0.0;
            for (int64_t k = degree; k >= 0; k--)
                terms = terms * theta + fabs(row[k]);
            for (int point = 1; point <= SIZE_POINTS; point++) {
                double at = theta * point / SIZE_POINTS, height = 0.0;
                for (int64_t k = degree; k >= 0; k--)
                    height = height * at + row[k];
                size = larger(size, fabs(height));
            }
            if (!(terms > spare * size))
                break;
            theta *= 0.5;
        }
    }
    return theta;
}

/* Classify the last terms of a row on a step.
 *
 * With T_k = |c_k| theta^k, m = p/2 - 1, half = max T_m..T_(m+3), before = max(T_(p-3), T_(p-2)), end = max(T_(p-1),
 * T_p): DECREASING if GAP_RATIO before < end < SLOW min(half, before). The code divides all of them by theta^m.
 *
 * NOT_DECREASING: the last two terms are not much smaller than the two before them or those halfway; later terms may be
 * larger still (a singularity on the step, a high power that dominates later). ENDS_IN_GAP: the last two terms suddenly
 * vanish; a gap does not bound the terms after it. DECREASING also if they are below "least_part" > 0 of the row's
 * size.
 */
static enum tail tail_shape(const double *row, int64_t order, double theta, double least_part)
{
    int64_t middle = order / 2 - 1, last = order - 3;
    double square = theta * theta, cube = square * theta, shift = 1.0;
    for (int64_t k = middle; k < last; k++) /* not pow(): a call of the C library costs as much as the rest */
        shift *= theta;
    double half = larger(larger(fabs(row[middle]), fabs(row[middle + 1]) * theta),
                         larger(fabs(row[middle + 2]) * square, fabs(row[middle + 3]) * cube));
    double before = shift * larger(fabs(row[last]), fabs(row[last + 1]) * theta);
    double end = shift * larger(fabs(row[last + 2]) * square, fabs(row[last + 3]) * cube);
    if (GAP_RATIO * before < end && end < SLOW * smaller(half, before))
        return DECREASING;
    double scale = least_part * (fabs(row[0]) + theta * (fabs(row[1]) + theta * fabs(row[2])));
    for (int64_t k = 0; k < middle; k++)
        scale /= theta;
    if (least_part > 0.0 && larger(end, before) <= scale)
        return DECREASING;
    return end <= GAP_RATIO * before ? ENDS_IN_GAP : NOT_DECREASING;
}

/* tail_shape of row r. A state without a size limits no step, and proves nothing: its slope must be compared. */
static inline enum tail tail_of(const struct work *w, int64_t r, double theta, double least_part)
{
    if (r < w->run->states && without_size(row_of(w, r)))
        return least_part > 0.0 ? DECREASING : ENDS_IN_GAP;
    return tail_shape(row_of(w, r), w->run->order, theta, least_part);
}

/* Check whether the terms of some row do not decrease towards the last ones as those of a converged series do. */
static inline bool tail_unconverged(const struct work *w, int64_t rows, double theta)
{
    const double *norms = row_of(w, rows);
    if (norms[0] * theta <= SHORTER * norms[1]) /* most steps */
        return false;
    bool found = false;
    for (int64_t r = 0; r < rows; r++)
        found = found || tail_of(w, r, theta, EPS) != DECREASING;
    return found;
}
