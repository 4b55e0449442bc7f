/* Runs the recorded vectors. In real use there is one planner that remembers its last plan; here every step brings that
   plan along, so that the steps can be repeated one by one.

   example           runs them twice, compares both runs with each other and with what was recorded
   example --dump    prints the endpoints of every plan in full precision
   example --fail    gives the planner a state that is not a number; the exit code is the planner's status */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "gbt_places.h"
#include "gbt_plan.h"
#include "vectors.h"

#define TOLERANCE 1e-6

static gbt_planner planner; /* static: too large for many an embedded stack */
static gbt_plan_result plans[2][VECTORS];

static gbt_status step(int k, gbt_plan_result *plan)
{
    static const double origin[GBT_DIMENSION];
    gbt_plan_init(&planner);
    planner.warm = vector_warm[k][0] > 0;
    memcpy(planner.previous, vector_previous[k], sizeof planner.previous);
    gbt_begin(origin, vector_begin[k], planner.place, planner.begin);
#if GBT_MOMENTS
    return gbt_plan(&planner, vector_state[k], vector_mean[k], vector_covariance[k], vector_desired[k], plan);
#else
    return gbt_plan_parameters(&planner, vector_state[k], vector_parameters[k], plan);
#endif
}

static void run(gbt_plan_result *plan)
{
    for (int k = 0; k < VECTORS; k++) step(k, &plan[k]);
}

static double largest_difference(const gbt_plan_result *plan, const gbt_real *endpoints)
{
    double worst = 0;
    for (int a = 0; a < GBT_PIECES * GBT_FLAT; a++) {
        const double difference = fabs((double)((&plan->endpoints[0][0])[a] - endpoints[a]));
        if (!(difference <= worst)) worst = difference;
    }
    return worst;
}

static int compare(void)
{
    int faults = 0;
    double worst = 0;
    run(plans[0]);
    run(plans[1]);
    printf("step  status  origin  iterations  objective     violation  difference\n");
    for (int k = 0; k < VECTORS; k++) {
        const gbt_plan_result *plan = &plans[0][k];
        const double difference = largest_difference(plan, vector_endpoints[k]);
        printf("%4d  %6d  %6d  %10d  %9.6f  %12.3g  %10.2g\n", k, (int)plan->status, (int)plan->origin,
               plan->iterations, (double)plan->objective, (double)plan->violation, difference);
        if (!(difference <= worst)) worst = difference;
        if (!(difference <= TOLERANCE) || (int)plan->status != vector_status[k]) faults++;
        if (memcmp(plan->endpoints, plans[1][k].endpoints, sizeof plan->endpoints) != 0) {
            printf("step %d differs between two runs\n", k);
            faults++;
        }
    }
    printf("%d vectors, %d faults, largest difference %.3g, planner %lu bytes, solver workspace %lu bytes\n", VECTORS,
           faults, worst, (unsigned long)gbt_planner_bytes(), (unsigned long)gbt_workspace_bytes());
    return faults > 0;
}

static void dump(void)
{
    run(plans[0]);
    for (int k = 0; k < VECTORS; k++) {
        printf("%d", (int)plans[0][k].status);
        for (int a = 0; a < GBT_PIECES * GBT_FLAT; a++)
            printf(" %.17g", (double)(&plans[0][k].endpoints[0][0])[a]);
        printf("\n");
    }
}

static int fail(void)
{
    gbt_real state[GBT_STATE];
    memcpy(state, vector_state[0], sizeof state);
    state[0] = (gbt_real)NAN;
    gbt_plan_init(&planner);
#if GBT_MOMENTS
    return (int)gbt_plan(&planner, state, vector_mean[0], vector_covariance[0], vector_desired[0], &plans[0][0]);
#else
    return (int)gbt_plan_parameters(&planner, state, vector_parameters[0], &plans[0][0]);
#endif
}

int main(int count, char **arguments)
{
    if (count == 1) return compare();
    if (count == 2 && strcmp(arguments[1], "--fail") == 0) return fail();
    if (count == 2 && strcmp(arguments[1], "--dump") == 0) {
        dump();
        return 0;
    }
    fprintf(stderr, "usage: example [--dump | --fail]\n");
    return 64;
}
