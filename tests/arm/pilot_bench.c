/* A recorded closed loop of the pilot on a microcontroller: every command against Python's, and what the step takes of
   time and stack. A step is a navigation, the measurements that came, and the command. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "board.h"
#include "gbt_pilot.h"
#include "pilot_vectors.h"

static gbt_pilot pilot;
static gbt_command command;

static struct {
    double time, took, off, within;
    int planned, status, origin, iterations, same, steady;
} steps[PILOT_CALLS];

static double difference(int k)
{
    double worst = 0;
    for (int i = 0; i < GBT_INPUTS; i++) {
        const double own = fabs((double)command.thrust[i] - (double)pilot_calls[k].numbers[i]) / (double)gbt_thrust_max[i];
        if (!(own <= worst)) worst = own;
    }
    return worst;
}

static int measure(int k)
{
    gbt_sensor_pose sensor = {0};
    const gbt_real *value = pilot_calls[k].numbers;
    sensor.sensor = pilot_calls[k].sensor;
    sensor.frame = pilot_calls[k].earth ? GBT_EARTH : GBT_AS_CONFIGURED;
    return (int)gbt_pilot_measure(&pilot, (gbt_kind)pilot_calls[k].kind, value,
                                  pilot_calls[k].stated ? value + GBT_DIMENSION : 0, &sensor, pilot_calls[k].time);
}

int main(void)
{
    int count = 0, same = 1, steady = 1;
    double took = 0;
    paint_stack();
    start_timer();
    gbt_pilot_init(&pilot);
    for (int k = 0; k < PILOT_CALLS; k++) {
        const gbt_real *numbers = pilot_calls[k].numbers;
        const double time = pilot_calls[k].time;
        const uint32_t before = TIMER;
        if (pilot_calls[k].call == NAVIGATED)
            same &= (int)gbt_pilot_navigate(&pilot, time, numbers, numbers + GBT_POSE, 0) == pilot_calls[k].answer;
        else if (pilot_calls[k].call == MEASURED)
            same &= measure(k) == pilot_calls[k].answer;
        else
            gbt_pilot_command(&pilot, time, &command);
        took += instructions_since(before);
        if (pilot_calls[k].call != COMMANDED) continue;
        steps[count].time = time;
        steps[count].took = took;
        steps[count].off = difference(k);
        steps[count].within = pilot_calls[k].within;
        steps[count].planned = pilot.guidance.planned_at == time && command.planned;
        steps[count].status = (int)command.planner;
        steps[count].origin = (int)command.origin;
        steps[count].iterations = pilot.guidance.plan.iterations;
        if (pilot_calls[k].plan > 0) steady = pilot_calls[k].within > 0;
        steps[count].steady = steady;
        steps[count].same = same && command.notes == pilot_calls[k].answer;
        count++;
        same = 1;
        took = 0;
        if (pilot_calls[k].plan == 0) continue;
        memcpy(pilot.guidance.room.planner.previous, pilot_plans[pilot_calls[k].plan - 1], sizeof pilot.guidance.room.planner.previous);
        memcpy(pilot.guidance.follower.top, pilot_plans[pilot_calls[k].plan - 1], sizeof pilot.guidance.follower.top);
    }
    const unsigned long deepest = stack_used(); /* before printf, which takes a good deal of it */
    for (int k = 0; k < count; k++)
        printf("time %.3f within %.3g planned %d status %d origin %d iterations %d same %d steady %d difference %.3g instructions %.0f\n",
               steps[k].time, steps[k].within, steps[k].planned, steps[k].status, steps[k].origin, steps[k].iterations,
               steps[k].same, steps[k].steady, steps[k].off, steps[k].took);
    printf("commands %d stack %lu pilot %lu planner %lu\n", count, deepest, (unsigned long)gbt_pilot_bytes(),
           (unsigned long)gbt_planner_bytes());
    return 0;
}
