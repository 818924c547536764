/* Elementary functions in double-double with running error bounds: series for reduced arguments. */

static inline struct bounded exactly(double number)
{
    return (struct bounded){number, 0.0, 0.0};
}

/* A number given as its nearest double and the rest's nearest double; exact if the rest is zero. */
static inline struct bounded known_to(double high, double low, double relative)
{
    return (struct bounded){high, low, low == 0.0 ? 0.0 : relative * fabs(high)};
}

static inline struct bounded opposite(struct bounded a)
{
    return (struct bounded){-a.high, -a.low, a.error};
}

static inline struct bounded scaled_exactly(struct bounded a, double power_of_two)
{
    return (struct bounded){power_of_two * a.high, power_of_two * a.low, power_of_two * a.error};
}

static inline struct bounded over_integer(struct bounded a, int64_t k)
{
    double divisor = (double)k, high = a.high / divisor, rest = fused(-high, divisor, a.high) + a.low;
    struct pair found = pair_sum(high, rest / divisor);
    double error = OUTWARDS * (a.error / divisor) + (rest != 0.0 ? OPERATION_ERROR * fabs(high) : 0.0);
    return (struct bounded){found.high, found.low, error};
}

/* Numbers of terms of the series of sine and cosine, and of the exponential, for reduced arguments. */
#define SINE_TERMS 18
#define EXPONENTIAL_TERMS 17
/* Number of halvings of the argument of the exponential, and of squarings of the result. */
#define EXPONENTIAL_HALVINGS 4

/* Remainder of a number after subtracting the nearest multiple of a constant; "multiple" is that multiple. */
static inline struct bounded reduced(struct bounded a, struct bounded constant, double *multiple)
{
    *multiple = nearbyint(a.high / constant.high);
    return bounded_sum(a, opposite(bounded_product(exactly(*multiple), constant)));
}

static struct bounded exponential(struct bounded a)
{
    const struct bounded log_2 = {0x1.62e42fefa39efp-1, 0x1.abc9e3b39803fp-56, 0x1p-109};
    double multiple;
    struct bounded rest = scaled_exactly(reduced(a, log_2, &multiple), 1.0 / (1 << EXPONENTIAL_HALVINGS));
    struct bounded next = exactly(1.0), sum = next;
    if (!(fabs(multiple) < 1000.0))
        return exactly(INFINITY);
    for (int k = 1; k < EXPONENTIAL_TERMS; k++) {
        next = over_integer(bounded_product(next, rest), k);
        sum = bounded_sum(sum, next);
    }
    sum.error += fabs(next.high);
    for (int k = 0; k < EXPONENTIAL_HALVINGS; k++)
        sum = bounded_product(sum, sum);
    return scaled_exactly(sum, ldexp(1.0, (int)multiple));
}

/* Logarithm by one step of Newton's method from the double's logarithm, which squares the error. */
static struct bounded logarithm(struct bounded a)
{
    double about = log(a.high);
    struct bounded off = bounded_sum(bounded_product(a, exponential(exactly(-about))), exactly(-1.0));
    struct bounded half = scaled_exactly(bounded_product(off, off), 0.5);
    struct bounded found = bounded_sum(exactly(about), bounded_sum(off, opposite(half)));
    found.error += fabs(off.high * off.high * off.high);
    return found;
}

/* Sine of the number plus some quarters of a turn; one quarter gives the cosine. */
static struct bounded sine(struct bounded a, int64_t quarters)
{
    const struct bounded quarter = {0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54, 0x1p-108};
    double multiple;
    struct bounded rest = reduced(a, quarter, &multiple), square = opposite(bounded_product(rest, rest));
    if (!(fabs(multiple) < 0x1p50))
        return exactly(INFINITY);
    quarters = (quarters + (int64_t)multiple) & 3;
    struct bounded next = quarters & 1 ? exactly(1.0) : rest, sum = next;
    for (int k = quarters & 1 ? 1 : 2; k < 2 * SINE_TERMS; k += 2) {
        next = over_integer(bounded_product(next, square), k * (k + 1));
        sum = bounded_sum(sum, next);
    }
    sum.error += fabs(next.high);
    return quarters & 2 ? opposite(sum) : sum;
}

/* Coefficient 0 of a function; c: the exponent of a power. */
static struct bounded function_at(int64_t operation, struct bounded a, struct bounded c)
{
    switch (operation) {
    case TAPE_EXP:
        return exponential(a);
    case TAPE_LOG:
        return logarithm(a);
    case TAPE_POWER:
        return exponential(bounded_product(c, logarithm(a)));
    default:
        return sine(a, operation == TAPE_COS ? 1 : 0);
    }
}
