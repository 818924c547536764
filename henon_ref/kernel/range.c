/* Overflow and underflow in the operations of an expansion.
 *
 * The processor's flags show them. They are lowered before an expansion and read after it, so that those of a unit that
 * was too long, of root isolation or of a step's sum do not count. If one is raised, a bound of the effect of underflow
 * on each x' and guard (henon_ref/taylor/llvm/rounding.py) nearly always proves that it is negligible: exp(-v^2) may
 * well be zero. If it does not, or if an operation has overflowed, Python examines the expansion in numbers of
 * unlimited exponent (henon_ref/integrator/endings.py).
 */
#include <fenv.h>
#ifdef __x86_64__
#include <xmmintrin.h>
#endif

#define RANGE_FLAGS (FE_OVERFLOW | FE_UNDERFLOW)

/* Flags that are up. On x86-64 fetestexcept() would also read those of the x87 unit, which nothing here uses: two calls
 * would take a tenth of a step. */
static inline int raised_range_flags(void)
{
#ifdef __x86_64__
    return (int)_mm_getcsr() & RANGE_FLAGS;
#else
    return fetestexcept(RANGE_FLAGS);
#endif
}

static inline void lower_range_flags(void)
{
    if (raised_range_flags())
        feclearexcept(RANGE_FLAGS);
}

/* Check whether Python must examine overflow or underflow in the expansion, for a step of theta units.
 *
 * "raised": the flags that are up. "within_range" shows that Python has examined this step. If true, "ahead" holds the
 * effect of rounding alone on each x' and guard.
 */
static bool out_of_range(const struct work *w, int raised, double theta)
{
    struct run *run = w->run;
    if (run->within_range == run->steps + 1)
        return false;
    int64_t n = run->states, rows = n + w->mode->guards;
    double *underflow = w->ahead, *both = w->ahead + rows;
    bool found = (raised & FE_OVERFLOW) != 0;
    w->mode->rounding(run->time, run->time_low, 0.0, w->x, w->constants, underflow);
    for (int64_t r = 0; r < rows; r++) {
        const double *row = row_of(w, r);
        double size = fabs(row[0]) + theta * (fabs(row[1]) + theta * fabs(row[2]));
        double off = underflow[r] * (r < n ? theta * run->unit : 1.0), least = r < n ? NO_ACCOUNT : 0.0;
        found = found || !(off <= run->tolerance * size + least);
    }
    if (!found)
        return false;
    w->mode->rounding(run->time, run->time_low, OWN_ROUNDING, w->x, w->constants, both);
    for (int64_t r = 0; r < rows; r++)
        w->ahead[r] = both[r] - underflow[r];
    run->step_length = theta * run->unit;
    return true;
}
