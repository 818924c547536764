/* Minimal runs of SUNDIALS' CVODE with rootfinding. Each line of the output is a name followed by numbers. */
#include <math.h>
#include <stdio.h>

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_config.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

static int unit_speed(double t, N_Vector x, N_Vector rate, void *data)
{
    NV_Ith_S(rate, 0) = 1.0;
    return 0;
}

static int torricelli(double t, N_Vector x, N_Vector rate, void *data)
{
    NV_Ith_S(rate, 0) = -sqrt(NV_Ith_S(x, 0));
    return !isfinite(NV_Ith_S(rate, 0));
}

static int pumped(double t, N_Vector x, N_Vector rate, void *data)
{
    NV_Ith_S(rate, 0) = -0.25 - sqrt(NV_Ith_S(x, 0));
    return !isfinite(NV_Ith_S(rate, 0));
}

static int infinite(double t, N_Vector x, N_Vector rate, SUNMatrix out, void *data, N_Vector a, N_Vector b, N_Vector c)
{
    SM_ELEMENT_D(out, 0, 0) = -0.5 / sqrt(NV_Ith_S(x, 0));
    return 0;
}

static int refused(double t, N_Vector x, N_Vector rate, SUNMatrix out, void *data, N_Vector a, N_Vector b, N_Vector c)
{
    infinite(t, x, rate, out, data, a, b, c);
    return !isfinite(SM_ELEMENT_D(out, 0, 0));
}

static int pair(double t, N_Vector x, double *out, void *data)
{
    out[0] = NV_Ith_S(x, 0) * NV_Ith_S(x, 0) - 0.0025;
    return 0;
}

static int turning(double t, N_Vector x, N_Vector rate, void *data)
{
    NV_Ith_S(rate, 0) = t - 1.0;
    return 0;
}

static int flat(double t, N_Vector x, N_Vector rate, void *data)
{
    NV_Ith_S(rate, 0) = 4.0 * (t - 1.0) * (t - 1.0) * (t - 1.0);
    return 0;
}

static int level(double t, N_Vector x, double *out, void *data)
{
    out[0] = NV_Ith_S(x, 0);
    return 0;
}

static void show(const char *name, SUNContext context, int method, double start, CVRhsFn field, CVRootFn root,
                 CVLsJacFn jacobian, double tolerance, double until)
{
    double t = 0.0;
    long steps = 0;
    N_Vector x = N_VNew_Serial(1, context);
    void *memory = CVodeCreate(method, context);
    SUNMatrix matrix = SUNDenseMatrix(1, 1, context);
    SUNLinearSolver linear = SUNLinSol_Dense(x, matrix, context);
    NV_Ith_S(x, 0) = start;
    CVodeInit(memory, field, 0.0, x);
    CVodeSStolerances(memory, tolerance, tolerance);
    CVodeSetLinearSolver(memory, linear, matrix);
    if (jacobian) CVodeSetJacFn(memory, jacobian);
    CVodeSetMaxNumSteps(memory, 100000);
    CVodeSetErrFile(memory, NULL);
    CVodeSetStopTime(memory, until);
    if (root) CVodeRootInit(memory, 1, root);
    int flag = CVode(memory, until, x, &t, CV_NORMAL);
    CVodeGetNumSteps(memory, &steps);
    printf("%s %d %.17g %.17g %ld\n", name, flag, t, NV_Ith_S(x, 0), steps);
    CVodeFree(&memory);
    SUNLinSolFree(linear);
    SUNMatDestroy(matrix);
    N_VDestroy(x);
}

int main(void)
{
    SUNContext context;
    if (SUNContext_Create(NULL, &context)) return 1;
    show("pair-adams", context, CV_ADAMS, -1.0, unit_speed, pair, NULL, 1e-9, 2.0);
    show("pair-bdf", context, CV_BDF, -1.0, unit_speed, pair, NULL, 1e-9, 2.0);
    show("tank-loose", context, CV_ADAMS, 1.0, torricelli, NULL, NULL, 1e-6, 4.0);
    show("tank-tight", context, CV_ADAMS, 1.0, torricelli, NULL, NULL, 1e-12, 4.0);
    show("turn-adams", context, CV_ADAMS, 0.375, turning, level, NULL, 1e-6, 2.0);
    show("flat-bdf", context, CV_BDF, 1.0 + 1e-8, flat, level, NULL, 1e-6, 2.0);
    show("flat-end", context, CV_BDF, 1.0 + 1e-8, flat, NULL, NULL, 1e-6, 1.0);
    show("pump-infinite", context, CV_ADAMS, 0.25, pumped, NULL, infinite, 1e-9, 4.0);
    show("pump-refused", context, CV_ADAMS, 0.25, pumped, NULL, refused, 1e-9, 4.0);
    SUNContext_Free(&context);
    return 0;
}
