/* Exported by every library of this project: a hash of its sources, and a self-test. Included once per library. */
#ifndef HENON_SELF_TEST_H
#define HENON_SELF_TEST_H

#ifndef HENON_EXPORT
#define HENON_EXPORT __attribute__((visibility("default")))
#endif

/* Hash of sources and flags (henon_ref/kernel/compilation.py), given at the build by -D. */
HENON_EXPORT extern const char henon_sources[];
const char henon_sources[] = HENON_SOURCES;

/* volatile: a value that the compiler computed itself would not test the instructions. */
static const volatile double self_test_inputs[] = {1.4, 0.3, 0.1, 0.7, 0x1p30, 0x1p-1022, 0x1p54};

/* A hundred steps of Hénon's map, x' = 1 - a x^2 + y, y' = b x (Commun. Math. Phys. 50, 69, 1976), which turn one unit
 * in the last place into a difference in the first. The returned value differs from the correct one (in
 * henon_ref/kernel/library.py; tests/kernel/test_kernel_library.py computes it) if
 * - a product and a sum are fused that are not written as fused (-ffp-contract=on or fast),
 * - a fused operation is rounded twice (a wrong fma in the C library),
 * - sums are reordered (-fassociative-math, -ffast-math),
 * - subnormal numbers are flushed to zero (-ffast-math when linking). */
HENON_EXPORT double henon_self_test(void);
double henon_self_test(void)
{
    double a = self_test_inputs[0], b = self_test_inputs[1], start = self_test_inputs[2], factor = self_test_inputs[3];
    double large = self_test_inputs[4], smallest = self_test_inputs[5], scale = self_test_inputs[6];

    double product = start * factor;
    double error_of_product = __builtin_fma(start, factor, -product);
    double subnormal = smallest * factor;
    double x = (large + start) - large;
    double y = (error_of_product * scale + subnormal / smallest) / 8;
    for (int n = 0; n < 100; n++) {
        double next = (1 - a * x * x) + y;
        y = b * x;
        x = next;
    }
    return x;
}

#endif
