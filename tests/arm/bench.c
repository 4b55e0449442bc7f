/* The recorded steps on a microcontroller: every plan against the recorded one, and what it takes of time and stack. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "board.h"
#include "gbt_places.h"
#include "gbt_plan.h"
#include "vectors.h"

static gbt_planner planner;
static gbt_plan_result plan;

static gbt_status step(int k)
{
    static const double origin[GBT_DIMENSION];
    gbt_plan_init(&planner);
    planner.warm = vector_warm[k][0] > 0;
    memcpy(planner.previous, vector_previous[k], sizeof planner.previous);
    gbt_begin(origin, vector_begin[k], planner.place, planner.begin);
#if GBT_MOMENTS
    return gbt_plan(&planner, vector_state[k], vector_mean[k], vector_covariance[k], vector_desired[k], &plan);
#else
    return gbt_plan_parameters(&planner, vector_state[k], vector_parameters[k], &plan);
#endif
}

static double difference(int k)
{
    double worst = 0;
    for (int a = 0; a < GBT_PIECES * GBT_FLAT; a++) {
        const double own = fabs((double)plan.endpoints[a / GBT_FLAT][a % GBT_FLAT] - (double)vector_endpoints[k][a]);
        if (!(own <= worst)) worst = own;
    }
    return worst;
}

int main(void)
{
    unsigned long deepest;
    double most = 0, sum = 0;
    paint_stack();
    start_timer();
    static gbt_status status[VECTORS];
    static double off[VECTORS], objective[VECTORS], broken[VECTORS];
    static int origin[VECTORS], iterations[VECTORS];
    static double took[VECTORS];
    for (int k = 0; k < VECTORS; k++) {
        const uint32_t before = TIMER;
        status[k] = step(k);
        took[k] = instructions_since(before);
        off[k] = difference(k);
        objective[k] = (double)plan.objective;
        broken[k] = (double)plan.piece_violation[0];
        origin[k] = (int)plan.origin;
        iterations[k] = plan.iterations;
        sum += took[k];
        if (took[k] > most) most = took[k];
    }
    deepest = stack_used(); /* before printf, which takes a good deal of it */
    for (int k = 0; k < VECTORS; k++)
        printf("step %d status %d recorded %d origin %d iterations %d objective %.9g broken %.3g difference %.3g "
               "instructions %.0f\n",
               k, (int)status[k], vector_status[k], origin[k], iterations[k], objective[k], broken[k], off[k], took[k]);
    printf("steps %d mean %.0f most %.0f stack %lu planner %lu result %lu\n", VECTORS, sum / VECTORS, most, deepest,
           (unsigned long)gbt_planner_bytes(), (unsigned long)sizeof plan);
    return 0;
}
