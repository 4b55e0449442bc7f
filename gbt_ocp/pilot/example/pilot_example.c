/* Replays a closed loop of the pilot in Python: the same calls, and the answers and commands compared.

   Where two plans are about equally good, the last bit decides between them. So the pilot goes on from Python's plan after
   each command, commands that hang on rounding are not compared, and others as closely as rounding allows. In single
   precision the difference is printed and is no fault. */
#include <math.h>
#include <stdio.h>

#include "gbt_pilot.h"
#include "pilot_vectors.h"

static gbt_pilot pilot; /* static: too large for many an embedded stack */
static gbt_command command;

static int measure(int k)
{
    const gbt_real *value = pilot_calls[k].numbers;
    gbt_sensor_pose sensor = {0};
    sensor.sensor = pilot_calls[k].sensor;
    sensor.frame = pilot_calls[k].earth ? GBT_EARTH : GBT_AS_CONFIGURED;
    return (int)gbt_pilot_measure(&pilot, (gbt_kind)pilot_calls[k].kind, value,
                                  pilot_calls[k].stated ? value + GBT_DIMENSION : 0, &sensor, pilot_calls[k].time);
}

/* The largest difference of a thrust over its limit. */
static double difference(int k)
{
    double worst = 0;
    for (int i = 0; i < GBT_INPUTS; i++) {
        const double own = fabs((double)command.thrust[i] - (double)pilot_calls[k].numbers[i]) / (double)gbt_thrust_max[i];
        if (!(own <= worst)) worst = own;
    }
    return worst;
}

int main(void)
{
    const int exact = sizeof(gbt_real) == sizeof(double);
    int faults = 0, commands = 0, compared = 0, steady = 1; /* steady: whether the last plan does not hang on rounding */
    double worst = 0;
    gbt_pilot_init(&pilot);
    for (int k = 0; k < PILOT_CALLS; k++) {
        const gbt_real *numbers = pilot_calls[k].numbers;
        const double time = pilot_calls[k].time;
        int answer;
        if (pilot_calls[k].call == NAVIGATED) {
            answer = (int)gbt_pilot_navigate(&pilot, time, numbers, numbers + GBT_POSE, 0);
        } else if (pilot_calls[k].call == MEASURED) {
            answer = measure(k);
        } else {
            gbt_pilot_command(&pilot, time, &command);
            const double off = difference(k);
            commands++;
#if GBT_CURRENT == 2
            /* the vehicle had Python's thrust */
            for (int i = 0; i < GBT_INPUTS; i++)
                pilot.current.command[pilot.current.commands - 1].thrust[i] = numbers[i];
#endif
            answer = pilot_calls[k].answer;
            if (pilot_calls[k].plan > 0) {
                gbt_guidance_replace(&pilot.guidance, pilot_plans[pilot_calls[k].plan - 1]);
                steady = pilot_calls[k].within > 0;
            }
            if (pilot_calls[k].within > 0) {
                compared++;
                if (exact && steady) answer = command.notes;
                if (!(off <= worst)) worst = off;
                if (exact && !(off <= pilot_calls[k].within)) {
                    printf("command at %g s: thrust differs by %.3g of its limit, allowed %.3g\n", time, off,
                           pilot_calls[k].within);
                    faults++;
                }
            }
        }
        if (answer != pilot_calls[k].answer) {
            printf("call %d at %g s: answer %d, recorded %d\n", k, time, answer, pilot_calls[k].answer);
            faults++;
        }
    }
    printf("%d commands, %d compared, %d faults, largest difference %.3g, pilot %lu bytes\n", commands, compared, faults, worst,
           (unsigned long)gbt_pilot_bytes());
    return faults > 0;
}
