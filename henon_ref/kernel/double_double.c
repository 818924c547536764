/* Double-double arithmetic with running error bounds, and an interpreter of programs in it.
 *
 * A number is three doubles: its nearest double, the rest, and a bound of the error of their sum. Sums and products are
 * the accurate ones of Joldes, Muller and Popescu (ACM Trans. Math. Softw. 44, 2017, Algorithms 6 and 12), whose
 * relative errors are a few 2^-106; the bounds take 2^-100 for each.
 */
#ifndef HENON_DOUBLE_DOUBLE_C
#define HENON_DOUBLE_DOUBLE_C

#include "kernel.h"
#include "numbers.h"

/* Bound of the relative error of one operation. Sums and products of two doubles are exact: their error is 0. */
#define OPERATION_ERROR 0x1p-100
/* Largest relative error of a constant: its double is then the nearest one, except in a tie. */
#define ACCURATE 0x1p-92
/* A product of doubles larger than this is exactly two doubles, neither of which underflows. */
#define LEAST_EXACT 1e-280
/* Factor that covers the rounding of an error bound's own arithmetic. */
#define OUTWARDS 1.0001

struct pair {
    double high, low;
};

/* A pair and an error bound, as registers hold them. */
struct bounded {
    double high, low, error;
};

/* a + b and what rounding lost of it. */
static inline struct pair pair_sum(double a, double b)
{
    double total = a + b, part = total - a;
    return (struct pair){total, (a - (total - part)) + (b - part)};
}

/* a b and what rounding lost of it. */
static inline struct pair pair_product(double a, double b)
{
    double total = a * b;
    return (struct pair){total, fused(a, b, -total)};
}

static inline struct pair added(struct pair a, struct pair b)
{
    struct pair highs = pair_sum(a.high, b.high), lows = pair_sum(a.low, b.low);
    struct pair sum = pair_sum(highs.high, highs.low + lows.high);
    return pair_sum(sum.high, sum.low + lows.low);
}

static inline struct pair multiplied(struct pair a, struct pair b)
{
    struct pair product = pair_product(a.high, b.high);
    return pair_sum(product.high, product.low + fused(a.high, b.low, a.low * b.high));
}

static inline struct pair negative(struct pair a)
{
    return (struct pair){-a.high, -a.low};
}

static inline struct pair divided(struct pair a, struct pair b)
{
    double first = a.high / b.high;
    struct pair rest = added(a, negative(multiplied(b, (struct pair){first, 0.0})));
    double second = rest.high / b.high;
    rest = added(rest, negative(multiplied(b, (struct pair){second, 0.0})));
    double third = rest.high / b.high;
    return added(pair_sum(first, second), (struct pair){third, 0.0});
}

static inline struct pair square_root(struct pair a)
{
    double first = sqrt(a.high);
    if (first == 0.0)
        return (struct pair){0.0, 0.0};
    struct pair rest = added(a, negative(pair_product(first, first)));
    return pair_sum(first, (rest.high + rest.low) / (2.0 * first));
}

/* Product with an error bound. */
static inline struct bounded times(struct bounded a, struct bounded b)
{
    struct pair product = multiplied((struct pair){a.high, a.low}, (struct pair){b.high, b.low});
    double error = fabs(a.high) * b.error + a.error * (fabs(b.high) + b.error) + OPERATION_ERROR * fabs(product.high);
    return (struct bounded){product.high, product.low, error};
}

/* Quotient with an error bound, infinite if the divisor may be zero. */
static inline struct bounded quotient(struct bounded a, struct bounded b)
{
    struct pair found = divided((struct pair){a.high, a.low}, (struct pair){b.high, b.low});
    double divisor = fabs(b.high) - b.error;
    double error = divisor > 0.0 ? (a.error + fabs(found.high) * b.error) / divisor : INFINITY;
    return (struct bounded){found.high, found.low, OUTWARDS * error + OPERATION_ERROR * fabs(found.high)};
}

/* Integer power with an error bound, by repeated squaring. */
static inline struct bounded bounded_power(struct bounded a, int64_t exponent)
{
    const struct bounded one = {1.0, 0.0, 0.0};
    struct bounded power = one;
    for (int64_t left = exponent < 0 ? -exponent : exponent; left > 0; left >>= 1) {
        if (left & 1)
            power = times(power, a);
        a = times(a, a);
    }
    return exponent < 0 ? quotient(one, power) : power;
}

static inline struct bounded bounded_sum(struct bounded a, struct bounded b)
{
    struct pair sum = added((struct pair){a.high, a.low}, (struct pair){b.high, b.low});
    bool exact = a.low == 0.0 && b.low == 0.0;
    double error = OUTWARDS * (a.error + b.error) + (exact ? 0.0 : OPERATION_ERROR * fabs(sum.high));
    return (struct bounded){sum.high, sum.low, error};
}

static inline struct bounded bounded_product(struct bounded a, struct bounded b)
{
    struct bounded product = times(a, b);
    bool exact = a.low == 0.0 && b.low == 0.0 && a.error == 0.0 && b.error == 0.0 && fabs(product.high) > LEAST_EXACT;
    product.error = exact ? 0.0 : OUTWARDS * product.error;
    return product;
}

static inline struct bounded bounded_root(struct bounded a)
{
    struct pair root = square_root((struct pair){a.high, a.low});
    double error = (a.high > a.error ? a.error / root.high : INFINITY) + OPERATION_ERROR * root.high;
    return (struct bounded){root.high, root.low, error};
}

static inline struct bounded result_of(int64_t what, struct bounded a, const struct bounded *registers, int64_t j)
{
    if (what == ADD)
        return bounded_sum(a, registers[j]);
    if (what == MULTIPLY)
        return bounded_product(a, registers[j]);
    if (what == SQRT)
        return bounded_root(a);
    struct bounded power = bounded_power(a, j);
    power.error *= OUTWARDS;
    return power;
}

/* Run a program at many points.
 *
 * operations: (count, 4): operation, register of the result, and registers of the two operands. registers: (points,
 * width, 3): numbers and their error bounds.
 */
HENON_EXPORT void run_operations(const int64_t *operations, int64_t count, double *registers, int64_t width,
                                 int64_t points)
{
    for (int64_t point = 0; point < points; point++) {
        struct bounded *own = (struct bounded *)registers + point * width;
        for (int64_t k = 0; k < count; k++) {
            const int64_t *operation = operations + 4 * k;
            own[operation[1]] = result_of(operation[0], own[operation[2]], own, operation[3]);
        }
    }
}

/* Pair k of an array of pairs. */
static inline struct pair pair_in(const char *numbers, int64_t k)
{
    struct pair own;
    memcpy(&own, numbers + k * (int64_t)sizeof own, sizeof own);
    return own;
}

/* Run a program at one point. inputs: pairs; if the rest is not zero, it is taken to be rounded. */
static void run_at(const struct program *program, const char *inputs, struct bounded *registers)
{
    memcpy(registers, program->registers, (size_t)program->width * sizeof(struct bounded));
    for (int64_t k = 0; k < program->inputs; k++) {
        const struct pair own = pair_in(inputs, k);
        registers[k] = (struct bounded){own.high, own.low, own.low != 0.0 ? OPERATION_ERROR * fabs(own.high) : 0.0};
    }
    run_operations(program->operations, program->count, (double *)registers, program->width, 1);
}

/* Evaluate the constants of all modes, then those of the normal velocities, at parameter values; return the compiled
 * modes with them. Null if a constant is not finite, or has lost digits.
 *
 * block: room for a struct tables, the registers, a zero, the constants, each followed by what its rounding lost, and
 * the places of the constants.
 */
HENON_EXPORT struct tables *point_tables(const struct tables *template, const struct program *program,
                                         const char *inputs, double *block)
{
    struct tables *tables = (struct tables *)block;
    struct bounded *own = (struct bounded *)(tables + 1);
    double *numbers = (double *)(own + program->width), *out = numbers + 1 + 2 * program->results;
    run_at(program, inputs, own);
    numbers[0] = 0.0;
    for (int64_t k = 0; k < program->results; k++) {
        struct bounded number = own[program->outputs[k]];
        numbers[1 + 2 * k] = number.high, numbers[2 + 2 * k] = number.low;
        if (!(fabs(number.high) < INFINITY) || number.error > ACCURATE * fabs(number.high))
            return NULL;
    }
    for (int64_t place = 0; place < program->places; place++)
        out[place] = numbers[program->sources[place]];
    *tables = *template;
    tables->numbers = out;
    if (tables->selection.velocities)
        tables->selection.constants = out + tables->count * tables->tapes * tables->length;
    return tables;
}

/* Signs of numbers: 0 of an exact zero, UNCLEAR_SIGN of a number that may be zero within its error.
 *
 * registers: (points, width, 3). sources: (count): registers of the numbers. signs: (points, count): filled in.
 */
HENON_EXPORT void signs_of(const double *registers, int64_t width, int64_t points, const int64_t *sources,
                           int64_t count, int64_t *signs)
{
    for (int64_t point = 0; point < points; point++) {
        const struct bounded *own = (const struct bounded *)registers + point * width;
        for (int64_t k = 0; k < count; k++) {
            double number = own[sources[k]].high, error = own[sources[k]].error;
            int64_t sign = UNCLEAR_SIGN;
            if (fabs(number) > 2.0 * error && fabs(number) < INFINITY)
                sign = number > 0.0 ? 1 : -1;
            else if (number == 0.0 && error == 0.0)
                sign = 0;
            signs[point * count + k] = sign;
        }
    }
}

#endif
