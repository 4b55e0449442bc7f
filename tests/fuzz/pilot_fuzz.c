/* Sequences of calls of a pilot that nobody would make on purpose: bearings out of order, numbers that are none, clocks that
   step, teleports, bursts. Every answer has to be a named one, every thrust within its limits, and the iterations of the
   planner within what they are bounded by. The first argument is the number of sequences, the second the seed. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "gbt_pilot.h"

#define DEADLINE 3 /* iterations of a plan: many sequences count for more here than good plans */

static gbt_pilot pilot;
static gbt_command command;
static unsigned long long state;

static double drawn(void)
{
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return (double)(state >> 11) / 9007199254740992.0;
}

static int below(int count) { return (int)(count * drawn()); }

/* a number, or now and then one that is none, or too large, or too small */
static double odd(double usual, double share)
{
    static const double strange[] = {NAN, INFINITY, -INFINITY, 0, -0.0, 1e300, -1e300, 1e18, 1e-300, 5e-324, 3.2e38};
    return drawn() < share ? strange[below(11)] : usual;
}

typedef struct {
    double time, clock, own[3], share; /* true time, how far the clock is off, where the vehicle is, how often numbers are odd */
} scene;

static int navigate(scene *now)
{
    gbt_real pose[GBT_POSE], velocity[GBT_POSE], covariance[GBT_POSE * GBT_POSE] = {0};
    for (int j = 0; j < GBT_POSE; j++) {
        if (j < 3 && drawn() < 0.02) now->own[j] += 1e4 * (drawn() - 0.5); /* a teleport */
        pose[j] = (gbt_real)odd(now->own[j % 3] + sin(0.3 * now->time + j), now->share);
        velocity[j] = (gbt_real)odd(0.3 * cos(0.3 * now->time + j), now->share);
    }
    covariance[GBT_POSE * GBT_POSE - 1] = (gbt_real)odd(1e-4, now->share);
    return (int)gbt_pilot_navigate(&pilot, odd(now->time + now->clock, now->share), pose, velocity,
                                   drawn() < 0.5 ? covariance : 0);
}

static int measure(const scene *now)
{
    const int kind = drawn() < 0.6 ? (GBT_DIMENSION == 2 ? GBT_AZIMUTH : GBT_AZIMUTH_ELEVATION) : below(8) - 1;
    const double back = drawn() < 0.5 ? 3 * drawn() * drawn() : 0; /* out of order */
    gbt_sensor_pose sensor = {0};
    gbt_real value[3], sigma[3];
    for (int j = 0; j < 3; j++) {
        value[j] = (gbt_real)odd(0.5 + 0.1 * sin(now->time + j) + 0.02 * drawn(), now->share);
        sigma[j] = (gbt_real)odd(0.005 + 0.05 * drawn(), now->share);
    }
    sensor.sensor = drawn() < 0.8 ? 0 : below(14) - 2;
    sensor.frame = (gbt_frame)below(3);
    sensor.mounted = drawn() < 0.3;
    sensor.yaw = (gbt_real)odd(0.1, now->share);
    return (int)gbt_pilot_measure(&pilot, (gbt_kind)kind, value, drawn() < 0.5 ? sigma : 0, drawn() < 0.5 ? &sensor : 0,
                                  odd(now->time + now->clock - back, now->share));
}

static unsigned long statuses[5], answers[GBT_ANSWERS], notes[8], faults;

static void fault(const char *what, unsigned long sequence)
{
    if (faults++ < 20) printf("sequence %lu: %s\n", sequence, what);
}

static void ask(const scene *now, unsigned long sequence)
{
    const double time = odd(now->time + now->clock, now->share);
    const gbt_command_status status = gbt_pilot_command(&pilot, time, &command);
    if ((int)status < 0 || (int)status > 4 || status != command.status) fault("a status without a name", sequence);
    else statuses[status]++;
    if (command.notes < 0 || command.notes > 255) fault("notes without a name", sequence);
    for (int bit = 0; bit < 8; bit++) notes[bit] += (unsigned)(command.notes >> bit) & 1u;
    for (int i = 0; i < GBT_INPUTS; i++)
        if (!(fabs((double)command.thrust[i]) <= (double)gbt_thrust_max[i] * (1 + 1e-6)))
            fault("a thrust beyond its limit", sequence);
    if (pilot.guidance.plan.iterations < 0 || pilot.guidance.plan.iterations > DEADLINE)
        fault("more iterations than the deadline", sequence);
    if ((int)pilot.guidance.plan.status < 0 || (int)pilot.guidance.plan.status > 16)
        fault("a planner's status without a name", sequence);
}

static void take(int answer, unsigned long sequence)
{
    if (answer < 0 || answer >= GBT_ANSWERS) fault("an answer without a name", sequence);
    else answers[answer]++;
}

int main(int count, char **given)
{
    const unsigned long sequences = count > 1 ? strtoul(given[1], 0, 10) : 1000;
    const unsigned long long seed = count > 2 ? strtoull(given[2], 0, 10) : 0;
    unsigned long calls = 0;
    for (unsigned long k = 0; k < sequences; k++) {
        state = seed * 1000003ull + k;
        for (int warm = 0; warm < 3; warm++) drawn();
        scene now = {drawn() < 0.3 ? 1e9 * drawn() : 0, 0, {drawn(), drawn(), -drawn()}, 0};
        if (drawn() < 0.2) now.own[0] += 1e7 * drawn();
        now.share = drawn() < 0.5 ? 0 : 0.1 * drawn();
        gbt_pilot_init(&pilot);
        pilot.guidance.room.planner.settings.deadline = DEADLINE;
        const int steps = 4 + below(12);
        for (int step = 0; step < steps; step++) {
            now.time += drawn() < 0.05 ? 100 * drawn() : 0.3 * drawn();
            if (drawn() < 0.04) now.clock += 20 * (drawn() - 0.5); /* the clock is set */
            if (drawn() < 0.005) now.clock += 1e9 * (drawn() - 0.5);
            if (drawn() < 0.9) take(navigate(&now), k);
            for (int burst = drawn() < 0.01 ? 120 : below(3); burst > 0; burst--, calls++) take(measure(&now), k);
            if (drawn() < 0.5) ask(&now, k);
            calls += 2;
        }
    }
    printf("%lu faults, %lu sequences, %lu calls; statuses", faults, sequences, calls);
    for (int k = 0; k < 5; k++) printf(" %lu", statuses[k]);
    printf("; answers");
    for (int k = 0; k < GBT_ANSWERS; k++) printf(" %lu", answers[k]);
    printf("; notes");
    for (int k = 0; k < 8; k++) printf(" %lu", notes[k]);
    printf("\n");
    return faults > 0;
}
