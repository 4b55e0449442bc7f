/* The recorded steps on a microcontroller: every plan against the recorded one, and what it takes of time and stack.

   Time is counted in instructions: with one instruction a nanosecond (qemu -icount shift=0) and a clock of 25 MHz the
   system timer counts one in 40 of them. The stack is painted, and what is no longer painted has been used. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "gbt_plan.h"
#include "vectors.h"

#define TIMER_CONTROL (*(volatile uint32_t *)0xE000E010)
#define TIMER_TOP (*(volatile uint32_t *)0xE000E014)
#define TIMER (*(volatile uint32_t *)0xE000E018)
#define TIMER_MASK 0xFFFFFFu
#define INSTRUCTIONS_A_TICK 40
#define WORDS 16384 /* of stack that are painted */
#define PAINT 0xC0FFEE11u

extern uint32_t stack_top[];

static gbt_planner planner;
static gbt_plan_result plan;

static gbt_status step(int k)
{
    gbt_plan_init(&planner);
    planner.warm = vector_warm[k][0] > 0;
    memcpy(planner.previous, vector_previous[k], sizeof planner.previous);
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

static uint32_t *bottom(void) { return stack_top - WORDS; }

static void paint(void)
{
    uint32_t *here;
    __asm volatile("mov %0, sp" : "=r"(here));
    for (uint32_t *word = bottom(); word < here; word++) *word = PAINT;
}

/* Bytes of the stack that have been used since. */
static unsigned long used(void)
{
    uint32_t *word = bottom();
    while (*word == PAINT) word++;
    return (unsigned long)((uintptr_t)stack_top - (uintptr_t)word);
}

int main(void)
{
    unsigned long most = 0, deepest;
    double sum = 0;
    paint();
    TIMER_TOP = TIMER_MASK;
    TIMER = 0;
    TIMER_CONTROL = 5; /* enabled, clock of the processor */
    static gbt_status status[VECTORS];
    static double off[VECTORS], objective[VECTORS], broken[VECTORS];
    static int origin[VECTORS], iterations[VECTORS];
    static unsigned long took[VECTORS];
    for (int k = 0; k < VECTORS; k++) {
        const uint32_t before = TIMER;
        status[k] = step(k);
        took[k] = (unsigned long)((before - TIMER) & TIMER_MASK) * INSTRUCTIONS_A_TICK;
        off[k] = difference(k);
        objective[k] = (double)plan.objective;
        broken[k] = (double)plan.piece_violation[0];
        origin[k] = (int)plan.origin;
        iterations[k] = plan.iterations;
        sum += (double)took[k];
        if (took[k] > most) most = took[k];
    }
    deepest = used(); /* before printf, which takes a good deal of it */
    for (int k = 0; k < VECTORS; k++)
        printf("step %d status %d recorded %d origin %d iterations %d objective %.9g broken %.3g difference %.3g "
               "instructions %lu\n",
               k, (int)status[k], vector_status[k], origin[k], iterations[k], objective[k], broken[k], off[k], took[k]);
    printf("steps %d mean %.0f most %lu stack %lu planner %lu result %lu\n", VECTORS, sum / VECTORS, most, deepest,
           (unsigned long)gbt_planner_bytes(), (unsigned long)sizeof plan);
    return 0;
}
