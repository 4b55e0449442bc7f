/* Random problems for a generated planner, compiled with it and run by generated_c_study.py and test_generated_c.py.

   fuzz COUNT SEED        COUNT calls of gbt_plan from random inputs, many of them absurd; every plan is judged here
   fuzz COUNT SEED threads  the same steps by two threads with a planner each, and one after the other: equal bytes

   Judged is, with no help of the kernel's own check: that a refused input is one that is not finite and the reverse;
   that all numbers of a plan are finite; that the trajectory has the reported endpoints; that the thrust on a grid of
   this file's own keeps the limits where the plan says that its first piece does; that no call takes more iterations
   than the settings allow. The exit code is the number of faults, at most 100. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gbt_plan.h"

#ifdef FUZZ_THREADS
#include <pthread.h>
#endif

enum { D = GBT_DIMENSION, KNOTS = GBT_PIECES + GBT_PRESENT, STEPS = 4 };

typedef struct {
    double state[GBT_STATE], mean[KNOTS * D], covariance[KNOTS * D * D], desired[GBT_PIECES * D];
    int finite;
} problem;

static uint64_t next(uint64_t *s)
{
    *s ^= *s << 13;
    *s ^= *s >> 7;
    *s ^= *s << 17;
    return *s;
}

static double uniform(uint64_t *s) { return (double)(next(s) >> 11) / 9007199254740992.0; }
static double centred(uint64_t *s) { return 2 * uniform(s) - 1; }

/* A size between 10^-low and 10^high. */
static double size(uint64_t *s, double low, double high) { return pow(10, -low + (low + high) * uniform(s)); }

static const double bad[] = {NAN, INFINITY, -INFINITY};

static void draw(uint64_t *s, problem *x)
{
    const int kind = (int)(next(s) % 8);
    const double far = kind == 1 ? size(s, 0, 8) : 5, fast = kind == 2 ? size(s, 2, 3) : 1;
    const double spread = kind == 3 ? size(s, 12, 4) : 0.3, drift = centred(s);
    double line[D], speed[D];
    x->finite = 1;
    for (int a = 0; a < GBT_STATE; a++) x->state[a] = (a < D ? far : fast) * centred(s);
    for (int j = 0; j < D; j++) {
        line[j] = kind == 4 ? x->state[j] : centred(s) * (kind == 5 ? size(s, 12, 6) : 3);
        speed[j] = drift * centred(s);
    }
    for (int i = 0; i < KNOTS; i++) {
        double root[D][D];
        for (int j = 0; j < D; j++) x->mean[i * D + j] = line[j] + 0.1 * i * speed[j];
        for (int j = 0; j < D; j++)
            for (int k = 0; k < D; k++) root[j][k] = spread * centred(s);
        for (int j = 0; j < D; j++)
            for (int k = 0; k < D; k++) {
                double value = 0;
                for (int l = 0; l < D; l++) value += root[j][l] * root[k][l];
                /* kind 6: no covariance at all, but indefinite */
                x->covariance[(i * D + j) * D + k] = kind == 6 ? (j == k ? centred(s) : 0) : value;
            }
    }
    for (int i = 0; i < GBT_PIECES; i++) {
        double norm = 0;
        for (int j = 0; j < D; j++) {
            x->desired[i * D + j] = centred(s);
            norm += x->desired[i * D + j] * x->desired[i * D + j];
        }
        for (int j = 0; j < D; j++) x->desired[i * D + j] = norm > 0 ? x->desired[i * D + j] / sqrt(norm) : 0;
    }
    if (kind == 7) {
        double *arrays[] = {x->state, x->mean, x->covariance, x->desired};
        const int counts[] = {GBT_STATE, KNOTS * D, KNOTS * D * D, GBT_PIECES * D};
        const int which = (int)(next(s) % 4);
        arrays[which][next(s) % (uint64_t)counts[which]] = bad[next(s) % 3];
        x->finite = 0;
    }
}

/* Derivative o of flat output j after s seconds of a piece. */
static double after(double z[GBT_ORDERS][GBT_FLAT], int o, int j, double s)
{
    double value = 0;
    for (int k = GBT_DEGREE - o; k > 0; k--) value = (value + z[o + k][j]) * s / k;
    return value + z[o][j];
}

static const char *judge(const problem *x, const gbt_planner *planner, const gbt_plan_result *plan)
{
    const double t = GBT_PERIOD;
    double z[GBT_ORDERS][GBT_FLAT], worst = 0;
    if (!x->finite) return plan->status == GBT_NOT_FINITE && plan->origin == GBT_NO_PLAN ? 0 : "bad input accepted";
    if (plan->status == GBT_NOT_FINITE) return "good input refused";
    if (plan->status < 0 || plan->status > GBT_GIVEN_UP) return "unknown status";
    if (plan->iterations > planner->settings.deadline) return "too many iterations";
    const int answered = plan->status == GBT_SOLVED || plan->status == GBT_GIVEN_UP;
    if (answered && plan->origin != GBT_PLANNED) return "solved, but not planned";
    if (!answered && plan->origin == GBT_PLANNED) return "planned, but not solved";
    for (int a = 0; a < GBT_STATE; a++) z[a / GBT_FLAT][a % GBT_FLAT] = x->state[a];
    for (int i = 0; i < GBT_PIECES; i++) {
        for (int a = 0; a < GBT_FREE; a++) z[GBT_JOINED + a / GBT_FLAT][a % GBT_FLAT] = plan->top[i][a];
        /* the planner's own grid, and for a plan that is called solved a finer one as well */
        const int intervals = plan->status == GBT_SOLVED ? 400 : GBT_FINE_POINTS - 1;
        for (int k = 0; k <= intervals && i == 0; k++) {
            const double s = t * k / intervals;
            double point[GBT_POINT], thrust[GBT_INPUTS];
            for (int j = 0; j < GBT_FLAT; j++) {
                for (int o = 0; o < 3; o++) point[o * GBT_FLAT + j] = after(z, o, j, s);
            }
            gbt_vehicle_inputs(point, 0, 0, thrust);
            for (int m = 0; m < GBT_INPUTS; m++) {
                const double over = fabs(thrust[m]) / (m + 1 < GBT_INPUTS ? FUZZ_FORCE : FUZZ_MOMENT) - 1;
                if (!(over <= worst)) worst = over;
            }
        }
        for (int a = 0; a < GBT_FREE; a++)
            if (!isfinite(plan->top[i][a])) return "a plan that is not finite";
        for (int j = 0; j < GBT_FLAT; j++) {
            const double end = after(z, 0, j, t), room = 1e-12 * (1 + fabs(end));
            if (!isfinite(plan->endpoints[i][j]) || !isfinite(plan->rates[i][j])) return "a plan that is not finite";
            if (!(fabs(plan->endpoints[i][j] - end) <= room)) return "endpoints that are not the trajectory's";
            for (int o = 0; o < GBT_JOINED; o++) z[o][j] = after(z, o, j, t);
        }
    }
    if (isnan(plan->objective) || isnan(plan->violation)) return "objective or violation is no number";
    /* between the points of the coarser grid thrust may bulge a little */
    if (!(worst <= plan->piece_violation[0] + (plan->status == GBT_SOLVED ? 1e-3 : 1e-9 * (1 + plan->piece_violation[0]))))
        return "a first piece that breaks the thrust limits unsaid";
    return 0;
}

typedef struct {
    gbt_planner planner;
    gbt_plan_result plan;
    uint64_t seed, digest;
    long count, faults, refused, solved, substitutes;
    int most;
} run;

static void *work_through(void *argument)
{
    run *r = argument;
    uint64_t s = r->seed;
    for (long k = 0; k < r->count; k++) {
        problem x;
        const char *fault;
        if (k % STEPS == 0) gbt_plan_init(&r->planner);
        draw(&s, &x);
        memset(&r->plan, 0, sizeof r->plan);
        gbt_plan(&r->planner, x.state, x.mean, x.covariance, x.desired, &r->plan);
        fault = judge(&x, &r->planner, &r->plan);
        if (fault) {
            if (r->faults++ < 10) printf("problem %ld: %s (status %d, origin %d)\n", k, fault, (int)r->plan.status, (int)r->plan.origin);
        }
        r->refused += r->plan.status == GBT_NOT_FINITE;
        r->solved += r->plan.status == GBT_SOLVED;
        r->substitutes += r->plan.status != GBT_SOLVED && r->plan.status != GBT_NOT_FINITE;
        if (r->plan.iterations > r->most) r->most = r->plan.iterations;
        for (size_t a = 0; a < sizeof r->plan.top; a++)
            r->digest = (r->digest ^ ((const unsigned char *)r->plan.top)[a]) * 1099511628211u;
    }
    return 0;
}

static run runs[4];

int main(int count, char **arguments)
{
    long faults = 0;
    if (count < 3) return 101;
    for (int k = 0; k < 4; k++) {
        runs[k].count = atol(arguments[1]);
        runs[k].seed = (uint64_t)atol(arguments[2]) * 2654435761u + 88172645463325252u + (uint64_t)(k % 2) * 7919u;
    }
#ifdef FUZZ_THREADS
    if (count > 3) {
        pthread_t threads[2];
        for (int k = 0; k < 2; k++)
            if (pthread_create(&threads[k], 0, work_through, &runs[k]) != 0) return 102;
        for (int k = 0; k < 2; k++) pthread_join(threads[k], 0);
        for (int k = 2; k < 4; k++) work_through(&runs[k]);
        for (int k = 0; k < 2; k++) faults += runs[k].digest != runs[k + 2].digest;
        printf("threads: %ld differences\n", faults);
        return (int)faults;
    }
#endif
    work_through(&runs[0]);
    faults = runs[0].faults;
    printf("%ld problems: %ld solved, %ld substitutes, %ld refused, most iterations %d, %ld faults\n", runs[0].count,
           runs[0].solved, runs[0].substitutes, runs[0].refused, runs[0].most, faults);
    return faults > 100 ? 100 : (int)faults;
}
